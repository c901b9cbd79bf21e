//! Values of messages of ROS 2 and ROS 1 from their front.
//!
//! ROS 2 has CDR, the Common Data Representation of DDS.
//!
//! Four bytes name the order of bytes; a number is aligned to its size, counted behind these four; a text is its length
//! (u32, with the closing zero) and its bytes; a sequence is its length (u32) and its elements. Source: OMG, *DDS-XTypes*
//! 1.3, section 7.4 (XCDR version 1, plain).
//!
//! ROS 1 has the same numbers, little-endian, without the four bytes, without alignment, and texts without a zero.

/// A message that is read from its front.
pub(super) struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    is_big_endian: bool,
    is_ros_1: bool,
}

impl<'a> Cdr<'a> {
    /// A message of ROS 1.
    pub(super) fn ros_1(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, is_big_endian: false, is_ros_1: true }
    }

    /// A message of ROS 2, or why it is none that is read.
    pub(super) fn new(message: &'a [u8]) -> Result<Self, String> {
        let Some((header, bytes)) = message.split_at_checked(4) else {
            return Err("the message has no header of CDR".into());
        };
        match header[..2] {
            [0, kind @ (0 | 1)] => Ok(Self { bytes, at: 0, is_big_endian: kind == 0, is_ros_1: false }),
            [a, b] => {
                Err(format!("the message is in the representation {a:#04x} {b:#04x}, only plain CDR (0 or 1) is read"))
            }
            _ => Err("the message has no header of CDR".into()),
        }
    }

    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let taken = self.bytes.get(self.at..self.at.checked_add(n)?)?;
        self.at += n;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        if !self.is_ros_1 {
            self.at = self.at.next_multiple_of(N);
        }
        let mut bytes: [u8; N] = self.take(N)?.try_into().ok()?;
        if self.is_big_endian {
            bytes.reverse();
        }
        Some(bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn i32(&mut self) -> Option<i32> {
        self.array().map(i32::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Option<f64> {
        self.array().map(f64::from_le_bytes)
    }

    /// A text; `None` where its length does not fit or its closing zero is missing.
    pub(super) fn text(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        if self.is_ros_1 {
            return String::from_utf8(self.take(length)?.to_vec()).ok();
        }
        match self.take(length)?.split_last() {
            None => Some(String::new()),
            Some((0, text)) => String::from_utf8(text.to_vec()).ok(),
            Some(_) => None,
        }
    }

    /// A sequence whose elements have at least `bytes` each.
    pub(super) fn sequence<T>(
        &mut self,
        bytes: usize,
        mut element: impl FnMut(&mut Self) -> Option<T>,
    ) -> Option<Vec<T>> {
        let n = self.u32()? as usize;
        // No more than there can be, so that a damaged length reserves no memory.
        let fits = n.checked_mul(bytes)? <= self.bytes.len().saturating_sub(self.at) + 8;
        fits.then(|| (0..n).map(|_| element(self)).collect())?
    }
}

#[cfg(test)]
mod tests {
    use super::Cdr;

    #[test]
    fn numbers_are_aligned_in_both_orders() {
        let little = [0, 1, 0, 0, 2, 0, 0, 0, b'a', 0, 9, 9, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f];
        let mut cdr = Cdr::new(&little).unwrap();
        assert_eq!((cdr.text().as_deref(), cdr.f64(), cdr.f64()), (Some("a"), Some(1.0), None));
        let big = [0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0x3f, 0xf0, 0, 0, 0, 0, 0, 0];
        let mut cdr = Cdr::new(&big).unwrap();
        assert_eq!((cdr.u32(), cdr.f64()), (Some(1), Some(1.0)));
    }

    #[test]
    fn wrong_lengths_are_refused() {
        let long = [0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff];
        assert_eq!(Cdr::new(&long).unwrap().text(), None);
        assert_eq!(Cdr::new(&long).unwrap().sequence(8, Cdr::f64), None);
        let open = [0, 1, 0, 0, 1, 0, 0, 0, b'a'];
        assert_eq!(Cdr::new(&open).unwrap().text(), None, "no closing zero");
        assert!(Cdr::new(&[0, 3, 0, 0]).is_err() && Cdr::new(&[0]).is_err());
    }
}
