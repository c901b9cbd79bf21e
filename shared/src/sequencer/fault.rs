//! What latches the safe state.

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::units::{ActuatorId, Micros};

/// Why, when and in which row the safe state was latched.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fault {
    /// On the board's clock.
    pub at: Micros,
    /// The row that ran, if one ran.
    pub row: Option<u16>,
    /// What was wrong.
    pub kind: FaultKind,
}

/// What was wrong.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum FaultKind {
    /// An output was on for longer than it may.
    OnTooLong {
        /// Its number.
        output: u8,
    },
    /// An output was on for more than its share of the window, or its next peak came before its pause was over.
    Duty {
        /// Its number.
        output: u8,
    },
    /// More coils would have gone on at once than the supply can feed.
    TooManyCoils,
    /// A limit switch contradicts the word after the time of travel.
    Switch {
        /// Which actuator.
        actuator: ActuatorId,
        /// What the word says.
        expected_closed: bool,
        /// What the switch says.
        seen_closed: bool,
    },
    /// A servo did not reach the first row in time.
    ServoStalled {
        /// Index of the servo joint.
        servo: u8,
    },
    /// A servo stopped answering.
    ServoSilent {
        /// Index of the servo joint.
        servo: u8,
    },
    /// A servo reports an error.
    ServoError {
        /// Index of the servo joint.
        servo: u8,
        /// Its status byte.
        bits: u8,
    },
    /// A servo bears more than it may.
    ServoTorque {
        /// Index of the servo joint.
        servo: u8,
        /// Load as a share of the servo's own torque.
        load: f32,
    },
    /// A servo was seen out of its range.
    ServoRange {
        /// Index of the servo joint.
        servo: u8,
        /// Where it was seen.
        angle_rad: f32,
    },
    /// The emergency stop was pressed.
    EmergencyStop,
    /// The output chain does not hold what was shifted into it.
    Chain,
    /// Output enable is low although the board has disabled the outputs.
    OutputEnable,
    /// Output enable is high although the board has enabled the outputs.
    OutputEnableHigh,
    /// The far end of the output chain shows another number of chips than the profile has.
    FarEnd {
        /// Chips of the profile.
        expected: u8,
        /// Chips that were counted, 0 where the far end does not answer.
        counted: u8,
    },
    /// A servo turned faster than it may.
    ServoSpeed {
        /// Index of the servo joint.
        servo: u8,
    },
    /// A servo left the angle that it was to hold, or its target.
    ServoMoved {
        /// Index of the servo joint.
        servo: u8,
    },
    /// The supply of the board was below the profile's threshold in five measurements in a row, or in short dips that together took more than 1/21 of the time.
    Supply {
        /// What was measured last, mV; 0 where a measurement gave nothing.
        mv: u16,
        /// The threshold, mV.
        min_mv: u16,
    },
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {}", self.kind, self.at)?;
        self.row.map_or(Ok(()), |row| write!(f, ", row {row}"))
    }
}

impl fmt::Display for FaultKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let closed = |is: bool| if is { "closed" } else { "open" };
        match *self {
            Self::OnTooLong { output } => write!(f, "output {output} was on for longer than it may"),
            Self::Duty { output } => {
                write!(f, "output {output} was on, or had full current, for more than its share of the time")
            }
            Self::TooManyCoils => f.write_str("more coils would have gone on at once than the supply can feed"),
            Self::Switch { actuator, expected_closed, seen_closed } => write!(
                f,
                "actuator {}: limit switch expected {}, seen {}",
                actuator.0,
                closed(expected_closed),
                closed(seen_closed)
            ),
            Self::ServoStalled { servo } => write!(f, "servo {servo} did not reach the first row"),
            Self::ServoSilent { servo } => write!(f, "servo {servo} stopped answering"),
            Self::ServoError { servo, bits } => {
                write!(f, "servo {servo} reports error bits {bits:#04x}")
            }
            Self::ServoTorque { servo, load } => {
                write!(f, "servo {servo} bears {:.0} % of its torque", load * 100.0)
            }
            Self::ServoRange { servo, angle_rad } => {
                write!(f, "servo {servo} was seen out of its range at {:.1} deg", angle_rad.to_degrees())
            }
            Self::ServoSpeed { servo } => write!(f, "servo {servo} turned faster than its profile allows"),
            Self::ServoMoved { servo } => {
                write!(f, "servo {servo} left the angle that it was to hold, or its target; look for what pushes it")
            }
            Self::EmergencyStop => f.write_str("the emergency stop was pressed"),
            Self::Chain => f.write_str("the output chain does not return what was shifted into it; check its wiring"),
            Self::OutputEnable => f.write_str(
                "output enable is low although the board has disabled the outputs; switch the coils' supply off, check the wire",
            ),
            Self::OutputEnableHigh => f.write_str(
                "output enable is high although the board has enabled the outputs; check its wire for another driver or a short",
            ),
            Self::FarEnd { expected, counted: 0 } => write!(
                f,
                "the far end of the output chain does not answer, and the profile has a chain of {expected} chips; check the \
                 chain's supply and the wire from Q7S of its last chip, or take `chips` out of the profile's [chain]"
            ),
            Self::Supply { mv: 0, .. } => f.write_str(
                "the supply of the board is not measured, and the profile has a threshold; reset the board, or take \
                 `min_board_supply_mv` out of the profile",
            ),
            Self::Supply { mv, min_mv } => write!(
                f,
                "the supply of the board fell to {mv} mV, below the profile's {min_mv} mV; check its power supply and cable"
            ),
            Self::FarEnd { expected, counted } => write!(
                f,
                "the output chain has {counted} chips, and the profile has {expected}; correct `chips` in the profile's \
                 [chain], or the chain"
            ),
        }
    }
}
