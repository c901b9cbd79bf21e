//! Exact instruction counts in QEMU of kinematics and dynamics: the core's for any arm, what `darm generate` wrote for one,
//! and a corrected model with the laws of its effects.
//!
//! Started with `-icount shift=6,sleep=off` the counts are the same in every run. Prints `name value unit`, one a line,
//! through semihosting.
#![no_std]
#![no_main]

mod corrected;
mod count;
mod general;
#[rustfmt::skip]
mod generated_puma560;
mod laws;
mod of_one;
mod puma560;

use cortex_m_semihosting::debug;
use darm_b_l475e_iot01a::measure::check;
use darm_b_l475e_iot01a::{clocks, time};
use darm_firmware::cortex;
use defmt_rtt as _;

#[cortex_m_rt::entry]
fn main() -> ! {
    let stack = cortex::paint_stack();
    check("the clock starts", clocks::start().is_ok());
    // SAFETY: nothing else uses the counter before the time starts.
    let mut timer = unsafe { cortex_m::Peripherals::steal() }.SYST;
    count::start(&mut timer);
    general::measure(&stack);
    of_one::measure();
    timer.disable_counter();
    // One call of a complete model with its laws is longer than the counter: it needs the time.
    time::start();
    laws::measure(&stack);
    debug::exit(debug::EXIT_SUCCESS);
    loop {
        cortex_m::asm::wfi();
    }
}
