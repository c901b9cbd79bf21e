//! Where images and records lie in the flash, and the keys of the records.

use core::ops::Range;

use darm_core::wire::message::ImageKind;
use serde::{Deserialize, Serialize};

/// Bytes of one slot: the longest image.
pub const SLOT_BYTES: usize = 64 * 1024;

pub(super) const RECORDS_BYTES: usize = 16 * 1024;

pub(super) const RECORDS: Range<u32> = 2 * SLOT_BYTES as u32..(2 * SLOT_BYTES + RECORDS_BYTES) as u32;

/// Bytes of one slot of a profile.
pub const PROFILE_BYTES: usize = 2 * 1024;

/// Bytes in use of a flash that erases this number of bytes at once, at most [`SLOT_BYTES`]: a slot begins with a page.
pub const fn flash_bytes(erase_bytes: usize) -> usize {
    (RECORDS.end as usize).saturating_add(slot_pitch(ImageKind::Profile, erase_bytes).saturating_mul(2))
}

/// Bytes in use of a flash whose pages are no longer than a profile.
pub const FLASH_BYTES: usize = flash_bytes(PROFILE_BYTES);

pub(super) const KEY_TABLE: u8 = 4;
pub(super) const KEY_PROFILE: u8 = 5;
pub(super) const KEY_CALIBRATION: u8 = 6;

pub(super) const KEY_NEWEST: u8 = 3;

/// This bit marks the key of a second copy.
pub(super) const SECOND: u8 = 0x10;

/// The record that names the valid slot.
pub(super) const fn valid_key(kind: ImageKind) -> u8 {
    match kind {
        ImageKind::Table => KEY_TABLE,
        ImageKind::Profile => KEY_PROFILE,
    }
}

/// Longest image of a kind.
pub const fn slot_bytes(kind: ImageKind) -> usize {
    match kind {
        ImageKind::Table => SLOT_BYTES,
        ImageKind::Profile => PROFILE_BYTES,
    }
}

/// From the start of slot A to that of slot B.
pub(super) const fn slot_pitch(kind: ImageKind, erase_bytes: usize) -> usize {
    let bytes = slot_bytes(kind);
    if bytes < erase_bytes { erase_bytes } else { bytes }
}

/// One of the two places for an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Slot {
    A,
    B,
}

impl Slot {
    pub(super) fn start(self, kind: ImageKind, erase_bytes: usize) -> u32 {
        let first = match kind {
            ImageKind::Table => 0,
            ImageKind::Profile => RECORDS.end,
        };
        match self {
            Self::A => first,
            Self::B => first.saturating_add(slot_pitch(kind, erase_bytes) as u32),
        }
    }

    pub(super) fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }
}
