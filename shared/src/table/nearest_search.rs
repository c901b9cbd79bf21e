//! Which word is nearest to a pose, answered by the board: a search that is fed with the records of the stored table.
//!
//! The frames of the modules are read from flash once, a few at a time, and kept small; then the search continues in
//! pieces. Between them the console is heard and the other tasks of its priority run, and the control tick comes before
//! all of them. The host runs the same search to say what the board will answer.

use super::Record;
use crate::nearest::{Frame, Search};

/// Choices that the beam keeps: each is tried with each frame of the next module.
const BEAM: usize = 24;
/// Beginnings that the wider search keeps: the RAM has room for a few more.
const WIDTH: usize = 256;
/// Frames of all modules, 64 for each of six.
const FRAMES: usize = 384;

/// A search with the memory that a board has for it.
pub type NearestSearch = Search<BEAM, WIDTH, FRAMES>;

/// Feeds a search that has begun with the next record of the table; whether those after it matter.
pub fn feed(search: &mut NearestSearch, record: &Record) -> bool {
    match record {
        Record::Module { actuators, length_scale_m, behind } => {
            search.module(*actuators, &behind.pose(), *length_scale_m);
        }
        Record::Frame { digits, pose } => search.offer(&Frame { digits: *digits, pose: pose.pose() }),
        _ => {}
    }
    !matches!(record, Record::Row(_) | Record::End { .. })
}
