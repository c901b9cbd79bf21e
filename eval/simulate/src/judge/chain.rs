//! Eight 74HC595 in a chain, as the judge reads their four pins. A bit that nobody has shifted since power-on is unknown.

/// Pins of the chain as the judge numbers them.
pub const DATA: u8 = 0;
/// Shift clock.
pub const CLOCK: u8 = 1;
/// Latch.
pub const LATCH: u8 = 2;
/// Output enable, active low.
pub const ENABLE: u8 = 3;

/// What the 64 lines do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lines {
    /// Lines that are high for certain.
    pub high: u64,
    /// Driven lines whose level is unknown.
    pub unknown: u64,
}

/// Bits with the knowledge of them.
#[derive(Clone, Copy, Default)]
struct Bits {
    level: u64,
    known: u64,
}

/// The chain.
#[derive(Clone, Default)]
pub struct Chain {
    data: bool,
    clock: bool,
    latch: bool,
    driven: bool,
    stages: Bits,
    outputs: Bits,
}

impl Chain {
    /// Nothing drives the pins any more: output enable is pulled up.
    pub fn release(&mut self) {
        *self = Self { stages: self.stages, outputs: self.outputs, ..Self::default() };
    }

    /// The supply has come back: the registers may hold anything.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// One edge; true when the lines may have changed.
    pub fn edge(&mut self, pin: u8, high: bool) -> bool {
        match pin {
            DATA => self.data = high,
            CLOCK => {
                if high && !self.clock {
                    self.stages.level = self.stages.level << 1 | u64::from(self.data);
                    self.stages.known = self.stages.known << 1 | 1;
                }
                self.clock = high;
            }
            LATCH => {
                let rises = high && !self.latch;
                self.latch = high;
                if rises {
                    self.outputs = self.stages;
                }
                return rises;
            }
            _ => {
                self.driven = !high;
                return true;
            }
        }
        false
    }

    /// Whether output enable is low.
    pub fn is_driven(&self) -> bool {
        self.driven
    }

    /// The lines now.
    pub fn lines(&self) -> Lines {
        let Bits { level, known } = self.outputs;
        if self.driven { Lines { high: level & known, unknown: !known } } else { Lines::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::{CLOCK, Chain, DATA, ENABLE, LATCH, Lines};

    fn shift(chain: &mut Chain, bits: u64, count: u32) {
        for bit in (0..count).rev() {
            chain.edge(DATA, bits >> bit & 1 == 1);
            chain.edge(CLOCK, true);
            chain.edge(CLOCK, false);
        }
        chain.edge(LATCH, true);
        chain.edge(LATCH, false);
    }

    #[test]
    fn bits_that_nobody_shifted_are_unknown() {
        let mut chain = Chain::default();
        shift(&mut chain, 0x8001, 16);
        assert_eq!(chain.lines(), Lines::default(), "not driven");
        assert!(chain.edge(ENABLE, false));
        assert_eq!(chain.lines(), Lines { high: 0x8001, unknown: !0xffff });
        shift(&mut chain, 0x8000_0000_0000_0001, 64);
        assert_eq!(chain.lines(), Lines { high: 0x8000_0000_0000_0001, unknown: 0 });
        chain.release();
        assert_eq!(chain.lines(), Lines::default());
    }
}
