//! Clock of a board with a Cortex-M core from SysTick, for boards without a timer of their own: each millisecond an interrupt that
//! counts.

use core::cell::Cell;

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};
use critical_section::Mutex;
use darm_core::units::Micros;

use crate::clock::{Clock, Sleepers};
use crate::control::TICK;

/// SysTick interrupt pending, in the interrupt control and state register.
const PENDSTSET: u32 = 1 << 26;

/// Interrupts since the start.
static TICKS: Mutex<Cell<u64>> = Mutex::new(Cell::new(0));
static SLEEPERS: Sleepers = Sleepers::new();

/// The clock of a core that runs at `HCLK_HZ`, a multiple of 1 MHz. There is one.
#[derive(Clone, Copy)]
pub struct SysTick<const HCLK_HZ: u32>;

impl<const HCLK_HZ: u32> SysTick<HCLK_HZ> {
    const CYCLES_PER_US: u32 = HCLK_HZ / 1_000_000;
    /// What the counter begins with: one cycle less than from one interrupt to the next.
    const RELOAD: u32 = Self::CYCLES_PER_US * TICK.0 as u32 - 1;

    /// Starts the clock at 0, once.
    pub fn start(self, timer: &mut SYST) {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(Self::RELOAD);
        timer.clear_current();
        timer.enable_interrupt();
        timer.enable_counter();
        // Started from 0 the counter reads 0 until its first reload; a time taken before would jump back.
        while SYST::get_current() == 0 {}
    }

    /// From the handler of SysTick: runs the control tick that is due at the time that it gets, then wakes the tasks that wait.
    pub fn on_interrupt(self, control_tick: impl FnOnce(Micros)) {
        let ticks = critical_section::with(|section| {
            let ticks = TICKS.borrow(section);
            ticks.set(ticks.get().wrapping_add(1));
            ticks.get()
        });
        control_tick(Micros(ticks.wrapping_mul(TICK.0)));
        SLEEPERS.wake();
    }
}

impl<const HCLK_HZ: u32> Clock for SysTick<HCLK_HZ> {
    fn now(&self) -> Micros {
        critical_section::with(|section| {
            let mut left = SYST::get_current();
            // SAFETY: a read of ICSR has no side effect.
            let has_wrapped = unsafe { (*SCB::PTR).icsr.read() & PENDSTSET != 0 };
            if has_wrapped {
                // The counter has begun again, but its interrupt waits: that tick is not counted yet.
                left = SYST::get_current();
            }
            let ticks = TICKS.borrow(section).get().wrapping_add(has_wrapped.into());
            let us = Self::RELOAD.saturating_sub(left).checked_div(Self::CYCLES_PER_US).unwrap_or(0);
            Micros(ticks.wrapping_mul(TICK.0).wrapping_add(us.into()))
        })
    }

    async fn wait_until(&self, at: Micros) {
        SLEEPERS.wait_until(self, at).await;
    }
}
