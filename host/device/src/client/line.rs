//! The line to the board as the threads of a process share it: one exchange at a time, in the order in which they come.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::exchange::Exchange;

/// The line.
pub(super) struct Line {
    /// Who waits for the line has this: a mutex alone is taken again by the thread that has just let go of it, and a console that listens
    /// all the time would keep everybody else out.
    turn: Mutex<()>,
    exchange: Mutex<Exchange>,
}

impl Line {
    pub(super) fn new(exchange: Exchange) -> Self {
        Self { turn: Mutex::new(()), exchange: Mutex::new(exchange) }
    }

    /// Waits for the line.
    pub(super) fn take(&self) -> MutexGuard<'_, Exchange> {
        let _turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        self.exchange.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
