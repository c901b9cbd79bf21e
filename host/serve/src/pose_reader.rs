//! Reads measured poses until the server ends; a source that is lost is opened again.

use std::thread;
use std::time::{Duration, Instant};

use crate::hub::Hub;
use crate::measured::{PoseReader, PoseSource};

/// Interval at which a source is read.
const READ_PERIOD: Duration = Duration::from_millis(100);
/// A source that is lost is opened again after this time.
const REOPEN_SOURCE_AFTER: Duration = Duration::from_secs(1);

/// Reads a source until the server ends.
pub(crate) fn follow(hub: &Hub, mut source: PoseSource) {
    while !hub.has_ended() {
        let lost = match (source.open)() {
            Ok(mut reader) => read(hub, &mut *reader),
            Err(problem) => Some(problem),
        };
        lost.into_iter().for_each(|problem| hub.with_measured(|measured| measured.set_problem(problem)));
        let again = Instant::now() + REOPEN_SOURCE_AFTER;
        while Instant::now() < again && !hub.has_ended() {
            thread::sleep(READ_PERIOD);
        }
    }
}

/// Reads until the source is lost: why, or `None` where the server ends.
fn read(hub: &Hub, reader: &mut dyn PoseReader) -> Option<String> {
    while !hub.has_ended() {
        match reader.read() {
            Ok(poses) => hub.with_measured(|measured| measured.add(&poses)),
            Err(problem) => return Some(problem),
        }
        thread::sleep(READ_PERIOD);
    }
    None
}
