//! What pages order: it waits for the watcher, and is not sent if a stop comes first or the board does not answer.

use std::sync::Arc;
use std::time::{Duration, Instant};

use darm_core::sequencer::Command;
use darm_core::units::Digest;
use tokio::sync::oneshot;

use crate::program::Program;
use crate::refusal::{Kind, Refused};

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

/// When a page ordered something, and how many stops there had been then.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ordered {
    /// Number of stops when the page ordered it.
    pub stops: u64,
    /// When the page ordered it.
    pub made: Instant,
}

impl Ordered {
    /// Ordered now, by a page that knows of this number of stops.
    pub(crate) fn now(stops: u64) -> Self {
        Self { stops, made: Instant::now() }
    }

    /// Refuses what was ordered before the last of this number of stops.
    ///
    /// # Errors
    ///
    /// A stop came meanwhile.
    pub(crate) fn check_stops(self, count: u64) -> Result<(), Refused> {
        let late = || Refused::new(Kind::Stopped, "a stop came meanwhile; nothing was sent");
        (self.stops == count).then_some(()).ok_or_else(late)
    }

    /// Refuses what has waited for too long.
    ///
    /// # Errors
    ///
    /// It is older than [`MAX_ORDER_AGE`].
    pub(crate) fn check_age(self) -> Result<(), Refused> {
        let late = || {
            let text = format!("the order waited for more than {} s; nothing was sent", MAX_ORDER_AGE.as_secs());
            Refused::new(Kind::Link, text)
        };
        (self.made.elapsed() <= MAX_ORDER_AGE).then_some(()).ok_or_else(late)
    }
}

/// One order of a page.
pub(crate) struct Order {
    /// What is to be done.
    pub task: Task,
    /// The key of the page; `None` for what needs no control.
    pub key: Option<u64>,
    /// When it was ordered, and after how many stops.
    pub ordered: Ordered,
    /// Where the result goes.
    pub answer: oneshot::Sender<Result<(), Refused>>,
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::{MAX_ORDER_AGE, Ordered};
    use crate::refusal::Kind;

    #[test]
    fn what_a_stop_has_overtaken_or_has_waited_too_long_is_refused() {
        let ordered = Ordered::now(3);
        assert!(ordered.check_stops(3).is_ok() && ordered.check_age().is_ok());
        assert_eq!(ordered.check_stops(4).unwrap_err().kind, Kind::Stopped);
        let made = Instant::now().checked_sub(MAX_ORDER_AGE + Duration::from_millis(1)).unwrap();
        assert_eq!(Ordered { made, ..ordered }.check_age().unwrap_err().kind, Kind::Link);
    }
}
