//! A chain of 74HC595 as its pins see it: edges in, output lines out.
//!
//! Data is shifted in at the rising edge of the clock; the rising edge of the latch shows the shift register at the
//! outputs; output enable is active low and takes all outputs away at once. The bit that is shifted in last is line 0.
//! Source: Nexperia, 74HC595 data sheet, function table.

/// Which pins of one bank drive the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChainPins {
    /// Serial data.
    pub data: u8,
    /// Shift clock.
    pub clock: u8,
    /// Latch.
    pub latch: u8,
    /// Output enable, active low.
    pub enable: u8,
}

/// The chain's registers and the levels of its pins.
#[derive(Clone, Debug)]
pub struct Chain {
    pins: ChainPins,
    levels: u16,
    shifted: u64,
    latched: u64,
    /// Outputs that exist: eight a chip.
    mask: u64,
}

impl Chain {
    /// A chain of `chips` that has just got its power; `levels` holds the pins' levels by number.
    pub fn new(pins: ChainPins, chips: usize, levels: u16) -> Self {
        let mask = u64::MAX.checked_shr(64 - 8 * chips.clamp(1, 8) as u32).unwrap_or(u64::MAX);
        Self { pins, levels, shifted: 0, latched: 0, mask }
    }

    /// Takes one edge; the lines when they may have changed.
    pub fn edge(&mut self, pin: u8, high: bool) -> Option<u64> {
        let bit = 1u16.checked_shl(u32::from(pin))?;
        let rises = high && self.levels & bit == 0;
        self.levels = if high { self.levels | bit } else { self.levels & !bit };
        if pin == self.pins.clock && rises {
            self.shifted = self.shifted << 1 | u64::from(self.level(self.pins.data));
        } else if pin == self.pins.latch && rises {
            self.latched = self.shifted & self.mask;
            return Some(self.lines());
        } else if pin == self.pins.enable {
            return Some(self.lines());
        }
        None
    }

    /// The output lines: bit `i` is line `i`; none is high while the outputs are disabled.
    pub fn lines(&self) -> u64 {
        if self.level(self.pins.enable) { 0 } else { self.latched }
    }

    fn level(&self, pin: u8) -> bool {
        self.levels >> pin & 1 == 1
    }
}

#[cfg(test)]
mod tests {
    use super::{Chain, ChainPins};

    const PINS: ChainPins = ChainPins { data: 7, clock: 5, latch: 4, enable: 15 };

    /// Edges that shift `lines` into `count` stages, as a driver makes them, and latch.
    fn shift(chain: &mut Chain, lines: u64, count: u32) {
        for bit in (0..count).rev() {
            chain.edge(PINS.data, lines >> bit & 1 == 1);
            chain.edge(PINS.clock, true);
            chain.edge(PINS.clock, false);
        }
        chain.edge(PINS.latch, true);
        chain.edge(PINS.latch, false);
    }

    #[test]
    fn lines_appear_with_the_latch_and_the_enable() {
        let mut chain = Chain::new(PINS, 2, 1 << PINS.enable);
        shift(&mut chain, 0x8001, 16);
        assert_eq!(chain.lines(), 0, "disabled");
        assert_eq!(chain.edge(PINS.enable, false), Some(0x8001));
        assert_eq!(chain.edge(PINS.enable, true), Some(0));
    }

    #[test]
    fn what_is_shifted_out_of_the_last_chip_is_lost() {
        let mut chain = Chain::new(PINS, 1, 0);
        shift(&mut chain, 0x00A5_A50F, 24);
        assert_eq!(chain.lines(), 0x0F);
    }

    #[test]
    fn a_repeated_level_is_no_edge() {
        let mut chain = Chain::new(PINS, 8, 0);
        chain.edge(PINS.data, true);
        chain.edge(PINS.clock, true);
        chain.edge(PINS.clock, true);
        assert_eq!(chain.edge(PINS.latch, true), Some(1));
    }

    #[test]
    fn sixty_four_lines_fit() {
        let mut chain = Chain::new(PINS, 8, 0);
        shift(&mut chain, 0x0123_4567_89AB_CDEF, 64);
        assert_eq!(chain.lines(), 0x0123_4567_89AB_CDEF);
    }
}
