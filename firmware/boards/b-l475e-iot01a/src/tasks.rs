//! The control tick, the two tasks, and what they own.
//!
//! | what      | runs in             | does                                             |
//! |-----------|---------------------|--------------------------------------------------|
//! | [`TSC`]   | [`CONTROL`]  | looks, decides and drives, once a millisecond    |
//! | `console` | [`COMMON`]   | frames and text on USART1, storage               |
//! | `servos`  | [`COMMON`]   | the servo bus on USART2                          |
//!
//! The control tick is a plain interrupt that SysTick requests: no executor, no future, nothing in it can panic
//! (`cargo xtask image --panics`).
//!
//! A board that is held after crashes has the console alone, with the bootstrap set, see [`darm_firmware::rescue`].
//! Else the console and the servo bus report to the control tick; it resets the board when one is silent, see [`darm_firmware::life`].
use core::mem::MaybeUninit;
use core::pin::pin;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use darm_core::duty::DutyMeters;
use darm_core::profile::Profile;
use darm_core::table::Table;
use darm_core::table::nearest_search::NearestSearch;
use darm_core::units::Micros;
use darm_core::wire::bootstrap::CrashRecord;
use darm_firmware::clock::Clock;
use darm_firmware::control::Shared;
use darm_firmware::crash;
use darm_firmware::dispatch::Dispatcher;
use darm_firmware::hardware::{self, Hardware as _, OnBoard};
use darm_firmware::life::{Pulse, Start, Task};
use darm_firmware::servo::echo::Wire;
use darm_firmware::tick::Ticker;
use embassy_executor::InterruptExecutor;
use static_cell::StaticCell;
use stm32_metapac::interrupt;

use crate::board::{Board, BoardPins, COMMON, CONTROL};
use crate::time::BoardClock;
use crate::{uart, watchdog};

static EXECUTOR: InterruptExecutor = InterruptExecutor::new();
/// What the tasks share.
pub static SHARED: Shared<'static> = Shared::new();

/// Reports of the console and of the servo bus.
static PULSES: [Pulse; Task::ALL.len()] = [const { Pulse::new() }; Task::ALL.len()];

/// The large ones are built before the tasks run: a task that builds them needs their room on the stack for ever.
static TABLE: StaticCell<Table> = StaticCell::new();
static ROOM: StaticCell<NearestSearch> = StaticCell::new();
static PROFILE: StaticCell<Profile> = StaticCell::new();
/// How long each output has been on. Start-up code neither clears nor fills this section, so it outlives a reset, unless
/// the option byte SRAM2_RST has it erased; each meter finds by its checksum whether it did.
#[unsafe(link_section = ".above.USED")]
static mut USED: MaybeUninit<DutyMeters> = MaybeUninit::uninit();
/// In the memory that nothing clears at the start, see `board.x`.
#[unsafe(link_section = ".above.TICKER")]
static mut TICKER: MaybeUninit<Ticker<'static, BoardPins>> = MaybeUninit::uninit();
/// In the same memory.
#[unsafe(link_section = ".above.DISPATCHER")]
static mut DISPATCHER: MaybeUninit<OnBoard<Board>> = MaybeUninit::uninit();
/// When the requested tick is due, modulo 2³² µs.
static DUE_US: AtomicU32 = AtomicU32::new(0);

/// Requests the control tick that is due now. From SysTick, once a [`TICK`](darm_firmware::control::TICK); a tick that still waits keeps its time.
pub(crate) fn request_tick(due: Micros) {
    if !NVIC::is_pending(CONTROL) {
        DUE_US.store(due.0 as u32, Ordering::Relaxed);
        NVIC::pend(CONTROL);
    }
}

