//! Whether the slower tasks still run, and how a board starts that crashes again and again.
//!
//! The control tick feeds the watchdog only while the console and the servo bus report: each has a [`Pulse`], and
//! [`Watch`] finds the one that was silent for longer than [`SILENCE_LIMIT`]. Plain values, tested on the PC.
use core::future::{Future, poll_fn};
use core::pin::Pin;
use core::sync::atomic::{AtomicU32, Ordering};

use darm_core::units::Micros;
use embassy_futures::select::{Either, select};

use crate::clock::Clock;

/// Longest time without a report before the board resets.
///
/// The longest work between two reports is the check of a full table of 64 KiB before it is committed, a few hundred
/// milliseconds. A page erase (25 ms) and each piece of a nearest-word search (below 10 ms) return to the executor.
pub const SILENCE_LIMIT: Micros = Micros::from_millis(2_000);
/// Time between two reports of a task that waits.
pub const REPORT_PERIOD: Micros = Micros::from_millis(250);
/// Crashes in a row after which the board starts with its outputs disabled.
pub const MAX_CRASHES: u32 = 3;
/// A start that runs for this time ends the row of crashes.
pub const STEADY: Micros = Micros::from_millis(60_000);

/// A task that has to report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Frames and text on the console.
    Console,
    /// The servo bus.
    ServoBus,
}

impl Task {
    /// All of them, in the order of the counts of [`Watch::silent`].
    pub const ALL: [Self; 2] = [Self::Console, Self::ServoBus];

    /// Name in a crash record.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Console => "console",
            Self::ServoBus => "servo bus",
        }
    }
}

/// Counts the reports of a task; wraps.
pub struct Pulse(AtomicU32);

impl Pulse {
    /// No report yet.
    pub const fn new() -> Self {
        Self(AtomicU32::new(0))
    }

    /// Reports. From one task only: two stores of which one is lost would still be a report.
    pub fn beat(&self) {
        self.0.store(self.count().wrapping_add(1), Ordering::Relaxed);
    }

    /// Reports so far, modulo 2³².
    pub fn count(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }

    /// Does `work` and reports each [`REPORT_PERIOD`] that it leaves the processor to others: also while it waits.
    ///
    /// Takes pinned work, so that a task holds it once and not twice.
    pub async fn during<T>(&self, clock: &impl Clock, work: impl Future<Output = T> + Unpin) -> T {
        let report = async {
            loop {
                self.beat();
                clock.wait_until(clock.now() + REPORT_PERIOD).await;
            }
        };
        match select(work, report).await {
            Either::First(value) => value,
            Either::Second(never) => never,
        }
    }

    /// Does `work` and reports whenever it is polled: for work that wakes by itself more often than [`SILENCE_LIMIT`].
    pub async fn at_each_poll<T>(&self, mut work: impl Future<Output = T> + Unpin) -> T {
        poll_fn(|context| {
            self.beat();
            Pin::new(&mut work).poll(context)
        })
        .await
    }
}

impl Default for Pulse {
    fn default() -> Self {
        Self::new()
    }
}

/// When each task was last seen to report.
#[derive(Clone, Copy, Debug)]
pub struct Watch([(u32, Micros); Task::ALL.len()]);

impl Watch {
    /// Every task has [`SILENCE_LIMIT`] from now for its first report.
    pub const fn new(now: Micros) -> Self {
        Self([(0, now); Task::ALL.len()])
    }

    /// The first task whose count has not moved for longer than [`SILENCE_LIMIT`].
    pub fn silent(&mut self, now: Micros, counts: [u32; Task::ALL.len()]) -> Option<Task> {
        let mut silent = None;
        for ((last, count), task) in self.0.iter_mut().zip(counts).zip(Task::ALL) {
            if last.0 != count {
                *last = (count, now);
            } else if now - last.1 > SILENCE_LIMIT && silent.is_none() {
                silent = Some(task);
            }
        }
        silent
    }
}

/// What a board starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Everything.
    Normal,
    /// The console with the bootstrap set; outputs stay disabled until a person or a host reboots the board.
    Recovery,
}

/// Crashes in a row at a start, from those before and from whether the last start crashed.
pub const fn crashes_in_a_row(before: u32, crashed: bool) -> u32 {
    if crashed { before.saturating_add(1) } else { 0 }
}

/// What to start after this many crashes in a row.
pub const fn start_after(crashes: u32) -> Start {
    if crashes >= MAX_CRASHES { Start::Recovery } else { Start::Normal }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::fakes::{HandClock, run};
    use core::future::pending;
    use core::pin::pin;

    const LIMIT: u64 = SILENCE_LIMIT.0;

    #[test]
    fn a_silent_task_is_named_after_the_limit_and_not_before() {
        let mut watch = Watch::new(Micros(0));
        assert_eq!(watch.silent(Micros(LIMIT), [0, 0]), None);
        assert_eq!(watch.silent(Micros(LIMIT), [1, 0]), None);
        assert_eq!(watch.silent(Micros(LIMIT + 1), [1, 0]), Some(Task::ServoBus));
        assert_eq!(watch.silent(Micros(2 * LIMIT), [1, 1]), None);
        assert_eq!(watch.silent(Micros(2 * LIMIT + 1), [1, 1]), Some(Task::Console));
    }

    #[test]
    fn a_count_that_wraps_is_a_report() {
        let mut watch = Watch::new(Micros(0));
        assert_eq!(watch.silent(Micros(1), [u32::MAX, u32::MAX]), None);
        assert_eq!(watch.silent(Micros(LIMIT + 2), [0, 0]), None);
    }

    #[test]
    fn a_task_that_waits_for_ever_reports() {
        let (clock, pulse) = (HandClock::default(), Pulse::new());
        let work = pin!(clock.wait_until(SILENCE_LIMIT));
        run(pulse.during(&clock, work), || clock.0.set(clock.0.get() + 1_000));
        let expected = (SILENCE_LIMIT.0 / REPORT_PERIOD.0) as u32;
        assert!((expected - 1..=expected + 1).contains(&pulse.count()), "{} reports", pulse.count());
    }

    #[test]
    fn each_poll_of_the_servo_bus_is_a_report() {
        let pulse = Pulse::new();
        let work = pin!(pending::<()>());
        let mut future = pin!(pulse.at_each_poll(work));
        for _ in 0..3 {
            let waker = core::task::Waker::noop();
            assert!(future.as_mut().poll(&mut core::task::Context::from_waker(waker)).is_pending());
        }
        assert_eq!(pulse.count(), 3);
    }

    #[test]
    fn three_crashes_in_a_row_hold_the_board_and_one_good_start_ends_the_row() {
        let after = |crashed: &[bool]| crashed.iter().fold(0, |count, crashed| crashes_in_a_row(count, *crashed));
        assert_eq!(start_after(after(&[true, true])), Start::Normal);
        assert_eq!(start_after(after(&[true, true, true])), Start::Recovery);
        assert_eq!(start_after(after(&[true, true, false, true])), Start::Normal);
        assert_eq!(crashes_in_a_row(u32::MAX, true), u32::MAX);
    }
}
