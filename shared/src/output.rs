//! How actuators, limit switches and servos are wired to the board, and the limits that no sender can exceed.
//!
//! An actuator with two states has one coil, one with three or four states has two: coil `b` is on when bit `b`
//! of the actuator's digit is set. Coils are numbered along the actuators, the way the text command `coil N` counts them.
//!
//! | drive       | lines        | while the coil is on                                          |
//! |-------------|--------------|---------------------------------------------------------------|
//! | `Hold`      | one          | the line is high (a valve)                                    |
//! | `PeakHold`  | pull, hold   | both high for `peak_ms`, then only the hold line               |
//! | `Latch`     | set, reset   | a pulse of `pulse_ms` on `set` when it is switched on, on `reset` when it is switched off, no current between |
#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::arithmetic_side_effects, clippy::unwrap_used))]

mod servo;
mod supply;
mod wiring;
mod wiring_error;

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::units::Micros;
pub use servo::ServoWiring;
pub use supply::{SwitchClock, SwitchLimit};
pub use wiring::{InputUse, LineUse, Wiring, check_servos, check_supply, input_bit};
pub use wiring_error::WiringError;

/// Lines of the output chain: eight 74HC595.
pub const MAX_LINES: usize = 64;
/// Coils that one board drives.
pub const MAX_COILS: usize = 48;
/// Discrete actuators of one arm.
pub const MAX_ACTUATORS: usize = 48;
/// Inputs of the board: limit switches and an emergency stop.
pub const MAX_INPUTS: usize = 13;
/// Servo joints on the bus.
pub const MAX_SERVOS: usize = 4;

/// Positions of a servo in one turn (Feetech STS).
pub const SERVO_STEPS_PER_TURN: f32 = 4096.0;

/// How a coil uses its lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Drive {
    /// On or off.
    Hold {
        /// Line of the coil.
        line: u8,
    },
    /// Full current to pull in, less to hold.
    PeakHold {
        /// Line of the full current.
        pull: u8,
        /// Line of the holding current.
        hold: u8,
        /// How long the full current lasts.
        peak_ms: u16,
    },
    /// Keeps its state without current.
    Latch {
        /// Line of the coil that sets.
        set: u8,
        /// Line of the coil that resets.
        reset: u8,
        /// Length of either pulse.
        pulse_ms: u16,
    },
}

impl Drive {
    /// From the beginning of one peak to that of the next it takes at least this many times the length of a peak.
    const PEAK_PERIODS: u32 = 10;

    /// The least time between the beginnings of two peaks of an output, so that the share of full current is at most
    /// 10 %; 0 for a drive without a peak. The duty of a profile is that of the holding current: a coil that is switched
    /// off for a moment and on again, over and over, would keep it and burn. A peak of 0 ms counts as one of 1 ms: full
    /// current flows for a tick.
    pub fn peak_pause(&self) -> Micros {
        match *self {
            Self::PeakHold { peak_ms, .. } => {
                Micros::from_millis(u32::from(peak_ms.max(1)).saturating_mul(Self::PEAK_PERIODS))
            }
            Self::Hold { .. } | Self::Latch { .. } => Micros(0),
        }
    }

    /// The lines that this drive uses.
    pub const fn lines(&self) -> (u8, Option<u8>) {
        match *self {
            Self::Hold { line } => (line, None),
            Self::PeakHold { pull, hold, .. } => (pull, Some(hold)),
            Self::Latch { set, reset, .. } => (set, Some(reset)),
        }
    }

    /// Whether this drive of a profile allows that of a table: the same lines, no longer peak or pulse.
    pub const fn allows(&self, table: &Self) -> bool {
        match (*self, *table) {
            (Self::Hold { line }, Self::Hold { line: wanted }) => line == wanted,
            (Self::PeakHold { pull, hold, peak_ms }, Self::PeakHold { pull: p, hold: h, peak_ms: wanted }) => {
                pull == p && hold == h && wanted <= peak_ms
            }
            (Self::Latch { set, reset, pulse_ms }, Self::Latch { set: s, reset: r, pulse_ms: wanted }) => {
                set == s && reset == r && wanted <= pulse_ms
            }
            _ => false,
        }
    }

