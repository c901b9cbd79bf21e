//! Work that takes a while: in a thread, one piece at a time, given up when its page has left.
//!
//! Whatever a request does in a thread goes through a queue: the threads of the runtime are many, and what waits for one of them
//! is run after its page has left. A piece that nobody waits for keeps the place until it notices, so that it counts like another.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use darm_diagnose::progress::Progress;
use serde::Serialize;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::refusal::{Kind, Refused};

/// Requests that may wait for their turn: a page has one under way, and a browser six.
const MAX_REQUESTS_WAITING: usize = 8;

/// One piece of work at a time.
pub(crate) struct JobQueue {
    place: Arc<Semaphore>,
    waiting: AtomicUsize,
    running: Arc<Mutex<Option<Running>>>,
}

/// The piece of work that has the place.
pub(crate) struct Running {
    /// What it works on, as far as it has said so.
    pub(crate) name: Option<String>,
    stage: &'static str,
    share: f64,
    since: Instant,
    /// That of a diagnosis has its stages; of other work it only says whether it was given up.
    pub(crate) progress: Progress,
}

impl Running {
    pub(crate) fn for_s(&self) -> f64 {
        self.since.elapsed().as_secs_f64()
    }
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
    progress: Progress,
    running: Arc<Mutex<Option<Running>>>,
}

impl JobQueue {
    pub(crate) fn new() -> Self {
        Self { place: Arc::new(Semaphore::new(1)), waiting: AtomicUsize::new(0), running: Arc::default() }
    }

    /// How far the running piece is.
    pub(crate) fn running(&self) -> Option<RunningView> {
        self.look(|running| RunningView {
            stage: running.stage,
            share: Some(running.share).filter(|share| *share > 0.0),
            for_s: running.for_s(),
        })
    }

    /// Looks at the running piece, if there is one.
    pub(crate) fn look<T>(&self, look: impl FnOnce(&Running) -> T) -> Option<T> {
        lock(&self.running).as_ref().map(look)
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
        let place = Arc::clone(&self.place).acquire_owned().await.map_err(failed)?;
        drop(waiting);
        self.run_in(place, work).await
    }

    /// Runs work at once or not at all, for work that is too long to wait for. As [`run`](Self::run) otherwise.
    ///
    /// # Errors
    ///
    /// `refusal` where another piece runs, which may end meanwhile; else as [`run`](Self::run).
    pub(crate) async fn run_at_once<T: Send + 'static>(
        &self,
        refusal: impl FnOnce(Option<&Running>) -> Refused,
        work: impl FnOnce(&Work) -> Result<T, Refused> + Send + 'static,
    ) -> Result<T, Refused> {
        match Arc::clone(&self.place).try_acquire_owned() {
            Ok(place) => self.run_in(place, work).await,
            Err(_) => Err(refusal(lock(&self.running).as_ref())),
        }
    }

    async fn run_in<T: Send + 'static>(
        &self,
        place: OwnedSemaphorePermit,
        work: impl FnOnce(&Work) -> Result<T, Refused> + Send + 'static,
    ) -> Result<T, Refused> {
        let own = Work { progress: Progress::default(), running: Arc::clone(&self.running) };
        let _request = GiveUp(own.progress.clone());
        let (stage, share, since) = ("start", 0.0, Instant::now());
        *lock(&self.running) = Some(Running { name: None, stage, share, since, progress: own.progress.clone() });
        let running = Ended(Arc::clone(&self.running));
        let run = move || {
            // The place is free after nothing is said to run.
            let (_place, _running) = (place, running);
            let done = work(&own);
            give_back_memory();
            done
        };
        #[expect(clippy::disallowed_methods, reason = "the one place that begins work, with a place in the queue")]
        let done = tokio::task::spawn_blocking(run);
        done.await.map_err(failed)?
    }
}

fn failed(error: impl std::fmt::Display) -> Refused {
    Refused::new(Kind::Refused, format!("the work failed: {error}"))
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
        let own = Self { progress: Progress::default(), running: Arc::default() };
        own.progress.cancel();
        own
    }

    /// Whether the page still waits for it.
    pub(crate) fn is_wanted(&self) -> bool {
        !self.progress.is_cancelled()
    }

    /// The progress for a diagnosis, which is given up with the work.
    pub(crate) fn progress(&self) -> &Progress {
        &self.progress
    }

    /// Says what it works on.
    pub(crate) fn is_called(&self, name: String) {
        if let Some(running) = lock(&self.running).as_mut() {
            running.name = Some(name);
        }
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
        if let Some(running) = lock(&self.running).as_mut() {
            (running.stage, running.share) = (stage, share);
        }
    }
}

/// Makes work unwanted when it is dropped; work that has ended does not notice.
struct GiveUp(Progress);

impl Drop for GiveUp {
    fn drop(&mut self) {
        self.0.cancel();
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
        match count.fetch_add(1, Ordering::Relaxed) < MAX_REQUESTS_WAITING {
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

fn lock(running: &Mutex<Option<Running>>) -> MutexGuard<'_, Option<Running>> {
    running.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    use super::{JobQueue, MAX_REQUESTS_WAITING};
    use crate::refusal::{Kind, Refused};

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
    fn work_that_runs_at_once_or_not_at_all_is_refused_by_the_name_of_what_runs() {
        let queue = JobQueue::new();
        let endless = queue.run(|work| {
            work.is_called("long".to_owned());
            while work.is_wanted() {
                std::thread::sleep(Duration::from_millis(1));
            }
            Ok(())
        });
        let name = |running: Option<&super::Running>| running.and_then(|running| running.name.clone());
        let refusal = |running: Option<&_>| Refused::new(Kind::Refused, name(running).unwrap_or_default());
        runtime().block_on(async {
            let patience = Duration::from_millis(30);
            assert!(tokio::time::timeout(patience, endless).await.is_err());
            // It notices a moment later that its page has left.
            let next = queue.run_at_once(refusal, |_| Ok(7)).await;
            assert!(next.as_ref().is_ok_and(|done| *done == 7) || next.is_err_and(|refused| refused.text == "long"));
            assert_eq!(queue.run(|_| Ok(8)).await.ok(), Some(8));
            let busy = queue.run(|work| {
                work.is_called("short".to_owned());
                std::thread::sleep(Duration::from_millis(100));
                Ok(())
            });
            let other = async {
                tokio::time::sleep(patience).await;
                queue.run_at_once(refusal, |_| Ok(())).await
            };
            let (busy, other) = tokio::join!(busy, other);
            assert!(busy.is_ok() && other.is_err_and(|refused| refused.text == "short"));
            assert_eq!(queue.run_at_once(refusal, |_| Ok(9)).await.ok(), Some(9));
        });
    }

    #[test]
    fn requests_that_wait_are_few() {
        let queue = JobQueue::new();
        runtime().block_on(async {
            let place = Arc::clone(&queue.place).acquire_owned().await.unwrap();
            let mut waiting: Vec<_> = (0..MAX_REQUESTS_WAITING).map(|_| Box::pin(queue.run(|_| Ok(())))).collect();
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
