//! Solenoid outputs on a chain of 74HC595 shift registers.
//!
//! Lines leave highest first, so that line 0 ends at the first output of the first chip. All 64 lines are shifted each
//! time, however short the chain is: what a shorter chain does not need falls off its end, and no chip of a longer one
//! is left with what another shift had for another chip. The outputs follow the latch, never the shifting. Output enable
//! is active low: high puts all lines off in one edge, whatever they hold.
mod read_back;

use core::convert::Infallible;

use darm_core::sequencer::{EnableLevel, FarEnd};
use embedded_hal::digital::{InputPin, OutputPin};
pub use read_back::ReadBack;

/// Unchanged lines are shifted again after this many ticks, so that a disturbed register does not stay wrong.
const REFRESH_TICKS: u8 = 100;
/// Times in a row that something else comes back before the chain counts as broken: one may be a disturbed register.
const BROKEN: u8 = 2;
/// Ticks in a row that output enable reads the other level before it counts as stuck: one may be a disturbance.
const STUCK: u8 = 2;
/// Times that a far end that does not answer at the start is asked again, with each refresh: its supply may come later than that
/// of the board.
const RETRIES: u8 = 3;

/// What carries the lines to the outputs.
pub trait Chain {
    /// Brings 64 lines to the outputs, the highest bit first, and latches them.
    fn shift(&mut self, lines: u64);

    /// Does the same with the lines that it brought last; whether they came out of the far end meanwhile. `None` where nobody
    /// looks there.
    fn verify(&mut self, lines: u64) -> Option<bool> {
        self.shift(lines);
        None
    }

    /// Shifts a pattern in, and leaves the outputs as they are. While all lines are low and the outputs are disabled.
    fn prime(&mut self) {}

    /// Counts the chips by what comes out while zeros follow the pattern of [`Chain::prime`]. 0 where the far end does not answer,
    /// `None` where the board has no input for it.
    fn count(&mut self) -> Option<u8> {
        None
    }

    /// Whether the lines that it brought last have not reached the latch a tick later. A chain that the processor drives edge by
    /// edge is never stuck.
    fn is_stuck(&self) -> bool {
        false
    }

    /// Enables or disables all outputs, in one edge and after the last [`Chain::shift`] has been latched.
    fn set_enabled(&mut self, enabled: bool);

    /// Whether the pin of output enable has the level that disables the outputs. `None` where nobody reads it: then an enable that
    /// does not follow the board is not detected.
    fn reads_disabled(&mut self) -> Option<bool>;
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
    E: OutputPin<Error = Infallible> + InputPin<Error = Infallible>,
{
    #[inline(always)]
    fn shift(&mut self, lines: u64) {
        self.shift_looking(lines, || {});
    }

    #[inline(always)]
    fn set_enabled(&mut self, enabled: bool) {
        let Ok(()) = if enabled { self.enable.set_low() } else { self.enable.set_high() };
    }

    fn reads_disabled(&mut self) -> Option<bool> {
        let Ok(is_high) = self.enable.is_high();
        Some(is_high)
    }
}

impl<D, C, L, E> Pins<D, C, L, E>
where
    D: OutputPin<Error = Infallible>,
    C: OutputPin<Error = Infallible>,
    L: OutputPin<Error = Infallible>,
    E: OutputPin<Error = Infallible>,
{
    /// Shifts, and calls `look` before each rising edge of the clock.
    #[inline(always)]
    fn shift_looking(&mut self, lines: u64, look: impl FnMut()) {
        self.shift_without_latch(lines, look);
        let Ok(()) = self.latch.set_high();
        let Ok(()) = self.latch.set_low();
    }

    /// The same, and the outputs stay as they are.
    #[inline(always)]
    fn shift_without_latch(&mut self, lines: u64, mut look: impl FnMut()) {
        // Halves, since a shift of 64 bits costs the chip several instructions.
        for half in [(lines >> 32) as u32, lines as u32] {
            let (mut rest, mut level) = (half, None);
            for _ in 0..u32::BITS {
                let bit = rest & 1 << 31 != 0;
                if level != Some(bit) {
                    let Ok(()) = if bit { self.data.set_high() } else { self.data.set_low() };
                    level = Some(bit);
                }
                look();
                let Ok(()) = self.clock.set_high();
                let Ok(()) = self.clock.set_low();
                rest <<= 1;
            }
        }
    }
}

/// Driver of the chain.
pub struct Solenoids<C> {
    chain: C,
    /// Lines that the latch holds.
    latched: u64,
    enabled: bool,
    /// Ticks in a row in which output enable has not followed.
    enable_errors: u8,
    far_end: FarEnd,
    /// The registers have the pattern by which chips are counted.
    primed: bool,
    /// Times that the far end was asked again.
    retries: u8,
    /// Ticks without a change since the last refresh.
    age_ticks: u8,
    /// The tick has obeyed an order.
    busy: bool,
    /// Refreshes at which something else came back, in all and in a row.
    errors: u32,
    errors_in_a_row: u8,
}

impl<C: Chain> Solenoids<C> {
    /// Takes the chain, disables all outputs, and only then brings the first lines to them: all low. Reads output enable back.
    pub fn new(chain: C) -> Self {
        let mut solenoids = Self {
            chain,
            latched: 0,
            enabled: true,
            enable_errors: 0,
            far_end: FarEnd::Absent,
            primed: false,
            retries: 0,
            age_ticks: 0,
            busy: false,
            errors: 0,
            errors_in_a_row: 0,
        };
        solenoids.safe();
        solenoids.chain.shift(0);
        if solenoids.enable_differs() {
            solenoids.enable_errors = STUCK;
        }
        solenoids.chain.prime();
        solenoids.count();
        solenoids
    }

