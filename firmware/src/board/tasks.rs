//! The three tasks and what they own.
//!
//! | task      | executor            | does                                             |
//! |-----------|---------------------|--------------------------------------------------|
//! | `control` | [`super::CONTROL`]  | looks, decides and drives, once a millisecond    |
//! | `console` | [`super::COMMON`]   | frames and text on USART1, storage               |
//! | `servos`  | [`super::COMMON`]   | the servo bus on USART2                          |
//!
//! A board that is held after crashes has the console alone, with the bootstrap set, see [`crate::rescue`].
//! Else the console and the servo bus report to the control tick; it resets the board when one is silent, see [`crate::life`].
use core::mem::MaybeUninit;
use core::pin::pin;

use darm_core::table::Table;
use darm_core::units::Micros;
use darm_core::wire::bootstrap::{Death, Identity};
use embassy_executor::InterruptExecutor;
use static_cell::StaticCell;
use stm32_metapac::interrupt;

use super::flash::Flash;
use super::gpio::{Output, Switches};
use super::time::BoardClock;
use super::{death, pins, restart, uart, watchdog};
use crate::app::serve;
use crate::clock::Clock;
use crate::control::{Control, Shared, TICK};
use crate::dispatch::{Board, Desk};
use crate::life::{Pulse, STEADY, Start, Watch};
use crate::nearest::Room;
use crate::rescue;
use crate::servo::Bus;
use crate::solenoid::{Pins, Solenoids};

static CONTROL: InterruptExecutor = InterruptExecutor::new();
static COMMON: InterruptExecutor = InterruptExecutor::new();
/// What the tasks share.
pub static SHARED: Shared<'static> = Shared::new();

static CONSOLE_PULSE: Pulse = Pulse::new();
static SERVO_PULSE: Pulse = Pulse::new();

/// The large ones are built before the tasks run: a task that builds them needs their room on the stack for ever.
static TABLE: StaticCell<Table> = StaticCell::new();
static DESK: StaticCell<OnBoard> = StaticCell::new();
static ROOM: StaticCell<Room> = StaticCell::new();
/// Where no flag says that it is in use, see `memory.x`.
#[unsafe(link_section = ".above")]
static mut TICKS: MaybeUninit<Control<'static>> = MaybeUninit::uninit();

type OnBoard = Desk<'static, 'static, Flash, BoardClock>;

#[interrupt]
unsafe fn TSC() {
    // SAFETY: this is the interrupt of the control executor, unmasked when that starts.
    unsafe { CONTROL.on_interrupt() }
}

#[interrupt]
unsafe fn SWPMI1() {
    // SAFETY: this is the interrupt of the common executor, unmasked when that starts.
    unsafe { COMMON.on_interrupt() }
}

/// Looks, decides and drives. What drives the pins cannot fail on this board.
#[embassy_executor::task]
async fn control(control: &'static mut Control<'static>) -> ! {
    let switches = Switches::new();
    let Ok(mut solenoids) = Solenoids::new(Pins {
        data: Output::new(pins::CHAIN_DATA, false),
        clock: Output::new(pins::CHAIN_CLOCK, false),
        latch: Output::new(pins::CHAIN_LATCH, false),
        enable: Output::new(pins::CHAIN_ENABLE, true),
    });
    watchdog::start();
    let (mut watch, mut steady) = (Watch::new(BoardClock.now()), false);
    loop {
        // On whole milliseconds, when SysTick comes; what was missed, by a debugger say, is not made up for.
        let due = Micros((BoardClock.now().0 / TICK.0 + 1) * TICK.0);
        BoardClock.wait_until(due).await;
        #[cfg(feature = "bench")]
        let began = super::measure::begin_tick();
        let now = BoardClock.now();
        #[cfg(feature = "bench")]
        super::measure::note_lateness(due, now);
        let outputs = control.tick(now, due, switches.read(), &SHARED);
        if let Some(chips) = control.chips() {
            solenoids.set_chips(chips);
        }
        let Ok(()) = solenoids.apply(outputs.lines, outputs.enabled);
        if let Some(task) = watch.silent(now, [CONSOLE_PULSE.count(), SERVO_PULSE.count()]) {
            death::end_silence(task);
        }
        watchdog::feed();
        if !steady && due >= STEADY {
            steady = true;
            death::forget_crashes();
        }
        #[cfg(feature = "bench")]
        super::measure::end_tick(began, &outputs);
    }
}

#[embassy_executor::task]
async fn console(desk: &'static mut OnBoard, table: &'static mut Table, start: Start) {
    let (mut receiver, mut sender) = uart::start_console();
    let into = match start {
        Start::Normal => {
            let work = pin!(async {
                open(desk, table).await;
                serve(desk, &mut receiver, &mut sender).await
            });
            CONSOLE_PULSE.during(&BoardClock, work).await
        }
        Start::Held => rescue::serve(&desk.board, &BoardClock, &mut receiver, &mut sender).await,
    };
    restart::restart(into)
}

async fn open(desk: &mut OnBoard, table: &'static mut Table) {
    let flash = Flash::open();
    if let Err(error) = &flash {
        defmt::error!("no storage: {}", defmt::Debug2Format(error));
    }
    desk.open(flash.ok(), table).await;
    defmt::info!("storage {=bool}", desk.has_store());
}

#[embassy_executor::task]
async fn servos() -> ! {
    let (receiver, sender) = uart::start_servo_bus();
    let mut bus = Bus::new(receiver, sender, BoardClock);
    SERVO_PULSE.at_each_poll(pin!(bus.run(&SHARED))).await
}

fn identity() -> Identity {
    Identity { device: super::device(), board: heapless::String::try_from(super::NAME).unwrap_or_default() }
}

/// What the console owns. Each of these is built in a call of its own, so that no two need their stack at once.
#[inline(never)]
fn desk(death: Option<Death>, room: &'static mut Room) -> &'static mut OnBoard {
    DESK.init_with(|| Desk::new(Board { identity: identity(), death }, BoardClock, &SHARED, room))
}

#[inline(never)]
fn room() -> &'static mut Room {
    ROOM.init_with(Room::default)
}

#[inline(never)]
fn table() -> &'static mut Table {
    TABLE.init_with(Table::default)
}

/// What the control tick owns: called once, and as what is built before can be built once only, once at most.
#[inline(never)]
fn ticks() -> &'static mut Control<'static> {
    let ticks = &raw mut TICKS;
    // SAFETY: nothing else refers to it, as it is called once.
    unsafe { (*ticks).write(Control::new(BoardClock.now(), &SHARED)) }
}

/// Builds what the tasks own and starts them. Its stack is free again when they run.
///
/// A board that is held has the console alone, and its outputs disabled.
#[inline(never)]
pub fn start(death: Option<Death>, start: Start) {
    let Ok(console) = console(desk(death, room()), table(), start) else { twice() };
    if start == Start::Held {
        // The pin keeps the level that it gets here.
        Output::new(pins::CHAIN_ENABLE, true);
        COMMON.start(super::COMMON).spawn(console);
        return;
    }
    let (Ok(control), Ok(servos)) = (control(ticks()), servos()) else { twice() };
    let common = COMMON.start(super::COMMON);
    CONTROL.start(super::CONTROL).spawn(control);
    common.spawn(console);
    common.spawn(servos);
}

fn twice() -> ! {
    death::give_up(format_args!("a task was started twice"))
}
