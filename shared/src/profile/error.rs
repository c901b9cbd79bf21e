//! Why a profile is refused.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::{LINES_PER_CHIP, MAX_CHIPS, MIN_SUPPLY_MV};
use crate::output::WiringError;

/// Why a profile is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum ProfileError {
    /// A record is out of order, or the last one is missing.
    Order,
    /// The bytes are not a record.
    Malformed,
    /// The board cannot run it safely.
    Wiring(WiringError),
    /// It wires what the board does not have.
    Board(Shortage),
    /// No chain has this length.
    ChainLength {
        /// Chips that it says.
        chips: u8,
    },
    /// A line is beyond the end of the chain that it describes.
    ChainLine {
        /// Number of the line.
        line: u8,
        /// Chips of the chain.
        chips: u8,
    },
    /// No board measures a supply like this threshold.
    MinSupply {
        /// The threshold, mV.
        mv: u16,
    },
}

/// What a profile wires and the board does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Shortage {
    /// An output line.
    Line {
        /// Its number.
        line: u8,
        /// Lines of the board, numbered from 0.
        lines: u8,
    },
    /// An input.
    Input {
        /// Its number.
        input: u8,
        /// Inputs of the board, numbered from 0.
        inputs: u8,
    },
    /// More servos than the bus carries.
    Servos {
        /// Servos that it carries.
        servos: u8,
    },
    /// The chain has another length.
    Chips {
        /// Chips of the profile.
        chips: u8,
        /// Lines of the board.
        lines: u8,
    },
    /// The pins: it is made for another board, or for one with other pins.
    Pins,
    /// A pin for the pulse to a camera.
    Sync,
    /// A measurement of its supply that reaches the threshold.
    Supply {
        /// The threshold, mV.
        mv: u16,
        /// Lowest and highest supply that it measures, mV; `None` where it measures none.
        measured_mv: Option<[u16; 2]>,
    },
}

impl fmt::Display for Shortage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line { line, lines } => write!(f, "line {line} is wired, and the board has {lines} lines"),
            Self::Input { input, inputs } => write!(f, "input {input} is wired, and the board has {inputs} inputs"),
            Self::Servos { servos } => write!(f, "the bus of the board carries {servos} servos"),
            Self::Chips { chips, lines } => {
                let found = lines / LINES_PER_CHIP;
                write!(
                    f,
                    "the profile has a chain of {chips} chips, and the board one of {found}; count them, look for a broken wire, or correct `chips`"
                )
            }
            Self::Sync => f.write_str(
                "the profile has a pulse to a camera, and the board no pin for it; take `sync` out of [pins]",
            ),
            Self::Supply { measured_mv: None, .. } => f.write_str(
                "the profile has a threshold of the supply, and the board measures none; take `min_board_supply_mv` out",
            ),
            Self::Supply { mv, measured_mv: Some([lowest, highest]) } => write!(
                f,
                "the threshold of the supply is {mv} mV, and the board measures {lowest} to {highest} mV; correct `min_board_supply_mv`"
            ),
            Self::Pins => f.write_str("the profile is made for a board with other pins; correct `board`"),
        }
    }
}

impl fmt::Display for ProfileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Order => f.write_str("a record of the profile is out of order or missing"),
            Self::Malformed => f.write_str("the bytes are not a profile"),
            Self::Wiring(error) => error.fmt(f),
            Self::Board(shortage) => shortage.fmt(f),
            Self::ChainLength { chips } => write!(f, "a chain of {chips} chips is not possible; give 1 to {MAX_CHIPS}"),
            Self::MinSupply { mv } => {
                let [lowest, highest] = MIN_SUPPLY_MV;
                write!(
                    f,
                    "min_board_supply_mv is {mv}; give {lowest} to {highest}, below what `darm status` prints as supply"
                )
            }
            Self::ChainLine { line, chips } => {
                let last = chips.saturating_mul(LINES_PER_CHIP).saturating_sub(1);
                write!(
                    f,
                    "line {line} is wired, and a chain of {chips} chips has lines 0 to {last}; correct the line or `chips`"
                )
            }
        }
    }
}

impl core::error::Error for ProfileError {}
