//! The image of the Olimex STM32-H405 (STM32F405): starts the board and its tasks, then sleeps. Its pins are unproven: the
//! machine of the emulator has none.
//!
//! | what               | runs in                          | priority | does                                  |
//! |--------------------|----------------------------------|----------|---------------------------------------|
//! | `SysTick`          | interrupt                        | 0x20     | clock and control tick, once a millisecond |
//! | `USART1`, `USART2` | interrupt                        | 0x80     | bytes of console and servo bus        |
//! | `SDIO`             | executor; the card is not used   | 0xE0     | console with storage, servo bus       |
#![no_std]
#![no_main]

mod board;
mod fault;
mod time;
mod uart;

use core::mem::MaybeUninit;
use core::pin::pin;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::scb::SystemHandler;
use darm_core::duty::DutyMeters;
use darm_core::units::Micros;
use darm_firmware::clock::Clock as _;
use darm_firmware::control::Shared;
use darm_firmware::cortex;
use darm_firmware::crash;
use darm_firmware::hardware::{self, ConsoleMemory, Hardware as _, Owned};
use darm_firmware::life::{self, Pulse, Start, Task};
use darm_firmware::servo::echo::Wire;
use darm_firmware::tick::Ticker;
use embassy_executor::InterruptExecutor;
use stm32_metapac::{Interrupt, interrupt};

use board::{Board, BoardPins};
use time::CLOCK;

static EXECUTOR: InterruptExecutor = InterruptExecutor::new();
static SHARED: Shared<'static> = Shared::new();
/// Reports of the console and of the servo bus.
static PULSES: [Pulse; Task::ALL.len()] = [const { Pulse::new() }; Task::ALL.len()];

static CONSOLE: ConsoleMemory<Board> = ConsoleMemory::new();
/// The ticker is there, and the board is not held.
static CONTROLS: AtomicBool = AtomicBool::new(false);
static mut TICKER: MaybeUninit<Ticker<'static, BoardPins>> = MaybeUninit::uninit();
/// How long each output has been on. Outlives a reset; each meter finds by its checksum whether it did.
#[unsafe(link_section = ".uninit.USED")]
static mut USED: MaybeUninit<DutyMeters> = MaybeUninit::uninit();

/// The control tick that was due then. From SysTick only.
fn control_tick(due: Micros) {
    let ticker = &raw mut TICKER;
    if CONTROLS.load(Ordering::Acquire) {
        // SAFETY: it is there; nothing else refers to it, and an interrupt does not nest in itself.
        let ticker = unsafe { (*ticker).assume_init_mut() };
        ticker.tick::<Board>(CLOCK.now(), due, &SHARED, &PULSES);
    }
}

#[interrupt]
unsafe fn SDIO() {
    // SAFETY: this is the interrupt of the executor, unmasked when that starts.
    unsafe { EXECUTOR.on_interrupt() }
}

#[embassy_executor::task]
async fn console(owned: Owned<Board>, start: Start) -> ! {
    let [pulse, _] = &PULSES;
    let (mut receiver, mut sender) = uart::start_console();
    let Owned { dispatcher, table, profile } = owned;
    if start == Start::Recovery {
        hardware::recovery_console::<Board>(dispatcher, &mut receiver, &mut sender).await
    }
    let work = pin!(hardware::console::<Board>(dispatcher, table, profile, &mut receiver, &mut sender));
    hardware::until_restart::<Board>(pulse, work).await
}

#[embassy_executor::task]
async fn servos() -> ! {
    let [_, pulse] = &PULSES;
    let (receiver, sender) = uart::start_servo_bus();
    let wire = Wire::default();
    let (receiver, sender) = wire.split(receiver, sender);
    hardware::servos::<Board>(&SHARED, pulse, receiver, sender).await
}

/// Starts the control tick.
#[inline(never)]
fn start_control() {
    let (ticker, used) = (&raw mut TICKER, &raw mut USED);
    // SAFETY: every bit pattern is a meter, valid or not; nothing else refers to them, as this is called once.
    let used = unsafe { (*used).assume_init_mut() };
    // SAFETY: nothing else refers to it, as the control tick has not started.
    unsafe { (*ticker).write(Ticker::new(CLOCK.now(), BoardPins, used, &SHARED)) };
    CONTROLS.store(true, Ordering::Release);
}

#[cortex_m_rt::entry]
fn main() -> ! {
    cortex::paint_stack();
    let crash = crash::take(Board::kept(), board::take_bite());
    let crashes = crash::count_crash(Board::kept(), crash.is_some());
    board::start_clocks();
    board::start_pins();
    // SAFETY: called once at start, before interrupts; nothing else owns the NVIC or SCB.
    unsafe {
        let mut core = cortex_m::Peripherals::steal();
        core.SCB.set_priority(SystemHandler::SysTick, 0x20);
        core.NVIC.set_priority(Interrupt::USART1, 0x80);
        core.NVIC.set_priority(Interrupt::USART2, 0x80);
        core.NVIC.set_priority(Interrupt::SDIO, 0xE0);
        CLOCK.start(&mut core.SYST);
    }
    let start = life::start_after(crashes);
    let Ok(console) = console(CONSOLE.build(crash, &SHARED), start) else { started_twice() };
    board::start_watchdog();
    let tasks = EXECUTOR.start(Interrupt::SDIO);
    tasks.spawn(console);
    // A board that is held has the console alone, which feeds the watchdog; its outputs stay disabled.
    if start == Start::Normal {
        let Ok(servos) = servos() else { started_twice() };
        start_control();
        tasks.spawn(servos);
    }
    loop {
        cortex::sleep::<Board>();
    }
}

fn started_twice() -> ! {
    crash::give_up::<Board>(format_args!("a task was started twice"))
}
