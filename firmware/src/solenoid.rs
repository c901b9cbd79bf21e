//! Solenoid outputs on a chain of 74HC595 shift registers.
//!
//! Lines leave highest first, so that line 0 ends at the first output of the first chip. All 64 lines are shifted each
//! time, however short the chain is: what a shorter chain does not need falls off its end, and no chip of a longer one
//! is left with what another shift had for another chip. The outputs follow the latch, never the shifting. Output enable
//! is active low: high puts all lines off in one edge, whatever they hold.
use core::convert::Infallible;

use embedded_hal::digital::OutputPin;

/// Unchanged lines are shifted again after this many ticks, so that a disturbed register does not stay wrong.
const REFRESH_TICKS: u8 = 100;

/// What carries the lines to the outputs.
pub trait Chain {
    /// Brings 64 lines to the outputs, the highest bit first, and latches them.
    fn shift(&mut self, lines: u64);

    /// Enables or disables all outputs, in one edge and after the last [`Chain::shift`] has been latched.
    fn set_enabled(&mut self, enabled: bool);
}

/// The four pins of a chain.
pub struct Pins<D, C, L, E> {
    /// Serial data of the first chip.
    pub data: D,
    /// Shift clock of all chips: takes the data at its rising edge.
    pub clock: C,
    /// Latch of all chips: the outputs take the shifted lines at its rising edge.
    pub latch: L,
    /// Output enable of all chips, active low.
    pub enable: E,
}

/// Pins that the processor drives edge by edge.
impl<D, C, L, E> Chain for Pins<D, C, L, E>
where
    D: OutputPin<Error = Infallible>,
    C: OutputPin<Error = Infallible>,
    L: OutputPin<Error = Infallible>,
    E: OutputPin<Error = Infallible>,
{
    #[inline(always)]
    fn shift(&mut self, lines: u64) {
        // Halves, since a shift of 64 bits costs the chip several instructions.
        for half in [(lines >> 32) as u32, lines as u32] {
            let (mut rest, mut level) = (half, None);
            for _ in 0..u32::BITS {
                let bit = rest & 1 << 31 != 0;
                if level != Some(bit) {
                    let Ok(()) = if bit { self.data.set_high() } else { self.data.set_low() };
                    level = Some(bit);
                }
                let Ok(()) = self.clock.set_high();
                let Ok(()) = self.clock.set_low();
                rest <<= 1;
            }
        }
        let Ok(()) = self.latch.set_high();
        let Ok(()) = self.latch.set_low();
    }

    #[inline(always)]
    fn set_enabled(&mut self, enabled: bool) {
        let Ok(()) = if enabled { self.enable.set_low() } else { self.enable.set_high() };
    }
}

/// Driver of the chain.
pub struct Solenoids<C> {
    chain: C,
    /// Lines that the latch holds; `None` before the first time.
    latched: Option<u64>,
    enabled: bool,
    age_ticks: u8,
}

impl<C: Chain> Solenoids<C> {
    /// Takes the chain and switches all outputs off.
    pub fn new(chain: C) -> Self {
        let mut solenoids = Self { chain, latched: None, enabled: true, age_ticks: 0 };
        solenoids.safe();
        solenoids
    }

    /// What carries the lines.
    pub fn chain(&self) -> &C {
        &self.chain
    }

    /// Drives the lines. Shifts only what changed or is due for a refresh. Call once a tick.
    ///
    /// Off comes before the new lines, on after them: no line carries current that was not requested.
    pub fn apply(&mut self, lines: u64, enabled: bool) {
        if !enabled {
            self.safe();
        }
        self.age_ticks = self.age_ticks.saturating_add(1);
        if self.latched != Some(lines) || self.age_ticks >= REFRESH_TICKS {
            self.chain.shift(lines);
            self.latched = Some(lines);
            self.age_ticks = 0;
        }
        if enabled && !self.enabled {
            self.chain.set_enabled(true);
            self.enabled = true;
        }
    }

