//! How busy the core is: the share of time in which it does not sleep.
//!
//! # Model
//!
//! load = 1 − s/T, with s the time spent in sleep during T, the second or more that has ended last. All work is done in
//! interrupts; the loop behind them sleeps with interrupts masked, so that it wakes before the interrupt that woke it
//! runs, and what interrupts take never counts as sleep.

use core::sync::atomic::{AtomicU32, Ordering};

use crate::clock::Clock;

/// Length of T at least, µs. Where the core is busy all that time T ends with the next sleep.
const WINDOW_US: u32 = 1_000_000;
/// No second has ended yet.
const UNKNOWN: u32 = u32::MAX;

/// Time spent in sleep, of one core.
pub struct Load {
    since_us: AtomicU32,
    slept_us: AtomicU32,
    permille: AtomicU32,
}

impl Load {
    /// Nothing is known yet.
    pub const fn new() -> Self {
        Self { since_us: AtomicU32::new(0), slept_us: AtomicU32::new(0), permille: AtomicU32::new(UNKNOWN) }
    }

    /// Sleeps and counts the time. One loop calls this, with interrupts masked, and lets them run after it.
    pub fn sleep(&self, clock: &impl Clock, sleep: impl FnOnce()) {
        // Modulo 2³² µs: nobody sleeps for an hour.
        let began_us = clock.now().0 as u32;
        sleep();
        let ended_us = clock.now().0 as u32;
        let slept_us = self.slept_us.load(Ordering::Relaxed).saturating_add(ended_us.wrapping_sub(began_us));
        let window_us = ended_us.wrapping_sub(self.since_us.load(Ordering::Relaxed));
        if window_us < WINDOW_US {
            self.slept_us.store(slept_us, Ordering::Relaxed);
            return;
        }
        let asleep = u64::from(slept_us).saturating_mul(1000).checked_div(window_us.into()).unwrap_or(0);
        self.permille.store(1000u32.saturating_sub(asleep as u32), Ordering::Relaxed);
        self.since_us.store(ended_us, Ordering::Relaxed);
        self.slept_us.store(0, Ordering::Relaxed);
    }

    /// Load in thousandths; `None` in the first second.
    pub fn permille(&self) -> Option<u16> {
        u16::try_from(self.permille.load(Ordering::Relaxed)).ok()
    }
}

impl Default for Load {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use super::Load;
    use crate::tests::fakes::HandClock;

    /// The load after rounds of work and sleep from a time on, µs.
    fn load(start_us: u64, work_us: u64, sleep_us: u64, rounds: u32) -> Option<u16> {
        let (load, clock) = (Load::new(), HandClock(Cell::new(start_us)));
        let pass = |us: u64| clock.0.set(clock.0.get() + us);
        for _ in 0..rounds {
            pass(work_us);
            load.sleep(&clock, || pass(sleep_us));
        }
        load.permille()
    }

    #[test]
    fn the_share_of_time_without_sleep_is_the_load() {
        assert_eq!(load(0, 250, 750, 999), None);
        assert_eq!(load(0, 250, 750, 1000), Some(250));
        assert_eq!(load(0, 0, 1000, 5000), Some(0));
        assert_eq!(load(0, 3_000_000, 0, 1), Some(1000));
        assert_eq!(load(0, 2_970_000, 30_000, 3), Some(990));
    }

    /// Time is kept modulo 2³² µs.
    #[test]
    fn an_hour_later_the_load_is_the_same() {
        assert_eq!(load((1 << 32) - 500_000, 250, 750, 3000), Some(250));
    }
}
