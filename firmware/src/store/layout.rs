//! Where images and records lie in bank 2, and the keys of the records.

use core::ops::Range;

use darm_core::wire::message::ImageKind;
use serde::{Deserialize, Serialize};

/// Bytes of one slot: the longest image.
pub const SLOT_BYTES: usize = 64 * 1024;

pub(super) const RECORDS_BYTES: usize = 16 * 1024;

pub(super) const RECORDS: Range<u32> = 2 * SLOT_BYTES as u32..(2 * SLOT_BYTES + RECORDS_BYTES) as u32;

/// Bytes of one slot of a profile.
pub const PROFILE_BYTES: usize = 2 * 1024;

/// Bytes of flash in use.
pub const FLASH_BYTES: usize = RECORDS.end as usize + 2 * PROFILE_BYTES;

pub(super) const KEY_CALIBRATION: u8 = 6;

pub(super) const KEY_BOOTS: u8 = 3;

/// This bit marks the key of a second copy.
pub(super) const SECOND: u8 = 0x10;

/// The record that names the valid slot. Keys 1 and 2 held records of protocol 1.
pub(super) const fn valid_key(kind: ImageKind) -> u8 {
    match kind {
        ImageKind::Table => 4,
        ImageKind::Profile => 5,
    }
}

/// Longest image of a kind.
pub const fn slot_bytes(kind: ImageKind) -> usize {
    match kind {
        ImageKind::Table => SLOT_BYTES,
        ImageKind::Profile => PROFILE_BYTES,
    }
}

/// One of the two places for an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Slot {
    A,
    B,
}

impl Slot {
    pub(super) fn start(self, kind: ImageKind) -> u32 {
        let first = match kind {
            ImageKind::Table => 0,
            ImageKind::Profile => RECORDS.end,
        };
        match self {
            Self::A => first,
            Self::B => first.saturating_add(slot_bytes(kind) as u32),
        }
    }

    pub(super) fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }
}
