//! Time since the start from SysTick: once a millisecond it counts, runs the control tick and wakes who waits.
use cortex_m_rt::exception;
use darm_firmware::systick;

use crate::control_tick;

/// Clock of the core; USART1 has half of it, USART2 a quarter.
pub(crate) const HCLK_HZ: u32 = 168_000_000;

/// The clock of the tasks.
pub(crate) type BoardClock = systick::SysTick<HCLK_HZ>;
pub(crate) const CLOCK: BoardClock = systick::SysTick;

#[exception]
fn SysTick() {
    CLOCK.on_interrupt(control_tick);
}
