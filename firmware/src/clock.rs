//! The clock of all tasks: SysTick on the chip, a number that moves by hand on the PC.
use core::future::Future;

use darm_core::units::Micros;

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
