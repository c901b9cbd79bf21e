//! Time since start from SysTick, as the embassy-time driver: microseconds, alarms every [`TICK_US`].
//!
//! SysTick is the only timer that QEMU's machine has; its handler is in `systick`. All state is atomic or behind the critical
//! section, which is entered only to walk the short list of sleeping tasks.
use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Waker;

use cortex_m::peripheral::{SCB, SYST};
use critical_section::Mutex;
use darm_core::units::Micros;
use embassy_time::{Instant, Timer};
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;

use crate::clocks::HCLK_HZ;
use darm_firmware::clock::Clock;

/// Grain of alarms; a divisor of the control tick.
pub const TICK_US: u32 = 500;
const CYCLES_PER_US: u32 = HCLK_HZ / 1_000_000;
const RELOAD: u32 = CYCLES_PER_US * TICK_US;
/// SysTick interrupt pending, in the interrupt control and state register.
const PENDSTSET: u32 = 1 << 26;

struct SysTickTime {
    /// Ticks since start: the low half, and how often it wrapped.
    ticks: AtomicU32,
    wraps: AtomicU32,
    sleeping: Mutex<RefCell<Sleeping>>,
}

struct Sleeping {
    queue: Queue,
    next_us: u64,
}

embassy_time_driver::time_driver_impl!(static TIME: SysTickTime = SysTickTime {
    ticks: AtomicU32::new(0),
    wraps: AtomicU32::new(0),
    sleeping: Mutex::new(RefCell::new(Sleeping { queue: Queue::new(), next_us: u64::MAX })),
});

impl SysTickTime {
    /// Ticks since start. Reads without masking: a wrap in between shows as a changed `wraps`.
    fn ticks(&self) -> u64 {
        loop {
            let wraps = self.wraps.load(Ordering::Acquire);
            let ticks = self.ticks.load(Ordering::Acquire);
            if wraps == self.wraps.load(Ordering::Acquire) {
                return u64::from(wraps) << 32 | u64::from(ticks);
            }
        }
    }

    fn now_us(&self) -> u64 {
        loop {
            let before = self.ticks();
            let mut left = SYST::get_current();
            // The counter has wrapped but its interrupt waits: count that tick here.
            let waiting = pending();
            if waiting {
                left = SYST::get_current();
            }
            if before == self.ticks() && waiting == pending() {
                let ticks = before + u64::from(waiting);
                return ticks * u64::from(TICK_US) + u64::from((RELOAD - 1).saturating_sub(left) / CYCLES_PER_US);
            }
        }
    }
}

fn pending() -> bool {
    // SAFETY: a read of ICSR has no side effect.
    unsafe { (*SCB::PTR).icsr.read() & PENDSTSET != 0 }
}

impl Driver for SysTickTime {
    fn now(&self) -> u64 {
        self.now_us()
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        critical_section::with(|cs| {
            // Nothing else has it while interrupts are masked.
            let Ok(mut sleeping) = self.sleeping.borrow(cs).try_borrow_mut() else { return };
            if sleeping.queue.schedule_wake(at, waker) {
                sleeping.next_us = sleeping.next_us.min(at);
            }
        });
    }
}

/// Starts the clock at 0.
pub fn start() {
    // SAFETY: called once at start, before interrupts use the SysTick; nothing else owns it.
    let mut timer = unsafe { cortex_m::Peripherals::steal() }.SYST;
    timer.set_clock_source(cortex_m::peripheral::syst::SystClkSource::Core);
    timer.set_reload(RELOAD - 1);
    timer.clear_current();
    timer.enable_interrupt();
    timer.enable_counter();
    // Started from 0 the counter reads 0 until its first reload; a time taken before would jump back.
    while SYST::get_current() == 0 {}
}

/// Microseconds since [`start`].
pub fn now_us() -> u64 {
    TIME.now_us()
}

/// The clock of the tasks.
#[derive(Clone, Copy)]
pub struct BoardClock;

impl Clock for BoardClock {
    fn now(&self) -> Micros {
        Micros(now_us())
    }

    async fn wait_until(&self, at: Micros) {
        Timer::at(Instant::from_micros(at.0)).await;
    }
}

/// Core cycles since [`start`], modulo 2³².
#[cfg(feature = "bench")]
pub(crate) fn cycles() -> u32 {
    let before = TIME.ticks.load(Ordering::Acquire);
    let left = SYST::get_current();
    let (ticks, left) = if pending() { (before + 1, SYST::get_current()) } else { (before, left) };
    if TIME.ticks.load(Ordering::Acquire) != before {
        return cycles();
    }
    ticks.wrapping_mul(RELOAD).wrapping_add(RELOAD - 1 - left)
}

/// Counts a tick of the SysTick. Only its handler calls this.
#[inline(always)]
pub(crate) fn count_tick() {
    if TIME.ticks.fetch_add(1, Ordering::AcqRel) == u32::MAX {
        TIME.wraps.fetch_add(1, Ordering::AcqRel);
    }
}

/// Time at the last counted tick, µs.
#[inline(always)]
pub(crate) fn last_tick_us() -> u64 {
    TIME.ticks() * u64::from(TICK_US)
}

/// Wakes the tasks that wait until then or earlier.
#[inline(always)]
pub(crate) fn wake_sleeping(now_us: u64) {
    critical_section::with(|cs| {
        let Ok(mut sleeping) = TIME.sleeping.borrow(cs).try_borrow_mut() else { return };
        if now_us >= sleeping.next_us {
            sleeping.next_us = sleeping.queue.next_expiration(now_us);
        }
    });
}

defmt::timestamp!("{=u64:us}", now_us());
