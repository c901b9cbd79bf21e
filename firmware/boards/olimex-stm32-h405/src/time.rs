//! Time since the start from SysTick: once a millisecond it counts, runs the control tick and wakes who waits.
use core::cell::Cell;

use cortex_m::peripheral::{SCB, SYST, syst::SystClkSource};
use cortex_m_rt::exception;
use critical_section::Mutex;
use darm_core::units::Micros;
use darm_firmware::clock::{Clock, Sleepers};
use darm_firmware::control::TICK;

use crate::control_tick;

/// Clock of the core; USART1 has half of it, USART2 a quarter.
pub(crate) const HCLK_HZ: u32 = 168_000_000;
const CYCLES_PER_US: u32 = HCLK_HZ / 1_000_000;
const RELOAD: u32 = CYCLES_PER_US * TICK.0 as u32;
/// SysTick interrupt pending, in the interrupt control and state register.
const PENDSTSET: u32 = 1 << 26;

static TICKS: Mutex<Cell<u64>> = Mutex::new(Cell::new(0));
static SLEEPERS: Sleepers = Sleepers::new();

/// Starts the clock at 0.
pub(crate) fn start() {
    // SAFETY: called once at start; nothing else owns the SysTick.
    let mut timer = unsafe { cortex_m::Peripherals::steal() }.SYST;
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(RELOAD - 1);
    timer.clear_current();
    timer.enable_interrupt();
    timer.enable_counter();
    // Started from 0 the counter reads 0 until its first reload; a time taken before would jump back.
    while SYST::get_current() == 0 {}
}

#[exception]
fn SysTick() {
    let before = critical_section::with(|cs| TICKS.borrow(cs).replace(TICKS.borrow(cs).get().wrapping_add(1)));
    control_tick(Micros(before.wrapping_add(1).wrapping_mul(TICK.0)));
    SLEEPERS.wake();
}

/// The clock of the tasks.
#[derive(Clone, Copy)]
pub(crate) struct BoardClock;

impl Clock for BoardClock {
    fn now(&self) -> Micros {
        critical_section::with(|cs| {
            let mut left = SYST::get_current();
            // SAFETY: a read of ICSR has no side effect.
            let wrapped = unsafe { (*SCB::PTR).icsr.read() & PENDSTSET != 0 };
            if wrapped {
                // The counter has begun again, but its interrupt waits: that tick is not counted yet.
                left = SYST::get_current();
            }
            let ticks = TICKS.borrow(cs).get().wrapping_add(wrapped.into());
            Micros(ticks.wrapping_mul(TICK.0).wrapping_add(((RELOAD - 1).saturating_sub(left) / CYCLES_PER_US).into()))
        })
    }

    async fn wait_until(&self, at: Micros) {
        SLEEPERS.wait_until(self, at).await;
    }
}
