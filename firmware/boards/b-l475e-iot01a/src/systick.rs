//! The SysTick handler: counts time, requests the control tick, wakes the tasks whose time has come.
use cortex_m_rt::exception;
use darm_core::units::Micros;

use crate::{tasks, time};
use darm_firmware::control::TICK;

#[exception]
fn SysTick() {
    time::count_tick();
    #[cfg(feature = "bench")]
    let began = time::cycles();
    let now_us = time::last_tick_us();
    if now_us.is_multiple_of(TICK.0) {
        tasks::request_tick(Micros(now_us));
    }
    time::wake_sleeping(now_us);
    #[cfg(feature = "bench")]
    crate::measure::end_handler(began);
}