    /// The limits of a coil whose owner gave none: safe for small solenoids and for valves.
    pub const fn default_limit(&self) -> CoilLimit {
        match self {
            Self::Hold { .. } => CoilLimit { max_on_ms: 300_000, duty_percent: 80, window_ms: 600_000 },
            Self::PeakHold { .. } => CoilLimit { max_on_ms: 60_000, duty_percent: 60, window_ms: 120_000 },
            Self::Latch { .. } => CoilLimit { max_on_ms: 200, duty_percent: 20, window_ms: 10_000 },
        }
    }
}

impl fmt::Display for Drive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Hold { line } => write!(f, "line {line}"),
            Self::PeakHold { pull, hold, peak_ms } => write!(f, "pull line {pull} for {peak_ms} ms, hold line {hold}"),
            Self::Latch { set, reset, pulse_ms } => write!(f, "set line {set}, reset line {reset} for {pulse_ms} ms"),
        }
    }
}

/// How long current may flow in a coil.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CoilLimit {
    /// Longest time on without a pause.
    pub max_on_ms: u32,
    /// Largest share of any window that the coil may be on, in percent.
    pub duty_percent: u8,
    /// Length of that window.
    pub window_ms: u32,
}

impl CoilLimit {
    /// Shortest window over which duty is counted. An output is looked at every 8 ms at the latest, which is to be a small
    /// part of it.
    pub const MIN_WINDOW_MS: u32 = 200;
    /// Longest window, and longest time on: their microseconds fit 32 bits.
    pub const MAX_WINDOW_MS: u32 = 3_600_000;
    /// Longest pulse of a latch.
    pub const MAX_PULSE_MS: u16 = 1_000;
    /// Longest peak.
    pub const MAX_PEAK_MS: u16 = 10_000;

    /// Whether these limits bound anything, and let the drive do what it is for.
    pub fn is_sound(&self, drive: &Drive) -> bool {
        let drive_fits = match *drive {
            Drive::Latch { pulse_ms, .. } => {
                (1..=Self::MAX_PULSE_MS).contains(&pulse_ms) && u32::from(pulse_ms) <= self.max_on_ms
            }
            Drive::PeakHold { peak_ms, .. } => peak_ms <= Self::MAX_PEAK_MS,
            Drive::Hold { .. } => true,
        };
        drive_fits
            && (Self::MIN_WINDOW_MS..=Self::MAX_WINDOW_MS).contains(&self.window_ms)
            && (1..=Self::MAX_WINDOW_MS).contains(&self.max_on_ms)
            && (1..=100).contains(&self.duty_percent)
    }

    /// Whether these limits of a profile allow those of a table: no looser, over the same window.
    pub const fn allows(&self, table: &Self) -> bool {
        table.max_on_ms <= self.max_on_ms
            && table.duty_percent <= self.duty_percent
            && table.window_ms == self.window_ms
    }
}

impl fmt::Display for CoilLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "on for {} ms, {} % of {} ms", self.max_on_ms, self.duty_percent, self.window_ms)
    }
}

/// One coil: its output, its lines and its limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Coil {
    /// Number of the board's output that feeds it.
    pub output: u8,
    /// How it uses its lines.
    pub drive: Drive,
    /// How long current may flow.
    pub limit: CoilLimit,
}

/// The switch that sees one actuator at its stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LimitSwitch {
    /// Input, the bit of [`crate::sequencer::Seen::switches`].
    pub input: u8,
    /// Digits in which the switch is closed: bit `d` for digit `d`.
    pub closed_in: u8,
}

impl LimitSwitch {
    /// Whether the switch is to be closed when its actuator rests in state `digit`.
    pub const fn closed(&self, digit: u8) -> bool {
        self.closed_in >> digit & 1 == 1
    }
}

/// One discrete actuator as the board sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ActuatorWiring {
    /// Number of states, 2 to 4.
    pub states: u8,
    /// Its limit switch, if it has one.
    pub switch: Option<LimitSwitch>,
    /// Longest time from the coil's change to the stop.
    pub travel_ms: u16,
}

impl ActuatorWiring {
    /// Number of coils: one for two states, two for more.
    pub const fn coils(&self) -> usize {
        if self.states > 2 { 2 } else { 1 }
    }
}
