//! What the sequencer does now, and what happened.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::fault::Fault;
use crate::units::{Micros, Word};

/// What the sequencer does now.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Phase {
    /// No coil carries current.
    Idle,
    /// Coils, words or servos are set by hand.
    Manual,
    /// The servos go to the first row, slowly; the latches are set as it says, no more at once than the supply feeds;
    /// every coil with a peak waits until it may have the next one.
    Approaching {
        /// Since when.
        since: Micros,
    },
    /// Rows run.
    Playing {
        /// When the program started.
        started: Micros,
        /// The row that is due next.
        next: u16,
    },
    /// Latched after a fault.
    Safe(Fault),
}

/// What happened.
///
/// A tag of a complete machine word keeps what follows it aligned: the chip copies it several times in a tick.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// The board started.
    Booted,
    /// A program started.
    Started,
    /// A row went out to the coils.
    Row {
        /// Its index.
        row: u16,
        /// Its word.
        word: Word,
    },
    /// The program ran to its end.
    Finished,
    /// Somebody stopped it.
    Stopped,
    /// The safe state was latched.
    Fault(Fault),
    /// The safe state was cleared.
    Cleared,
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Booted => f.write_str("booted"),
            Self::Started => f.write_str("program started"),
            Self::Row { row, word } => write!(f, "row {row}: {word}"),
            Self::Finished => f.write_str("program finished"),
            Self::Stopped => f.write_str("stopped"),
            Self::Fault(fault) => write!(f, "fault: {fault}"),
            Self::Cleared => f.write_str("safe state left"),
        }
    }
}