    /// What carries the lines.
    pub fn chain(&self) -> &C {
        &self.chain
    }

    /// The same, to drive what else is on its pins.
    pub fn chain_mut(&mut self) -> &mut C {
        &mut self.chain
    }

    /// Drives the lines. Shifts only what changed or is due for a refresh. Call once a tick.
    ///
    /// Off comes before the new lines, on after them: no line carries current that was not requested, nor what a chain holds whose
    /// supply was lost meanwhile.
    pub fn apply(&mut self, lines: u64, enabled: bool) {
        self.look_at_enable();
        if !enabled {
            self.safe();
        }
        let is_stuck = self.chain.is_stuck();
        if is_stuck {
            self.note_error();
        }
        if self.latched != lines {
            self.chain.shift(lines);
            (self.latched, self.primed) = (lines, false);
        } else if !is_stuck {
            self.refresh(lines);
        }
        if enabled && !self.enabled {
            self.chain.set_enabled(true);
            (self.enabled, self.enable_errors) = (true, 0);
        }
    }

    /// Whether the tick has obeyed an order: a refresh that becomes due in it waits for the next one, and never longer.
    #[inline(always)]
    pub fn set_busy(&mut self, busy: bool) {
        self.busy = busy;
    }

    /// The chain does not return what is shifted into it, or does not bring it to the latch.
    #[inline(always)]
    pub fn is_broken(&self) -> bool {
        self.errors_in_a_row >= BROKEN
    }

    /// The level at which output enable stays although the other one is driven.
    #[inline(always)]
    pub fn enable_stuck(&self) -> Option<EnableLevel> {
        let driven_low = self.enabled;
        (self.enable_errors >= STUCK).then_some(if driven_low { EnableLevel::High } else { EnableLevel::Low })
    }

    /// What the far end of the chain shows.
    #[inline(always)]
    pub fn far_end(&self) -> FarEnd {
        self.far_end
    }

    /// Times that something else came back than was shifted in, and ticks in which the lines had not reached the latch.
    #[inline(always)]
    pub fn errors(&self) -> u32 {
        self.errors
    }

    /// Shifts unchanged lines again when they are due. After an error they are due in the next tick.
    fn refresh(&mut self, lines: u64) {
        self.age_ticks = self.age_ticks.saturating_add(1);
        if self.age_ticks < REFRESH_TICKS || self.busy && self.age_ticks == REFRESH_TICKS {
            return;
        }
        if matches!(self.far_end, FarEnd::Trying | FarEnd::Silent) && lines == 0 && !self.enabled {
            return self.ask_again();
        }
        if self.chain.verify(lines) == Some(false) {
            self.note_error();
        } else {
            self.errors_in_a_row = 0;
            self.age_ticks = 0;
        }
    }

    /// Asks a far end that is silent, in two ticks without an order, which are each as long as one with a refresh.
    fn ask_again(&mut self) {
        if self.busy {
            return;
        }
        self.primed = !self.primed;
        if self.primed {
            return self.chain.prime();
        }
        self.age_ticks = 0;
        self.retries = self.retries.saturating_add(1);
        self.count();
    }

    fn note_error(&mut self) {
        self.errors = self.errors.saturating_add(1);
        self.errors_in_a_row = self.errors_in_a_row.saturating_add(1);
    }

    /// Call before the level changes: it has been the same for a tick.
    fn look_at_enable(&mut self) {
        self.enable_errors = if self.enable_differs() { self.enable_errors.saturating_add(1) } else { 0 };
    }

    fn enable_differs(&mut self) -> bool {
        self.chain.reads_disabled() == Some(self.enabled)
    }

    /// Call while all lines are low and the outputs are disabled.
    fn count(&mut self) {
        self.far_end = match self.chain.count() {
            None => FarEnd::Absent,
            Some(0) if self.retries < RETRIES => FarEnd::Trying,
            Some(0) => FarEnd::Silent,
            Some(chips) => FarEnd::Chips(chips),
        };
    }

    /// All lines off, in one edge.
    pub fn safe(&mut self) {
        if self.enabled {
            self.chain.set_enabled(false);
            (self.enabled, self.enable_errors) = (false, 0);
        }
    }
}

#[cfg(test)]
mod tests;
