//! Which word is nearest to a pose, answered by the board: a search that is fed with the records of the stored table.
//!
//! The frames of the modules stay in flash and are looked at once each, a few at a time; between them the other tasks
//! of the console's priority run, and the control tick comes before all of them.

use darm_core::nearest::{Beam, Frame};
use darm_core::table::Record;

/// Choices that the search keeps: each is tried with each frame of the next module. The RAM has room for a few more.
pub const WIDTH: usize = 24;

/// The room for a search.
pub(crate) type Room = Beam<f32, WIDTH>;

/// Takes the next record of the table, of a search that has begun; whether those after it matter.
pub(crate) fn take(room: &mut Room, record: &Record) -> bool {
    match record {
        Record::Module { actuators, length_scale_m, behind } => {
            room.module(*actuators, &behind.pose(), *length_scale_m);
        }
        Record::Frame { digits, pose } => room.offer(&Frame { digits: *digits, pose: pose.pose() }),
        _ => {}
    }
    !matches!(record, Record::Row(_) | Record::End { .. })
}
