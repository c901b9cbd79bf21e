//! What chips differ in, as far as the firmware in a process has to do with it: the layout and the times of their flash, and
//! who may enter their loader. Times are typical values of the data sheets.

use std::fmt;
use std::str::FromStr;

use darm_core::profile::{B_L475E_IOT01A, PICO, PinTable};
use darm_core::units::Micros;
use serde::{Deserialize, Serialize};

/// The chip whose constants a board in this process has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Chip {
    /// STM32L475 (RM0351, 3.3): pages of 2 KiB, double words of 8 bytes; tables are in the bank that no code runs from, so
    /// that the control tick continues meanwhile.
    #[default]
    Stm32l475,
    /// RP2040 with a W25Q16JV (its AC characteristics): sectors of 4 KiB, single bytes, pages of 256 bytes; the code runs from
    /// the same flash, so that no control tick runs meanwhile.
    Rp2040,
}

/// A name that no chip has.
#[derive(Debug, thiserror::Error)]
#[error("{0:?} is no chip: give stm32l475 or rp2040")]
pub struct UnknownChip(String);

impl fmt::Display for Chip {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stm32l475 => "stm32l475",
            Self::Rp2040 => "rp2040",
        })
    }
}

impl FromStr for Chip {
    type Err = UnknownChip;

    fn from_str(name: &str) -> Result<Self, UnknownChip> {
        let chips = [Self::Stm32l475, Self::Rp2040];
        chips.into_iter().find(|chip| chip.to_string() == name).ok_or_else(|| UnknownChip(name.into()))
    }
}

impl Chip {
    /// The chip of a board.
    pub fn of_board(pins: &PinTable) -> Self {
        if *pins == PICO { Self::Rp2040 } else { Self::Stm32l475 }
    }

    /// The board that has this chip and measures its supply.
    pub(super) const fn pins(self) -> &'static PinTable {
        match self {
            Self::Stm32l475 => &B_L475E_IOT01A,
            Self::Rp2040 => &PICO,
        }
    }

    /// Bytes that are erased at once.
    pub const fn erase_bytes(self) -> usize {
        match self {
            Self::Stm32l475 => 2048,
            Self::Rp2040 => 4096,
        }
    }

    /// Bytes that are written at once at least.
    pub(super) const fn word_bytes(self) -> usize {
        match self {
            Self::Stm32l475 => 8,
            Self::Rp2040 => 1,
        }
    }

    /// For this time no control tick runs when that many bytes are erased.
    pub const fn erase_pause(self) -> Micros {
        match self {
            Self::Stm32l475 => Micros(0),
            Self::Rp2040 => Micros::from_millis(45),
        }
    }

    /// Time of an erase of that many bytes meanwhile the control tick runs: DS10969, table of the flash's characteristics,
    /// t_ERASE.
    pub(super) const fn erase_time(self) -> Micros {
        match self {
            Self::Stm32l475 => Micros(22_020),
            Self::Rp2040 => Micros(0),
        }
    }

    /// Time of the write of one piece meanwhile the control tick runs: the same table, t_prog of 64 bits.
    pub(super) const fn write_time(self) -> Micros {
        match self {
            Self::Stm32l475 => Micros(82),
            Self::Rp2040 => Micros(0),
        }
    }

    /// How often an erase gives way to other tasks: 22 ms of an STM32L475, where they run meanwhile; on the RP2040 once, after
    /// it.
    pub(super) const fn erase_yields(self) -> usize {
        match self {
            Self::Stm32l475 => 20,
            Self::Rp2040 => 1,
        }
    }

    /// Bytes that are written in one piece.
    pub(super) const fn page_bytes(self) -> usize {
        match self {
            Self::Stm32l475 => 8,
            Self::Rp2040 => 256,
        }
    }

    /// For this time no control tick runs when that many bytes are written.
    pub(super) const fn write_pause(self) -> Micros {
        match self {
            Self::Stm32l475 => Micros(0),
            Self::Rp2040 => Micros(400),
        }
    }

    /// The chip's loader is on the cable of the console, and entered only while a person holds the button.
    pub(super) const fn guards_loader(self) -> bool {
        matches!(self, Self::Rp2040)
    }
}