    /// All lines off, in one edge.
    pub fn safe(&mut self) {
        if self.enabled {
            self.chain.set_enabled(false);
            self.enabled = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Pins, REFRESH_TICKS, Solenoids};
    use core::cell::Cell;
    use core::convert::Infallible;
    use embedded_hal::digital::{ErrorType, OutputPin};

    /// What a chain of 74HC595 does with the four wires.
    #[derive(Default)]
    struct Chain {
        levels: [Cell<bool>; 4],
        shifted: Cell<u64>,
        latched: Cell<u64>,
        edges: Cell<u32>,
    }

    impl Chain {
        fn edge(&self, wire: usize, high: bool) {
            let rises = !self.levels[wire].replace(high) && high;
            self.edges.set(self.edges.get() + 1);
            if wire == 1 && rises {
                self.shifted.set(self.shifted.get() << 1 | u64::from(self.levels[0].get()));
            }
            if wire == 2 && rises {
                self.latched.set(self.shifted.get());
            }
        }

        fn outputs(&self, lines: u32) -> u64 {
            if self.levels[3].get() { 0 } else { self.latched.get() & (u64::MAX >> (64 - lines)) }
        }
    }

    struct Wire<'a>(&'a Chain, usize);
    impl ErrorType for Wire<'_> {
        type Error = Infallible;
    }
    impl OutputPin for Wire<'_> {
        fn set_low(&mut self) -> Result<(), Infallible> {
            self.0.edge(self.1, false);
            Ok(())
        }
        fn set_high(&mut self) -> Result<(), Infallible> {
            self.0.edge(self.1, true);
            Ok(())
        }
    }

    type OnChain<'a> = Solenoids<Pins<Wire<'a>, Wire<'a>, Wire<'a>, Wire<'a>>>;

    fn solenoids(chain: &Chain) -> OnChain<'_> {
        let wire = |index| Wire(chain, index);
        Solenoids::new(Pins { data: wire(0), clock: wire(1), latch: wire(2), enable: wire(3) })
    }

    #[test]
    fn lines_come_out_where_they_belong() {
        let chain = Chain::default();
        let mut solenoids = solenoids(&chain);
        solenoids.apply(0xa5_3c, true);
        assert_eq!(chain.outputs(16), 0xa5_3c);
        solenoids.apply(0x8000_0000_0000_0001, true);
        assert_eq!(chain.outputs(64), 0x8000_0000_0000_0001);
    }

    #[test]
    fn nothing_is_driven_before_it_is_enabled() {
        let chain = Chain::default();
        let mut solenoids = solenoids(&chain);
        solenoids.apply(0xff, false);
        assert_eq!((chain.outputs(16), chain.latched.get() & 0xff), (0, 0xff));
    }

    #[test]
    fn safe_takes_one_edge() {
        let chain = Chain::default();
        let mut solenoids = solenoids(&chain);
        solenoids.apply(0xff, true);
        let before = chain.edges.get();
        solenoids.safe();
        assert_eq!((chain.edges.get() - before, chain.outputs(16)), (1, 0));
    }

    #[test]
    fn unchanged_lines_are_shifted_only_for_a_refresh() {
        let chain = Chain::default();
        let mut solenoids = solenoids(&chain);
        solenoids.apply(1, true);
        chain.shifted.set(u64::MAX);
        let before = chain.edges.get();
        (1..REFRESH_TICKS).for_each(|_| solenoids.apply(1, true));
        assert_eq!(chain.edges.get(), before);
        solenoids.apply(1, true);
        assert_eq!(chain.outputs(16), 1);
    }

    #[test]
    fn no_line_beyond_the_table_ever_goes_high() {
        let chain = Chain::default();
        let mut solenoids = solenoids(&chain);
        (0..3).for_each(|_| {
            solenoids.apply(0xff, true);
            solenoids.apply(0x00, true);
            solenoids.apply(0xff, true);
        });
        assert_eq!(chain.outputs(24), 0xff, "a chain of three chips, a table of one");
    }
}
