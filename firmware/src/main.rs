//! The image that is flashed: starts the board and its tasks, then sleeps.
//!
//! Everything runs in interrupts, so that one order of priorities rules all; see [`board`].
#![no_std]
#![no_main]

use darm_firmware::board::{self, clocks, death, restart, tasks, time};
use defmt_rtt as _;

#[cortex_m_rt::entry]
fn main() -> ! {
    restart::enter_loader_if_asked();
    let death = death::take();
    if let Err(error) = clocks::start() {
        death::give_up(format_args!("the clock does not start: {error:?}"));
    }
    time::start();
    board::prioritise();
    defmt::info!("start of {=str}, emulated {=bool}", board::NAME, board::emulated());
    if let Some(death) = &death {
        defmt::error!("the last start died after {=u64} us: {=str}", death.uptime_us, death.text.as_str());
    }
    tasks::start(death);
    loop {
        cortex_m::asm::wfi();
    }
}
