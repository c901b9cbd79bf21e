//! Work that takes a while: in a thread, one piece at a time, given up when its page has left.
//!
//! Whatever a request does in a thread goes through a queue: the threads of the runtime are many, and what waits for one of them
//! is run after its page has left. A piece that nobody waits for keeps the place until it notices, so that it counts like another.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use serde::Serialize;
use tokio::sync::Semaphore;

use crate::refusal::{Kind, Refused};

/// Requests that may wait for their turn: a page has one under way, and a browser six.
const MAX_WAITING: usize = 8;

/// One piece of work at a time.
pub(crate) struct JobQueue {
    place: Arc<Semaphore>,
    waiting: AtomicUsize,
    progress: Arc<Mutex<Option<Running>>>,
}

struct Running {
    stage: &'static str,
    share: f64,
    since: Instant,
}

/// How far the work is.
#[derive(Debug, Serialize)]
pub(crate) struct RunningView {
    stage: &'static str,
    /// 0 to 1; `None` where it is not known.
    share: Option<f64>,
    for_s: f64,
}

/// Nobody waits for the work any more: its page has left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the page has left")]
pub(crate) struct Unwanted;

impl From<Unwanted> for Refused {
    fn from(unwanted: Unwanted) -> Self {
        Self::new(Kind::Refused, unwanted)
    }
}

/// What work says about itself, and whether it is still wanted.
#[derive(Clone)]
pub(crate) struct Work {
    is_unwanted: Arc<AtomicBool>,
    progress: Arc<Mutex<Option<Running>>>,
}

impl JobQueue {
    pub(crate) fn new() -> Self {
        Self { place: Arc::new(Semaphore::new(1)), waiting: AtomicUsize::new(0), progress: Arc::default() }
    }

    /// How far the running piece is.
    pub(crate) fn running(&self) -> Option<RunningView> {
        let view = |running: &Running| RunningView {
            stage: running.stage,
            share: Some(running.share).filter(|share| *share > 0.0),
            for_s: running.since.elapsed().as_secs_f64(),
        };
        lock(&self.progress).as_ref().map(view)
    }

    /// Runs work when its turn comes. Where this future is dropped, the work does not begin, or hears that it is unwanted.
    ///
    /// # Errors
    ///
    /// Too many wait already, the work panicked, or the error of the work.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Work) -> Result<T, Refused> + Send + 'static,
    ) -> Result<T, Refused> {
        let waiting = Waiting::enter(&self.waiting)?;
        let closed = |error: &dyn std::fmt::Display| Refused::new(Kind::Refused, format!("the work failed: {error}"));
        let place = Arc::clone(&self.place).acquire_owned().await.map_err(|error| closed(&error))?;
        drop(waiting);
        let own = Work { is_unwanted: Arc::default(), progress: Arc::clone(&self.progress) };
        let _request = GiveUp(Arc::clone(&own.is_unwanted));
        let run = move || {
            let _place = place;
            let _running = Ended(Arc::clone(&own.progress));
            *lock(&own.progress) = Some(Running { stage: "start", share: 0.0, since: Instant::now() });
            let done = work(&own);
            give_back_memory();
            done
        };
        #[expect(clippy::disallowed_methods, reason = "the one place that begins work, with a place in the queue")]
        let done = tokio::task::spawn_blocking(run);
        done.await.map_err(|error| closed(&error))?
    }
}

/// Gives memory that is free back to the system. A table leaves it in small pieces when it was taken apart, and the allocator of glibc
/// keeps these for the thread that freed them: after some large uploads it had 1.2 GB.
fn give_back_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: it has no preconditions, and any thread may call it (malloc_trim(3)).
    unsafe {
        libc::malloc_trim(0);
    }
}

impl Work {
    /// Work that nobody waits for.
    #[cfg(test)]
    pub(crate) fn unwanted() -> Self {
        Self { is_unwanted: Arc::new(AtomicBool::new(true)), progress: Arc::default() }
    }

    /// Whether the page still waits for it.
    pub(crate) fn is_wanted(&self) -> bool {
        !self.is_unwanted.load(Ordering::Relaxed)
    }

    /// An error once nobody waits for it.
    ///
    /// # Errors
    ///
    /// The page has left.
    pub(crate) fn check(&self) -> Result<(), Unwanted> {
        if self.is_wanted() { Ok(()) } else { Err(Unwanted) }
    }

    /// The work is at this stage, of which this share is done.
    pub(crate) fn is_at(&self, stage: &'static str, share: f64) {
        if let Some(running) = lock(&self.progress).as_mut() {
            (running.stage, running.share) = (stage, share);
        }
    }
}

/// Makes work unwanted when it is dropped; work that has ended does not notice.
struct GiveUp(Arc<AtomicBool>);

impl Drop for GiveUp {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Nothing runs any more when it is dropped.
struct Ended(Arc<Mutex<Option<Running>>>);

impl Drop for Ended {
    fn drop(&mut self) {
        *lock(&self.0) = None;
    }
}

/// A request that waits.
struct Waiting<'a>(&'a AtomicUsize);

impl<'a> Waiting<'a> {
    fn enter(count: &'a AtomicUsize) -> Result<Self, Refused> {
        let waiting = Self(count);
        match count.fetch_add(1, Ordering::Relaxed) < MAX_WAITING {
            true => Ok(waiting),
            false => Err(Refused::new(Kind::Refused, "too many requests wait for the server; close some pages")),
        }
    }
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

fn lock(progress: &Mutex<Option<Running>>) -> MutexGuard<'_, Option<Running>> {
    progress.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    use super::{JobQueue, MAX_WAITING};

    fn runtime() -> tokio::runtime::Runtime {
        tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap()
    }

    #[test]
    fn work_that_nobody_waits_for_ends_and_what_waited_behind_it_does_not_begin() {
        let begun = Arc::new(AtomicUsize::new(0));
        let queue = JobQueue::new();
        let endless = |begun: &Arc<AtomicUsize>| {
            let begun = Arc::clone(begun);
            queue.run(move |work| {
                begun.fetch_add(1, Ordering::Relaxed);
                while work.is_wanted() {
                    std::thread::sleep(Duration::from_millis(1));
                }
                Ok(())
            })
        };
        runtime().block_on(async {
            let patience = Duration::from_millis(30);
            let (first, second) = (endless(&begun), endless(&begun));
            let both = async { tokio::join!(first, second) };
            assert!(tokio::time::timeout(patience, both).await.is_err());
            assert_eq!(queue.run(|_| Ok(7)).await.ok(), Some(7));
        });
        assert_eq!(begun.load(Ordering::Relaxed), 1);
        assert!(queue.running().is_none());
    }

    #[test]
    fn requests_that_wait_are_few() {
        let queue = JobQueue::new();
        runtime().block_on(async {
            let place = Arc::clone(&queue.place).acquire_owned().await.unwrap();
            let mut waiting: Vec<_> = (0..MAX_WAITING).map(|_| Box::pin(queue.run(|_| Ok(())))).collect();
            for request in &mut waiting {
                assert!(tokio::time::timeout(Duration::from_millis(1), request.as_mut()).await.is_err());
            }
            assert!(queue.run(|_| Ok(())).await.is_err());
            drop(place);
            drop(waiting);
            assert!(queue.run(|_| Ok(())).await.is_ok());
        });
    }
}
