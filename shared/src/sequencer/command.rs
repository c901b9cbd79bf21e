//! What a person or a host asks of the sequencer, and why it refuses.

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::units::Word;

/// What a person or a host asks for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Command {
    /// Run the table from its first row.
    Play,
    /// All coils off, at once.
    Stop,
    /// Leave the safe state.
    Clear,
    /// The coil of one output on for this time; 0 ms switches it off.
    Coil {
        /// Number of the output.
        coil: u8,
        /// How long.
        on_ms: u32,
    },
    /// All actuators to these digits, as fast as the supply can feed them.
    Word(Word),
    /// One servo to this angle.
    Servo {
        /// Index of the servo joint.
        servo: u8,
        /// Joint angle.
        angle_rad: f32,
    },
}

/// Why a command is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum CommandError {
    /// No table is loaded.
    NoTable,
    /// The safe state is latched; clear it first.
    Safe,
    /// A program runs; stop it first.
    Playing,
    /// A stop came after it was requested, or after its connection was opened: say `Hello` on a new one.
    Stopped,
    /// There is no such coil, servo or word.
    NotWired,
    /// The actuator has no state with both of its coils on.
    NoSuchState,
    /// The coil may not be on for this time.
    OnTooLong {
        /// How long it may be on.
        max_ms: u32,
    },
    /// The output has been on for such a time, or has had a peak so lately, that its limit does not allow this now.
    Recovering {
        /// Its number.
        output: u8,
        /// How long it may still be on in its window; 0 before it may have another peak.
        left_ms: u32,
        /// After this time without current all of its window is free, or it may have another peak.
        wait_ms: u32,
    },
    /// The emergency stop is pressed.
    EmergencyStop,
    /// The servo has not answered, or not for longer than it may.
    ServoSilent {
        /// Index of the servo joint.
        servo: u8,
    },
    /// The angle is out of the joint's range.
    ServoRange {
        /// Smallest angle.
        min_rad: f32,
        /// Largest angle.
        max_rad: f32,
    },
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoTable => f.write_str("no table is loaded; upload one first"),
            Self::Safe => f.write_str("a fault is latched; look at it, then clear it"),
            Self::Playing => f.write_str("a program runs; stop it first"),
            Self::Stopped => f.write_str("a stop came meanwhile; nothing was started"),
            Self::NotWired => f.write_str("no such coil, servo or word in the loaded wiring"),
            Self::NoSuchState => f.write_str("the other coil of this actuator is on; switch it off first"),
            Self::OnTooLong { max_ms } => write!(f, "this coil may be on for at most {max_ms} ms"),
            Self::Recovering { output, left_ms, wait_ms } => write!(
                f,
                "output {output} may be on for {left_ms} ms more in its window; after {wait_ms} ms off all of it is free"
            ),
            Self::EmergencyStop => f.write_str("the emergency stop is pressed; release it first"),
            Self::ServoSilent { servo } => write!(f, "servo {servo} does not answer; check its power and its cable"),
            Self::ServoRange { min_rad, max_rad } => {
                write!(f, "this joint goes from {:.1} to {:.1} deg", min_rad.to_degrees(), max_rad.to_degrees())
            }
        }
    }
}

impl core::error::Error for CommandError {}
