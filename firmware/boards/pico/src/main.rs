//! The image of the Raspberry Pi Pico (RP2040): starts the board and its tasks, then sleeps.
//!
//! | what           | runs in                | priority | does                                              |
//! |----------------|------------------------|----------|---------------------------------------------------|
//! | `TIMER_IRQ_1`  | interrupt              | 0        | the control tick, once a millisecond              |
//! | `TIMER_IRQ_0`  | interrupt of the HAL   | 1        | wakes the tasks whose time has come               |
//! | `UART0_IRQ`    | interrupt              | 2        | bytes of the servo bus                            |
//! | `USBCTRL_IRQ`  | interrupt of the HAL   | 2        | packets of the console                            |
//! | `SWI_IRQ_1`    | executor, never long   | 2        | USB, what finds a stop, servo bus                 |
//! | `SWI_IRQ_0`    | executor of the work   | 3        | console with storage and search                   |
//!
//! | file      | holds                                                                       |
//! |-----------|-----------------------------------------------------------------------------|
//! | `adc`     | supply and temperature                                                       |
//! | `board`   | what the firmware's library asks of a board; switches and jumper             |
//! | `chain`   | the output chain by PIO                                                      |
//! | `console` | a serial port over USB                                                       |
//! | `servos`  | the servo bus by UART                                                        |
//! | `flash`   | the second MiB of the flash                                                  |
//! | `watchdog` | resets the chip when the control tick stops                                |
//! | `fault`   | handlers of panic and hard fault                                             |
#![no_std]
#![no_main]

mod adc;
mod board;
mod chain;
mod console;
mod fault;
mod flash;
mod servos;
mod watchdog;

use core::mem::MaybeUninit;
use core::pin::pin;
use core::sync::atomic::{AtomicU32, Ordering};

use darm_core::duty::DutyMeters;
use darm_core::units::Micros;
use darm_core::wire::bootstrap::CrashRecord;
use darm_firmware::app::{Inbox, scan};
use darm_firmware::clock::Clock as _;
use darm_firmware::control::{Shared, TICK};
use darm_firmware::cortex;
use darm_firmware::crash;
use darm_firmware::hardware::{self, ConsoleMemory, Hardware as _, Owned};
use darm_firmware::life::{self, Pulse, Start, Task};
use darm_firmware::tick::Ticker;
use embassy_executor::{InterruptExecutor, SpawnError, SpawnToken};
use embassy_futures::join::{join, join3};
use embassy_rp::interrupt::{InterruptExt as _, Priority};
use embassy_rp::peripherals::USB;
use embassy_rp::{Peri, Peripherals, interrupt, pac};

use board::{Board, BoardClock, BoardPins};
use console::UsbConsole;

/// Of what must not wait for a piece of work: the search for a word computes for milliseconds.
static PROMPT: InterruptExecutor = InterruptExecutor::new();
/// Of the work.
static WORK: InterruptExecutor = InterruptExecutor::new();
/// What the console has received.
static INBOX: Inbox = Inbox::new();
/// What the tasks share.
static SHARED: Shared<'static> = Shared::new();
/// Reports of the console and of the servo bus.
static PULSES: [Pulse; Task::ALL.len()] = [const { Pulse::new() }; Task::ALL.len()];

static CONSOLE: ConsoleMemory<Board> = ConsoleMemory::new();
static mut TICKER: MaybeUninit<Ticker<'static, BoardPins>> = MaybeUninit::uninit();
/// How long each output has been on. Outlives a reset; each meter finds by its checksum whether it did.
#[unsafe(link_section = ".uninit.USED")]
static mut USED: MaybeUninit<DutyMeters> = MaybeUninit::uninit();
/// When the next control tick is due, modulo 2³² µs.
static DUE_US: AtomicU32 = AtomicU32::new(0);

/// The alarm of the timer that the control tick has; the HAL has alarm 0.
const ALARM: usize = 1;
const TICK_US: u32 = TICK.0 as u32;

#[interrupt]
fn TIMER_IRQ_1() {
    pac::TIMER.intr().write(|w| w.set_alarm(ALARM, true));
    let now = BoardClock.now();
    let due_us = DUE_US.load(Ordering::Relaxed);
    // A comparison that rounds down is early by less than a microsecond.
    let late_us = Some((now.0 as u32).wrapping_sub(due_us)).filter(|late_us| *late_us < 1 << 31).unwrap_or(0);
    request_tick(due_us);
    let ticker = &raw mut TICKER;
    // SAFETY: this is unmasked when the value is there; nothing else refers to it, and an interrupt does not nest in itself.
    let ticker = unsafe { (*ticker).assume_init_mut() };
    ticker.tick::<Board>(now, now - Micros(late_us.into()), &SHARED, &PULSES);
}

/// Requests the control tick after the one that was due then; those that were missed meanwhile are left out.
fn request_tick(due_us: u32) {
    let is_past = |us: u32| pac::TIMER.timerawl().read().wrapping_sub(us) < 1 << 31;
    let mut next_us = due_us.wrapping_add(TICK_US);
    loop {
        while is_past(next_us) {
            next_us = next_us.wrapping_add(TICK_US);
        }
        pac::TIMER.alarm(ALARM).write_value(next_us);
        DUE_US.store(next_us, Ordering::Relaxed);
        // The alarm compares for equality: one that was set too late would come after 72 minutes.
        if !is_past(next_us) {
            return;
        }
    }
}

