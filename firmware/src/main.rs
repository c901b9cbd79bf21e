//! The image that is flashed: starts the board and the tasks.
#![no_std]
#![no_main]
use darm_firmware::board::{
    self, clocks, death,
    flash::Flash,
    gpio::{Output, Switches},
    pins, time, uart, watchdog,
};
use darm_firmware::solenoid::{Pins, Solenoids};
use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, Spawner};
use embassy_time::{Duration, Ticker};
use embedded_io_async::{Read, Write};
use stm32_metapac::interrupt;

static CONTROL: InterruptExecutor = InterruptExecutor::new();
static COMMON: InterruptExecutor = InterruptExecutor::new();

#[interrupt]
unsafe fn TSC() {
    unsafe { CONTROL.on_interrupt() }
}

#[interrupt]
unsafe fn SWPMI1() {
    unsafe { COMMON.on_interrupt() }
}

#[embassy_executor::task]
async fn control() {
    let mut solenoids = Solenoids::new(Pins {
        data: Output::new(pins::CHAIN_DATA, false),
        clock: Output::new(pins::CHAIN_CLOCK, false),
        latch: Output::new(pins::CHAIN_LATCH, false),
        enable: Output::new(pins::CHAIN_ENABLE, true),
    })
    .unwrap();
    let _ = Switches::new().read();
    let mut tick = Ticker::every(Duration::from_millis(1));
    let mut n = 0u64;
    loop {
        tick.next().await;
        watchdog::feed();
        n += 1;
        let _ = solenoids.apply(n / 500, true);
    }
}

#[embassy_executor::task]
async fn start() {
    let _spawner = unsafe { Spawner::for_current_executor().await };
    let (mut rx, mut tx) = uart::start_console();
    let died = death::take();
    let mut s = heapless::String::<200>::new();
    use core::fmt::Write as _;
    let _ = write!(s, "died {:?} flash {:?}\r\n", died, Flash::open().is_ok());
    let _ = tx.write_all(s.as_bytes()).await;
    let mut b = [0; 64];
    loop {
        if let Ok(n) = rx.read(&mut b).await {
            let _ = tx.write_all(&b[..n]).await;
        }
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Err(error) = clocks::start() {
        panic!("clock does not start: {error:?}");
    }
    time::start();
    board::prioritise();
    defmt::info!("emulated {}", board::emulated());
    if let Ok(task) = control() {
        CONTROL.start(board::CONTROL).spawn(task);
    }
    if let Ok(task) = start() {
        COMMON.start(board::COMMON).spawn(task);
    }
    loop {
        cortex_m::asm::wfi();
    }
}
