//! Instructions of one call, by SysTick in the emulator with 64 ns of virtual time an instruction.

use core::hint::black_box;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;

const RUNS: u32 = 200;

/// Lets the counter run freely.
pub(crate) fn start(timer: &mut SYST) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(0xff_ffff);
    timer.clear_current();
    timer.enable_counter();
}

/// Instructions of one call: an instruction lasts 5.12 cycles, and so does one of the empty loop.
#[inline(always)]
pub(crate) fn instructions<R>(mut work: impl FnMut() -> R) -> u32 {
    let start = SYST::get_current();
    (0..RUNS).for_each(|_| black_box(()));
    let middle = SYST::get_current();
    (0..RUNS).for_each(|_| {
        black_box(&work());
    });
    let end = SYST::get_current();
    let cycles = |from: u32, to: u32| from.wrapping_sub(to) & 0xff_ffff;
    (cycles(middle, end) - cycles(start, middle)) * 25 / 128 / RUNS
}