#[interrupt]
unsafe fn SWI_IRQ_0() {
    // SAFETY: this is the interrupt of the executor, unmasked when that starts.
    unsafe { WORK.on_interrupt() }
}

#[interrupt]
unsafe fn SWI_IRQ_1() {
    // SAFETY: this is the interrupt of the executor, unmasked when that starts.
    unsafe { PROMPT.on_interrupt() }
}

/// Runs the device on the bus, hands on what comes, and finds a stop in it.
#[embassy_executor::task]
async fn usb_task(usb: Peri<'static, USB>) {
    let (mut device, UsbConsole { mut receiver, mut sender }) = console::start(usb);
    join3(device.run(), scan(&INBOX, &SHARED, &mut receiver), console::send_said(&mut sender)).await;
}

#[embassy_executor::task]
async fn console_task(owned: Owned<Board>) -> ! {
    let [pulse, _] = &PULSES;
    let Owned { dispatcher, table, profile } = owned;
    let mut outlet = console::Outlet;
    let work = pin!(hardware::console_behind::<Board>(dispatcher, table, profile, &INBOX, &mut outlet));
    hardware::until_restart::<Board>(pulse, work).await
}

/// The console of a board that is held.
#[embassy_executor::task]
async fn recovery_task(usb: Peri<'static, USB>, owned: Owned<Board>) {
    let (mut device, UsbConsole { mut receiver, mut sender }) = console::start(usb);
    let console = hardware::recovery_console::<Board>(owned.dispatcher, &mut receiver, &mut sender);
    join(device.run(), console).await;
}

#[embassy_executor::task]
async fn servo_task(port: servos::Port) -> ! {
    let [_, pulse] = &PULSES;
    let wire = darm_firmware::servo::echo::Wire::default();
    let (ear, mouth) = wire.split(servos::Receiver, port);
    hardware::servos::<Board>(&SHARED, pulse, ear, mouth).await
}

fn require<T>(task: Result<SpawnToken<T>, SpawnError>) -> SpawnToken<T> {
    match task {
        Ok(task) => task,
        Err(_) => crash::give_up::<Board>(format_args!("a task was started twice")),
    }
}

fn set_priorities() {
    interrupt::TIMER_IRQ_1.set_priority(Priority::P0);
    interrupt::TIMER_IRQ_0.set_priority(Priority::P1);
    interrupt::UART0_IRQ.set_priority(Priority::P2);
    interrupt::USBCTRL_IRQ.set_priority(Priority::P2);
    interrupt::SWI_IRQ_1.set_priority(Priority::P2);
    interrupt::SWI_IRQ_0.set_priority(Priority::P3);
}

/// Starts the control tick and the watchdog that it feeds.
#[inline(never)]
fn start_control(pins: BoardPins) {
    let (ticker, used) = (&raw mut TICKER, &raw mut USED);
    // SAFETY: every bit pattern is a meter, valid or not; nothing else refers to them, as this is called once.
    let used = unsafe { (*used).assume_init_mut() };
    // SAFETY: nothing else refers to it, as its interrupt is still masked.
    unsafe { (*ticker).write(Ticker::new(BoardClock.now(), pins, used, &SHARED)) };
    watchdog::start();
    pac::TIMER.inte().modify(|w| w.set_alarm(ALARM, true));
    request_tick(pac::TIMER.timerawl().read());
    // SAFETY: what the handler uses is there.
    unsafe { interrupt::TIMER_IRQ_1.enable() };
}

/// Builds what the tasks own and starts them. A board that is held has the console alone, and its outputs disabled.
fn start(p: Peripherals, crash: Option<CrashRecord>, start: Start) {
    let pins = BoardPins::new(chain::Chain::new(p.PIO0, (p.PIN_2, p.PIN_3, p.PIN_4), p.PIN_5));
    board::start_inputs();
    adc::start();
    set_priorities();
    let owned = CONSOLE.build(crash, &SHARED);
    let prompt = PROMPT.start(interrupt::SWI_IRQ_1);
    if start == Start::Recovery {
        // The pin keeps its level.
        core::mem::forget(pins);
        // The console feeds it.
        watchdog::start();
        prompt.spawn(require(recovery_task(p.USB, owned)));
        return;
    }
    start_control(pins);
    prompt.spawn(require(servo_task(servos::start(p.UART0, p.PIN_0, p.PIN_1))));
    prompt.spawn(require(usb_task(p.USB)));
    WORK.start(interrupt::SWI_IRQ_0).spawn(require(console_task(owned)));
}

#[cortex_m_rt::entry]
fn main() -> ! {
    cortex::paint_stack();
    board::guard_stack();
    let p = embassy_rp::init(embassy_rp::config::Config::default());
    let crash = crash::take(Board::kept(), watchdog::take_bite());
    let crashes = crash::count_crash(Board::kept(), crash.is_some());
    start(p, crash, life::start_after(crashes));
    loop {
        cortex::sleep::<Board>();
    }
}
