//! The bits of masks that are set, in their order.

/// This number of the bits that are set, lowest first.
pub(super) fn first_of(mask: u64, max: u8) -> u64 {
    if mask.count_ones() <= u32::from(max) {
        return mask;
    }
    Bits::of(mask).take(usize::from(max)).fold(0, |first, (_, bit)| first | bit)
}

/// The bits of a mask that are set, lowest first: index and mask of each. In halves: the chip has 32 bits.
pub(super) struct Bits {
    low: u32,
    high: u32,
}

impl Bits {
    pub(super) fn of(mask: u64) -> Self {
        Self { low: mask as u32, high: (mask >> 32) as u32 }
    }
}

impl Iterator for Bits {
    type Item = (usize, u64);

    fn next(&mut self) -> Option<Self::Item> {
        if self.low != 0 {
            let (index, bit) = take_lowest(&mut self.low);
            Some((index, bit.into()))
        } else if self.high != 0 {
            let (index, bit) = take_lowest(&mut self.high);
            Some((index.wrapping_add(32), u64::from(bit) << 32))
        } else {
            None
        }
    }
}

fn take_lowest(mask: &mut u32) -> (usize, u32) {
    let bit = *mask & mask.wrapping_neg();
    *mask ^= bit;
    (bit.trailing_zeros() as usize, bit)
}
