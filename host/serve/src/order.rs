//! What pages order: it waits for the watcher, and is not sent if a stop comes first or the board does not answer.

use std::sync::Arc;
use std::time::{Duration, Instant};

use darm_core::sequencer::Command;
use darm_core::units::Digest;
use tokio::sync::oneshot;

use crate::program::Program;
use crate::refusal::Refused;

/// An order that could not be sent within this time is not sent: the arm would move unexpectedly.
pub(crate) const MAX_ORDER_AGE: Duration = Duration::from_secs(2);

/// What is to be done.
#[derive(Clone)]
pub(crate) enum Task {
    /// A command of the sequencer.
    Command(Command),
    /// Run the board's table, if it is this one.
    Play {
        /// Digest of the table that the page shows.
        table: Digest,
    },
    /// Bring a table to the board.
    Upload(Arc<Program>),
    /// Send a line as a person types it; the answer comes as text.
    Type(String),
}

/// One order of a page.
pub(crate) struct Order {
    /// What is to be done.
    pub task: Task,
    /// The key of the page; `None` for what needs no control.
    pub key: Option<u64>,
    /// Number of stops when the page ordered it.
    pub stops: u64,
    /// When the page ordered it.
    pub made: Instant,
    /// Where the result goes.
    pub answer: oneshot::Sender<Result<(), Refused>>,
}
