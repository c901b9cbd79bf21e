//! What a board reports of itself: clock, cause of the last reset, errors of its lines, of its flash and of the output chain,
//! load, stack, supply and temperature.
//!
//! What a board does not measure is `None`. All counts are since the start.

use core::fmt;

use serde::{Deserialize, Serialize};

/// What a board reports of itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Health {
    /// What its clock comes from.
    pub clock: Option<ClockSource>,
    /// What caused its last reset.
    pub reset: Option<ResetCause>,
    /// Errors of the console's line.
    pub console: Option<LineErrors>,
    /// Errors of the servo bus's line.
    pub servo_bus: Option<LineErrors>,
    /// Visits of servos that got no answer.
    pub servos_unanswered: u32,
    /// Words of the flash whose error check failed.
    pub flash: Option<FlashErrors>,
    /// The output chain, where its far end is wired back.
    pub chain: Option<ChainHealth>,
    /// Settings of the chip that outlive a new firmware.
    pub options: Option<ChipOptions>,
    /// Share of the last second in which the core did not sleep, in thousandths.
    pub load_permille: Option<u16>,
    /// The stack.
    pub stack: Option<StackUse>,
    /// Supply of the chip, mV; of the board where its chip measures that.
    pub supply_mv: Option<u16>,
    /// Temperature of the chip, °C.
    pub chip_celsius: Option<i16>,
    /// The profile's threshold of that supply, mV: below it the safe state is latched.
    pub min_supply_mv: Option<u16>,
}

/// Words of the flash whose error check failed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FlashErrors {
    /// One bit was wrong and corrected: its cells wear out.
    pub corrected: u32,
    /// More bits were wrong, in the data, where checksums find them.
    pub damaged: u32,
}

/// How much of the stack was ever in use since the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StackUse {
    /// Bytes in use at most.
    pub used: u32,
    /// Bytes that it has.
    pub size: u32,
}

/// What a board's clock comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ClockSource {
    /// A crystal, or an oscillator that is locked to one.
    Crystal,
    /// An internal oscillator: the crystal did not start.
    Internal,
    /// An internal oscillator: the crystal has stopped since the start.
    CrystalLost,
}

/// What caused a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ResetCause {
    /// The supply came up, or had fallen below the brown-out level.
    Supply,
    /// The watchdog.
    Watchdog,
    /// The firmware, on request or after a crash.
    Firmware,
    /// The reset button, or a debugger.
    Pin,
}

/// Errors of a line since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LineErrors {
    /// Bytes that came before the last one had been fetched.
    pub overruns: u32,
    /// Bytes without a stop bit: the other side has another rate, or the line is broken.
    pub framing: u32,
    /// Bytes with a disturbed bit.
    pub noise: u32,
    /// Bytes for which the board had no room.
    pub dropped: u32,
}

/// The output chain as its far end shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChainHealth {
    /// Shift registers of eight lines that were found at the start.
    pub chips: u8,
    /// Times that something else came back than was shifted in.
    pub errors: u32,
}

/// Settings of the chip that outlive a new firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChipOptions {
    /// The board is reset while its supply is below this, mV.
    pub brown_out_mv: u16,
    /// Whether a debugger may read and write the chip.
    pub debugger_allowed: bool,
    /// Whether the on-times of the outputs survive a reset.
    pub keeps_on_times: bool,
}

impl LineErrors {
    /// All of them.
    pub const fn total(&self) -> u32 {
        self.overruns.saturating_add(self.framing).saturating_add(self.noise).saturating_add(self.dropped)
    }
}

impl fmt::Display for LineErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { overruns, framing, noise, dropped } = self;
        write!(f, "{overruns} overruns, {framing} framing errors, {noise} disturbed, {dropped} dropped")
    }
}

impl fmt::Display for ClockSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Crystal => "crystal",
            Self::Internal => "internal oscillator, the crystal did not start",
            Self::CrystalLost => "internal oscillator, the crystal has stopped",
        })
    }
}

impl fmt::Display for ResetCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Supply => "supply",
            Self::Watchdog => "watchdog",
            Self::Firmware => "firmware",
            Self::Pin => "reset pin",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{ChainHealth, ChipOptions, ClockSource, FlashErrors, Health, LineErrors, ResetCause, StackUse};
    use crate::units::Micros;
    use crate::wire::message::{Answer, Reply, Request};

    fn health() -> Health {
        Health {
            clock: Some(ClockSource::CrystalLost),
            reset: Some(ResetCause::Watchdog),
            console: Some(LineErrors { overruns: 1, framing: 2, noise: 3, dropped: 4 }),
            servo_bus: Some(LineErrors { overruns: 5, framing: 6, noise: 7, dropped: 300 }),
            servos_unanswered: 9,
            flash: Some(FlashErrors { corrected: 10, damaged: 11 }),
            chain: Some(ChainHealth { chips: 2, errors: 12 }),
            options: Some(ChipOptions { brown_out_mv: 2800, debugger_allowed: true, keeps_on_times: false }),
            load_permille: Some(300),
            stack: Some(StackUse { used: 9, size: 13 }),
            supply_mv: Some(3300),
            chip_celsius: Some(-2),
            min_supply_mv: Some(2900),
        }
    }

    #[test]
    fn golden_bytes_both_ways() {
        let mut bytes = [0; 64];
        assert_eq!(postcard::to_slice(&Request::Health, &mut bytes).unwrap(), [11]);
        let reply = Reply { at: Micros(5), result: Ok(Answer::Health(health())) };
        let encoded = postcard::to_slice(&reply, &mut bytes).unwrap();
        let known = [5, 0, 9, 1, 2, 1, 1, 1, 1, 2, 3, 4, 1, 5, 6, 7, 0xac, 2, 9, 1, 10, 11, 1, 2, 12, 1, 0xf0, 0x15];
        assert_eq!(encoded, [&known[..], &[1, 0, 1, 0xac, 2, 1, 9, 13, 1, 0xe4, 0x19, 1, 3, 1, 0xd4, 0x16]].concat());
        assert_eq!(postcard::from_bytes::<Reply>(encoded), Ok(reply));
    }

    #[test]
    fn a_board_that_knows_nothing_sends_zeros() {
        let mut bytes = [0xa5; 64];
        assert_eq!(postcard::to_slice(&Health::default(), &mut bytes).unwrap(), [0; 13]);
    }

    #[test]
    fn errors_add_up_to_the_largest_number_and_no_further() {
        let errors = LineErrors { overruns: u32::MAX, framing: 1, noise: 0, dropped: 0 };
        assert_eq!(errors.total(), u32::MAX);
        assert_eq!(LineErrors { overruns: 1, framing: 2, noise: 3, dropped: 4 }.total(), 10);
    }
}
