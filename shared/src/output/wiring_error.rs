//! Why a wiring is refused.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::{CoilLimit, MAX_ACTUATORS, MAX_COILS, MAX_LINES, MAX_SERVOS, SwitchLimit};
use crate::units::ActuatorId;

/// Why a wiring is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum WiringError {
    /// More coils, actuators or servos than the board drives.
    TooMany,
    /// An actuator has fewer than 2 or more than 4 states.
    States {
        /// Which actuator.
        actuator: ActuatorId,
    },
    /// The coils do not match the actuators that stand before them.
    CoilCount {
        /// Which coil.
        coil: u8,
    },
    /// The line does not exist or another coil uses it.
    Line {
        /// Which line.
        line: u8,
    },
    /// The switch input does not exist or another actuator uses it.
    Input {
        /// Which input.
        input: u8,
    },
    /// A limit of an output is zero, beyond what the board can count, or shorter than its own pulse.
    CoilLimit {
        /// Which output.
        output: u8,
    },
    /// The output does not exist or another coil uses it.
    Output {
        /// Which output.
        output: u8,
    },
    /// The number of coils that may switch at once is 0 or above what the board counts.
    SwitchLimit,
    /// The servo's range, speed, torque or time-out makes no sense.
    Servo {
        /// Index of the servo.
        servo: u8,
    },
}

impl fmt::Display for WiringError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooMany => {
                write!(
                    f,
                    "at most {MAX_ACTUATORS} actuators, {MAX_COILS} coils and {MAX_SERVOS} servos fit on the board"
                )
            }
            Self::States { actuator } => write!(f, "actuator {} has not 2 to 4 states", actuator.0),
            Self::CoilCount { coil } => {
                write!(f, "coil {coil} belongs to no actuator, or a coil of an actuator is missing")
            }
            Self::Line { line } => write!(f, "line {line} is used twice or is not one of 0 to {}", MAX_LINES - 1),
            Self::Input { input } => {
                write!(f, "switch input {input} is used twice or does not exist")
            }
            Self::CoilLimit { output } => write!(
                f,
                "output {output}: the window must be {} to {} ms, the on-time at most as long, duty 1 to 100 %, a pulse at \
                 most {} ms and the on-time, a peak at most {} ms",
                CoilLimit::MIN_WINDOW_MS,
                CoilLimit::MAX_WINDOW_MS,
                CoilLimit::MAX_PULSE_MS,
                CoilLimit::MAX_PEAK_MS
            ),
            Self::Output { output } => {
                write!(f, "output {output} is used twice or is not one of 0 to {}", MAX_COILS - 1)
            }
            Self::SwitchLimit => write!(
                f,
                "1 to {} coils may switch within a window of 1 to {} ms",
                SwitchLimit::MAX_COILS,
                SwitchLimit::MAX_WINDOW_MS
            ),
            Self::Servo { servo } => write!(
                f,
                "servo {servo}: address, range, speed, torque or time-out are out of bounds, or its address is used twice"
            ),
        }
    }
}

impl core::error::Error for WiringError {}
