//! The image that is flashed: starts the board and its tasks, then sleeps.
//!
//! Everything runs in interrupts, so that one order of priorities rules all; see [`board`].
#![no_std]
#![no_main]

use darm_b_l475e_iot01a::board::{self, Board};
use darm_b_l475e_iot01a::emulated::emulated;
use darm_b_l475e_iot01a::{adc, clocks, gpio, restart, tasks, time, watchdog};
use darm_firmware::hardware::Hardware as _;
use darm_firmware::life::{self, Start};
use darm_firmware::{cortex, crash};
use defmt_rtt as _;

#[cortex_m_rt::entry]
fn main() -> ! {
    cortex::paint_stack();
    restart::enter_loader_if_asked();
    let cause = watchdog::take_cause();
    board::note_cause(cause);
    let crash = crash::take(Board::kept(), cause.watchdog);
    let crashes = crash::count_crash(Board::kept(), crash.is_some());
    if let Err(error) = clocks::start() {
        crash::give_up::<Board>(format_args!("the clock does not start: {error:?}"));
    }
    if !emulated() && !adc::start() {
        defmt::error!("the converter does not start: supply and temperature are not measured");
    }
    gpio::start_user_button();
    time::start();
    board::prioritise();
    defmt::info!("start of {=str}, emulated {=bool}", Board::NAME, emulated());
    if let Some(crash) = &crash {
        defmt::error!("the last start died after {=u64} us: {=str}", crash.uptime_us, crash.text.as_str());
    }
    let start = life::start_after(crashes);
    if start == Start::Recovery {
        defmt::error!("{=u32} crashes in a row: outputs disabled, bootstrap set only", crashes);
    }
    tasks::start(crash, start, tasks::room());
    loop {
        cortex::sleep::<Board>();
    }
}
