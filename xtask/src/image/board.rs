//! The boards that there are images for: packages, targets, emulators.

use clap::ValueEnum;

use super::lists::{self, Lists, pico};
use crate::setup::{self, Emulator};

/// A board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Board {
    /// B-L475E-IOT01A (STM32L475); runs in QEMU
    #[value(name = "b-l475e-iot01a")]
    BL475eIot01a,
    /// Raspberry Pi Pico (RP2040); runs in rp2040js
    Pico,
    /// Olimex STM32-H405 (STM32F405); runs in QEMU, without pins
    #[value(name = "olimex-stm32-h405")]
    OlimexStm32H405,
}

impl Board {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::BL475eIot01a, Self::Pico, Self::OlimexStm32H405];

    /// Name of its folder and of its image.
    pub fn name(self) -> &'static str {
        match self {
            Self::BL475eIot01a => "b-l475e-iot01a",
            Self::Pico => "pico",
            Self::OlimexStm32H405 => "olimex-stm32-h405",
        }
    }

    /// Name of its package.
    pub fn package(self) -> &'static str {
        match self {
            Self::BL475eIot01a => "darm-b-l475e-iot01a",
            Self::Pico => "darm-pico",
            Self::OlimexStm32H405 => "darm-olimex-stm32-h405",
        }
    }

    /// Target of its chip.
    pub fn target(self) -> &'static str {
        match self {
            Self::BL475eIot01a | Self::OlimexStm32H405 => setup::TARGET,
            Self::Pico => setup::SMALL_TARGET,
        }
    }

    /// What its code does not say of itself; `None` where the image is not analysed.
    pub(crate) fn lists(self) -> Option<&'static Lists> {
        match self {
            Self::BL475eIot01a => Some(&lists::B_L475E_IOT01A),
            Self::Pico => Some(&pico::PICO),
            Self::OlimexStm32H405 => None,
        }
    }

    /// Finds or installs what its image runs in.
    pub fn emulator(self) -> Emulator {
        match self {
            Self::BL475eIot01a | Self::OlimexStm32H405 => setup::emulator(),
            Self::Pico => setup::pico_emulator(),
        }
    }
}
