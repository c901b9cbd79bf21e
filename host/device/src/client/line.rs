//! The line to the board as the threads of a process share it: one exchange at a time, in the order in which they come.

use std::sync::{Mutex, MutexGuard, TryLockError};
use std::time::{Duration, Instant};

use super::exchange::Exchange;
use super::stop::{StopHandle, lock};

/// Interval of the looks whether the line is free.
const LOOK: Duration = Duration::from_millis(5);

/// The line.
pub(super) struct Line {
    /// Who waits for the line has this: a mutex alone is taken again by the thread that has just let go of it, and a console that listens
    /// all the time would keep everybody else out.
    turn: Mutex<()>,
    exchange: Mutex<Exchange>,
    /// Stops the board past the line, at the port that is open now.
    handle: Mutex<Option<StopHandle>>,
}

impl Line {
    pub(super) fn new(exchange: Exchange) -> Self {
        Self { turn: Mutex::new(()), exchange: Mutex::new(exchange), handle: Mutex::new(None) }
    }

    /// What stops the board past the line, where the port is shared.
    pub(super) fn handle(&self) -> Option<StopHandle> {
        lock(&self.handle).clone()
    }

    pub(super) fn set_handle(&self, handle: StopHandle) {
        *lock(&self.handle) = Some(handle);
    }

    /// The line, if it is free before `until`; the next that wait for it are behind this one.
    pub(super) fn take_before(&self, until: Instant) -> Option<MutexGuard<'_, Exchange>> {
        let _turn = lock_before(&self.turn, until)?;
        lock_before(&self.exchange, until)
    }

    /// Waits for the line.
    pub(super) fn take(&self) -> MutexGuard<'_, Exchange> {
        let _turn = lock(&self.turn);
        lock(&self.exchange)
    }
}

fn lock_before<T>(mutex: &Mutex<T>, until: Instant) -> Option<MutexGuard<'_, T>> {
    loop {
        match mutex.try_lock() {
            Ok(guard) => return Some(guard),
            Err(TryLockError::Poisoned(guard)) => return Some(guard.into_inner()),
            Err(TryLockError::WouldBlock) if Instant::now() < until => std::thread::sleep(LOOK),
            Err(TryLockError::WouldBlock) => return None,
        }
    }
}
