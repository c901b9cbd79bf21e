//! Why a table is refused.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::MAX_ROWS;
use crate::output::WiringError;
use crate::profile::Mismatch;
use crate::units::ActuatorId;

/// Why a record is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum TableError {
    /// A record of this kind may not be in this place.
    Order,
    /// The bytes are no record.
    Malformed,
    /// The wiring cannot be run safely.
    Wiring(WiringError),
    /// The table was made for another device.
    OtherDevice,
    /// The table asks for more than the board's profile allows.
    Profile(Mismatch),
    /// More rows than [`MAX_ROWS`].
    TooManyRows,
    /// Something is wrong with a row.
    Row {
        /// Index of the row; the number of rows for the end of the program.
        row: u16,
        /// What is wrong.
        error: RowError,
    },
    /// The modules do not have each actuator once, or a frame has digits that its module does not have, is out of
    /// order, or is no pose.
    Modules,
}

/// Why a row is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum RowError {
    /// It is not later than the row before.
    Time,
    /// Its word has not one digit for each actuator, or a digit that the actuator does not have.
    Word,
    /// Not one angle for each servo joint, or an angle out of the joint's range.
    Servo {
        /// Index of the servo.
        servo: u8,
    },
    /// The servo would have to turn faster than it may.
    ServoSpeed {
        /// Index of the servo.
        servo: u8,
    },
    /// The output would be on for longer than it may.
    OnTooLong {
        /// Its number.
        output: u8,
    },
    /// The output would be on for more than its share of the window, or have a peak before its pause is over.
    Duty {
        /// Its number.
        output: u8,
    },
    /// The actuator would switch again before it can have reached its stop, or before the meters of all outputs have had their turn.
    Travel {
        /// Which actuator.
        actuator: ActuatorId,
    },
    /// More coils would be switched on at once than the supply can feed.
    TooManyCoils,
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Order => f.write_str("the records of the table are in the wrong order"),
            Self::Malformed => f.write_str("the bytes of the table are not a record"),
            Self::Wiring(error) => error.fmt(f),
            Self::OtherDevice => f.write_str("the table was made for another device"),
            Self::Profile(mismatch) => mismatch.fmt(f),
            Self::TooManyRows => write!(f, "a table has at most {MAX_ROWS} rows"),
            Self::Row { row, error } => write!(f, "row {row}: {error}"),
            Self::Modules => f.write_str("the frames of the modules do not fit the actuators"),
        }
    }
}

impl fmt::Display for RowError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Time => f.write_str("it is not later than the row before"),
            Self::Word => f.write_str("the word does not fit the actuators"),
            Self::Servo { servo } => write!(f, "the angle of servo {servo} is missing or out of its range"),
            Self::ServoSpeed { servo } => {
                write!(f, "servo {servo} would have to turn faster than it may")
            }
            Self::OnTooLong { output } => {
                write!(f, "output {output} would be on for longer than it may")
            }
            Self::Duty { output } => {
                write!(f, "output {output} would be on, or have full current, for more than its share of the time")
            }
            Self::Travel { actuator } => {
                let ActuatorId(actuator) = actuator;
                write!(
                    f,
                    "actuator {actuator} would switch again before it can have reached its stop, or within some 10 ms"
                )
            }
            Self::TooManyCoils => f.write_str("more coils would switch on at once than the supply can feed"),
        }
    }
}

impl core::error::Error for TableError {}
impl core::error::Error for RowError {}
