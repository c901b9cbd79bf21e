//! The version of the newest record of each kind, kept apart from the records.
//!
//! A record that was replaced stays in the flash until its page is erased. Where both copies of the new one are damaged, the
//! flash alone would give the replaced one again: limits or zero offsets that a person has changed since.

use serde::{Deserialize, Serialize};

use super::layout::{KEY_CALIBRATION, KEY_PROFILE, KEY_TABLE};

/// Number of starts, and the version of the newest record of each kind; 0: none was ever written. Written after each of these
/// records and at each start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Newest {
    pub(super) starts: u32,
    pub(super) table: u32,
    pub(super) profile: u32,
    pub(super) calibration: u32,
}

impl Newest {
    /// The version of the newest record under a key. This record itself was written at least as often as the board started.
    pub(super) fn version(&mut self, key: u8) -> &mut u32 {
        match key {
            KEY_TABLE => &mut self.table,
            KEY_PROFILE => &mut self.profile,
            KEY_CALIBRATION => &mut self.calibration,
            _ => &mut self.starts,
        }
    }
}
