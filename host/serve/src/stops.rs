//! Stops: sent past everything else, counted, and confirmed.
//!
//! ```text
//!  POST /api/stop, a typed stop ──► request() ──► a thread of stops alone ──┐
//!  GET /stop-line ──► the thread of that connection ────────────────────────┼──► send() ──► the open port, else another way to it
//!  the watcher, where a page has gone with its control ─────────────────────┘                    ▲
//!  other programs, through the open port ───────────────────────────────────────────────────────┘
//! ```
//!
//! The count is one for all of them. It grows before the first byte of a stop is sent, and nothing ever makes it smaller: whoever has
//! ordered something keeps the count of then, and where it differs when the order is due, a stop came meanwhile. A port that is
//! opened counts too: a stop that another program sent just before the former one was lost may not have been counted.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use darm_device::client::stop::{Confirmation, STOP_BOUND, StopHandle};
use tokio::sync::oneshot;

use crate::board_port::Stopper;

/// The thread of stops looks this often whether the server ends.
const END_CHECK: Duration = Duration::from_millis(100);

/// A request that waits for a stop.
type StopRequest = oneshot::Sender<Result<Confirmation, String>>;

/// What sends stops and counts them.
pub(crate) struct Stops {
    /// Stops the board while its port is not open here.
    elsewhere: Stopper,
    port: Mutex<Port>,
    requests: Sender<StopRequest>,
    requested: Mutex<Receiver<StopRequest>>,
}

/// The port, as far as stops are concerned.
#[derive(Default)]
struct Port {
    /// Stops the board past the watcher, while the port is open.
    handle: Option<StopHandle>,
    /// Stops through the open port that are in the count already.
    counted: u64,
    count: u64,
}

impl Port {
    /// The count, with the stops that others have sent through the open port.
    fn count(&mut self) -> u64 {
        // That of a port which has just been closed is 0.
        let through_port = self.handle.as_ref().map_or(0, StopHandle::stops).max(self.counted);
        self.count += through_port - self.counted;
        self.counted = through_port;
        self.count
    }
}

impl Stops {
    pub(crate) fn new(elsewhere: Stopper) -> Self {
        let (requests, requested) = channel();
        Self { elsewhere, port: Mutex::default(), requests, requested: Mutex::new(requested) }
    }

    /// A port is open: stops go through it.
    pub(crate) fn open(&self, handle: StopHandle) {
        let mut port = self.port();
        let count = port.count() + 1;
        *port = Port { handle: Some(handle), counted: 0, count };
    }

    /// The port is used no longer.
    pub(crate) fn close(&self) {
        let mut port = self.port();
        let count = port.count();
        *port = Port { handle: None, counted: 0, count };
    }

    /// A number that grows with every stop, of anybody.
    pub(crate) fn count(&self) -> u64 {
        self.port().count()
    }

    /// Stops the board, within [`STOP_BOUND`]: through the port where it is open, else past this server. It waits for nothing else.
    ///
    /// # Errors
    ///
    /// Why the stop could not be sent, in a sentence.
    pub(crate) fn send(&self) -> Result<Confirmation, String> {
        let handle = self.port().handle.clone();
        // The port counts it.
        if let Some(Ok(confirmation)) = handle.map(|handle| handle.stop(STOP_BOUND)) {
            return Ok(confirmation);
        }
        self.port().count += 1;
        (self.elsewhere)().map_err(|error| error.to_string())
    }

    /// Stops the board; false where that is not confirmed: the link is lost and pages say so, and the limits of the board hold.
    pub(crate) fn send_confirmed(&self) -> bool {
        self.send().is_ok_and(|confirmation| confirmation != Confirmation::Missing)
    }

    /// Stops the board by the thread of stops, for who must not wait in the thread that all requests share.
    ///
    /// # Errors
    ///
    /// Why the stop could not be sent, in a sentence.
    pub(crate) async fn request(&self) -> Result<Confirmation, String> {
        let (answer, answered) = oneshot::channel();
        let ending = |_| "the server is ending".to_owned();
        self.requests.send(answer).map_err(|_| ending(()))?;
        answered.await.map_err(|_| ending(()))?
    }

    /// Answers requests until the server has ended. Those that arrive while a stop is sent share the next.
    pub(crate) fn answer_requests(&self, has_ended: impl Fn() -> bool) {
        let requested = self.requested.lock().unwrap_or_else(PoisonError::into_inner);
        while !has_ended() {
            let Ok(first) = requested.recv_timeout(END_CHECK) else { continue };
            let others: Vec<StopRequest> = requested.try_iter().collect();
            // Each counts: a page that expects its own stop and no other notices the ones that shared it.
            self.port().count += others.len() as u64;
            let all = std::iter::once(first).chain(others);
            let outcome = self.send();
            // A page that has left waits no longer.
            all.for_each(|page| drop(page.send(outcome.clone())));
        }
    }

    fn port(&self) -> MutexGuard<'_, Port> {
        self.port.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::time::Duration;

    use darm_device::client::stop::{Confirmation, StopHandle, hold};
    use darm_device::link::{Link, LinkError};

    use super::Stops;

    /// A port that takes every byte and answers nothing.
    struct Silent;

    impl Link for Silent {
        fn send(&mut self, _: &[u8]) -> Result<(), LinkError> {
            Ok(())
        }

        fn receive(&mut self, _: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
            std::thread::sleep(timeout);
            Ok(0)
        }

        fn now_s(&self) -> f64 {
            0.0
        }

        fn name(&self) -> &str {
            "silent"
        }
    }

    fn of_another_program(handle: &StopHandle) {
        handle.stop(Duration::ZERO).unwrap();
    }

    #[test]
    fn the_count_grows_with_every_stop_and_no_port_that_is_lost_or_opened_makes_it_smaller() {
        let stops = Stops::new(Box::new(|| Ok(Confirmation::Confirmed)));
        let mut earlier = vec![stops.count()];
        let mut is_new = |what: &str| {
            let count = stops.count();
            assert!(earlier.iter().all(|before| *before < count), "{what}: {count} after {earlier:?}");
            earlier.push(count);
        };
        for _ in 0..2 {
            let (port, handle) = hold(Box::new(Silent), None);
            stops.open(handle.clone());
            is_new("opened");
            for _ in 0..3 {
                of_another_program(&handle);
                is_new("a stop of another program");
            }
            assert_eq!(stops.send(), Ok(Confirmation::Missing));
            is_new("a stop of a page");
            // Nobody reads the count between this stop and the loss of the port.
            of_another_program(&handle);
            drop(port);
            assert_eq!(stops.send(), Ok(Confirmation::Confirmed));
            is_new("a stop past the port that is lost");
            stops.close();
            assert_eq!(stops.send(), Ok(Confirmation::Confirmed));
            is_new("a stop without a port");
        }
    }

    #[test]
    fn a_stop_counts_before_it_is_sent() {
        let seen = Arc::new(AtomicU64::new(0));
        let stops = Arc::new_cyclic(|stops: &std::sync::Weak<Stops>| {
            let (stops, seen) = (stops.clone(), Arc::clone(&seen));
            Stops::new(Box::new(move || {
                seen.store(stops.upgrade().map_or(0, |stops| stops.count()), Ordering::SeqCst);
                Ok(Confirmation::Confirmed)
            }))
        });
        let before = stops.count();
        stops.send().unwrap();
        assert_eq!((seen.load(Ordering::SeqCst), stops.count()), (before + 1, before + 1));
    }
}
