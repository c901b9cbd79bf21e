//! Where a table asks for more than the board's profile allows.

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::output::{CoilLimit, Drive, SwitchLimit};
use crate::units::ShortDigest;

/// Where a table asks for more than the board's profile allows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Mismatch {
    /// The profile has no such output.
    NoOutput {
        /// Its number.
        output: u8,
    },
    /// The output has other lines, or the table wants a longer pulse or peak.
    Drive {
        /// Its number.
        output: u8,
        /// What the profile says.
        profile: Drive,
        /// What the table says.
        table: Drive,
    },
    /// The table wants the output on for longer, or counts over another window.
    Limit {
        /// Its number.
        output: u8,
        /// What the profile allows.
        profile: CoilLimit,
        /// What the table says.
        table: CoilLimit,
    },
    /// The limit switch of the output's actuator is at another input.
    Input {
        /// Number of the output.
        output: u8,
        /// Its input by the profile.
        profile: Option<u8>,
        /// Its input by the table.
        table: u8,
    },
    /// The table wants to switch more outputs at once.
    Supply {
        /// What the profile allows.
        profile: SwitchLimit,
        /// What the table says.
        table: SwitchLimit,
    },
    /// The servo is missing, has another address or narrower limits.
    Servo {
        /// Its index along the arm.
        servo: u8,
    },
    /// Everything that the table needs is allowed, but it was made for another profile.
    Digest {
        /// The profile that the table was made for.
        table: ShortDigest,
        /// The profile that the board has.
        profile: ShortDigest,
    },
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoOutput { output } => write!(f, "output {output}: the board's profile does not have it"),
            Self::Drive { output, profile, table } => {
                write!(f, "output {output}: the table drives it by {table}, the board's profile by {profile}")
            }
            Self::Limit { output, profile, table } => {
                write!(f, "output {output}: the table allows {table}, the board's profile {profile}")
            }
            Self::Input { output, profile: Some(profile), table } => {
                write!(
                    f,
                    "output {output}: the table has its switch at input {table}, the board's profile at {profile}"
                )
            }
            Self::Input { output, profile: None, table } => {
                write!(f, "output {output}: the table has its switch at input {table}, the board's profile has none")
            }
            Self::Supply { profile, table } => {
                write!(f, "the table switches {table}, the board's profile allows {profile}")
            }
            Self::Servo { servo } => {
                write!(f, "servo {servo}: the board's profile does not have it, or has narrower limits")
            }
            Self::Digest { table, profile } => {
                write!(f, "the table was made for profile {table}, the board has {profile}")
            }
        }
    }
}