#[interrupt]
fn TSC() {
    let ticker = &raw mut TICKER;
    // SAFETY: this is unmasked when the value is there; nothing else refers to it, and an interrupt does not nest in itself.
    let ticker = unsafe { (*ticker).assume_init_mut() };
    let now = BoardClock.now();
    let late_us = (now.0 as u32).wrapping_sub(DUE_US.load(Ordering::Relaxed));
    let due = now - Micros(late_us.into());
    #[cfg(feature = "bench")]
    let began = crate::measure::begin_tick();
    #[cfg(feature = "bench")]
    crate::measure::note_lateness(due, now);
    let _outputs = ticker.tick::<Board>(now, due, &SHARED, &PULSES);
    #[cfg(feature = "bench")]
    crate::measure::end_tick(began, &_outputs);
}

#[interrupt]
unsafe fn SWPMI1() {
    // SAFETY: this is the interrupt of the common executor, unmasked when that starts.
    unsafe { EXECUTOR.on_interrupt() }
}

#[embassy_executor::task]
async fn console(
    dispatcher: &'static mut OnBoard<Board>,
    table: &'static mut Table,
    profile: &'static mut Profile,
    start: Start,
) -> ! {
    let [pulse, _] = &PULSES;
    let (mut receiver, mut sender) = uart::start_console();
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
    let (ear, mouth) = wire.split(receiver, sender);
    hardware::servos::<Board>(&SHARED, pulse, ear, mouth).await
}

/// What the console owns. Each of these is built in a separate call, so that no two need their stack at once.
#[inline(never)]
fn dispatcher(crash: Option<CrashRecord>, room: &'static mut NearestSearch) -> &'static mut OnBoard<Board> {
    let dispatcher = &raw mut DISPATCHER;
    let board = hardware::describe::<Board>(crash);
    // SAFETY: nothing else refers to them, as this takes the room, which can be built once only.
    unsafe { (*dispatcher).write(Dispatcher::new(board, BoardClock, &SHARED, room, Board::kept().log())) }
}

/// The room for a search. Called once.
#[inline(never)]
pub fn room() -> &'static mut NearestSearch {
    ROOM.init_with(NearestSearch::default)
}

#[inline(never)]
fn table() -> &'static mut Table {
    TABLE.init_with(Table::default)
}

#[inline(never)]
fn profile() -> &'static mut Profile {
    PROFILE.init_with(Profile::empty)
}

/// What memory has kept of how long each output was on. Called once.
fn used() -> &'static mut DutyMeters {
    let used = &raw mut USED;
    // SAFETY: every bit pattern is a meter, valid or not; nothing else refers to them, as this is called once.
    unsafe { (*used).assume_init_mut() }
}

/// Starts the control tick and the watchdog that it feeds. Called once, as what is built before can be built once only.
#[inline(never)]
fn start_control(pins: BoardPins) {
    let ticker = &raw mut TICKER;
    // SAFETY: nothing else refers to it, as its interrupt is still masked.
    unsafe { (*ticker).write(Ticker::new(BoardClock.now(), pins, used(), &SHARED)) };
    watchdog::start();
    NVIC::unpend(CONTROL);
    // SAFETY: what the handler uses is there.
    unsafe { NVIC::unmask(CONTROL) };
}

/// Builds what the tasks own and starts them. Its stack is free again when they run.
///
/// A board that is held has the console alone, and its outputs disabled.
#[inline(never)]
pub fn start(crash: Option<CrashRecord>, start: Start, room: &'static mut NearestSearch) {
    // Before the dispatcher, which says how many lines there are. The pins keep the levels that they get here.
    let pins = BoardPins::new();
    let Ok(console) = console(dispatcher(crash, room), table(), profile(), start) else { twice() };
    if start == Start::Recovery {
        // The console feeds it.
        watchdog::start();
        EXECUTOR.start(COMMON).spawn(console);
        return;
    }
    let Ok(servos) = servos() else { twice() };
    start_control(pins);
    let common = EXECUTOR.start(COMMON);
    common.spawn(console);
    common.spawn(servos);
}

fn twice() -> ! {
    crash::give_up::<Board>(format_args!("a task was started twice"))
}
