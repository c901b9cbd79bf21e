//! The clock of all tasks: SysTick on the chip, a number that moves by hand on the PC.
use core::cell::RefCell;
use core::future::{Future, poll_fn};
use core::task::Poll;

use darm_core::units::Micros;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::waitqueue::MultiWakerRegistration;

/// Time since the start, and a way to wait for it.
pub trait Clock {
    /// Time since the board started.
    fn now(&self) -> Micros;

    /// Waits until `at`; at once when it has passed.
    fn wait_until(&self, at: Micros) -> impl Future<Output = ()>;
}

impl<C: Clock> Clock for &C {
    fn now(&self) -> Micros {
        (**self).now()
    }

    fn wait_until(&self, at: Micros) -> impl Future<Output = ()> {
        (**self).wait_until(at)
    }
}

/// Tasks that wait for a time, on a board whose only timer is that of the control tick: all of them are woken at each tick.
pub struct Sleepers(Mutex<CriticalSectionRawMutex, RefCell<MultiWakerRegistration<8>>>);

impl Sleepers {
    /// Nobody waits.
    pub const fn new() -> Self {
        Self(Mutex::new(RefCell::new(MultiWakerRegistration::new())))
    }

    /// Wakes who waits; from the interrupt of the control tick, after the tick.
    pub fn wake(&self) {
        self.with(MultiWakerRegistration::wake);
    }

    /// Waits until `at`; at once when it has passed.
    pub async fn wait_until(&self, clock: &impl Clock, at: Micros) {
        poll_fn(|context| {
            if clock.now() >= at {
                return Poll::Ready(());
            }
            self.with(|waiting| waiting.register(context.waker()));
            Poll::Pending
        })
        .await;
    }

    fn with(&self, act: impl FnOnce(&mut MultiWakerRegistration<8>)) {
        self.0.lock(|waiting| {
            // Nothing else has it while interrupts are masked.
            if let Ok(mut waiting) = waiting.try_borrow_mut() {
                act(&mut waiting);
            }
        });
    }
}

impl Default for Sleepers {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;
    use core::pin::pin;
    use core::task::{Context, Waker};

    use super::*;

    struct ByHand(Cell<u64>);

    impl Clock for ByHand {
        fn now(&self) -> Micros {
            Micros(self.0.get())
        }

        async fn wait_until(&self, _: Micros) {}
    }

    #[test]
    fn a_sleeper_wakes_at_the_first_tick_after_its_time() {
        let (sleepers, clock) = (Sleepers::new(), ByHand(Cell::new(0)));
        let mut sleep = pin!(sleepers.wait_until(&clock, Micros(1_500)));
        let mut poll = || sleep.as_mut().poll(&mut Context::from_waker(Waker::noop()));
        assert!(poll().is_pending());
        for now in [1_000, 1_499] {
            clock.0.set(now);
            sleepers.wake();
            assert!(poll().is_pending());
        }
        clock.0.set(2_000);
        sleepers.wake();
        assert!(poll().is_ready());
    }
}
