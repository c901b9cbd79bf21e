//! A chain whose far end is wired back to an input: its chips are counted at the start, and what it holds is compared while it
//! runs.
use core::convert::Infallible;

use embedded_hal::digital::{InputPin, OutputPin};

use super::{Chain, Pins};

/// By which chips are counted. It never reaches the latch.
const PATTERN: u64 = 0b1010_0110;

/// Pins with an input on the far end of the chain, the serial output Q7S (QH') of its last chip.
pub struct ReadBack<D, C, L, E, Q> {
    pins: Pins<D, C, L, E>,
    far_end: Q,
    /// Shift registers that were found; `None` when nothing sensible came back.
    chips: Option<u8>,
}

impl<D, C, L, E, Q> ReadBack<D, C, L, E, Q>
where
    D: OutputPin<Error = Infallible>,
    C: OutputPin<Error = Infallible>,
    L: OutputPin<Error = Infallible>,
    E: OutputPin<Error = Infallible> + InputPin<Error = Infallible>,
    Q: InputPin<Error = Infallible>,
{
    /// Takes the pins, outputs disabled, and counts the chips.
    pub fn new(pins: Pins<D, C, L, E>, far_end: Q) -> Self {
        let mut chain = Self { pins, far_end, chips: None };
        chain.set_enabled(false);
        chain.prime();
        chain.count();
        chain
    }

    /// Shift registers that were counted, 1 to 8. `None` where nobody has wired the far end, or the chain is broken.
    pub fn chips(&self) -> Option<u8> {
        self.chips
    }

    /// Shifts; what came out of the far end, the first bit highest.
    #[inline(always)]
    fn exchange(&mut self, lines: u64) -> u64 {
        let (mut came, far_end) = (0, &mut self.far_end);
        self.pins.shift_looking(lines, || {
            let Ok(is_high) = far_end.is_high();
            came = came << 1 | u64::from(is_high);
        });
        came
    }
}

impl<D, C, L, E, Q> Chain for ReadBack<D, C, L, E, Q>
where
    D: OutputPin<Error = Infallible>,
    C: OutputPin<Error = Infallible>,
    L: OutputPin<Error = Infallible>,
    E: OutputPin<Error = Infallible> + InputPin<Error = Infallible>,
    Q: InputPin<Error = Infallible>,
{
    #[inline(always)]
    fn shift(&mut self, lines: u64) {
        self.pins.shift(lines);
    }

    fn prime(&mut self) {
        self.pins.shift_without_latch(PATTERN, || {});
    }

    /// The pattern comes back after eight clocks a chip.
    fn count(&mut self) -> Option<u8> {
        let came = self.exchange(0);
        self.chips = (1..=8).find(|chips| came == PATTERN.rotate_right(8 * u32::from(*chips)));
        Some(self.chips.unwrap_or(0))
    }

    /// Of the lines that a chain of `n` chips holds, the lowest `8 n`, all come out; then follow those that are shifted in.
    fn verify(&mut self, lines: u64) -> Option<bool> {
        let came = self.exchange(lines);
        self.chips.map(|chips| came == lines.rotate_right(8 * u32::from(chips)))
    }

    #[inline(always)]
    fn set_enabled(&mut self, enabled: bool) {
        self.pins.set_enabled(enabled);
    }

    fn reads_disabled(&mut self) -> Option<bool> {
        self.pins.reads_disabled()
    }
}
