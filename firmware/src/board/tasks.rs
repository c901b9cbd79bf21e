//! The control tick, the two tasks, and what they own.
//!
//! | what      | runs in             | does                                             |
//! |-----------|---------------------|--------------------------------------------------|
//! | [`TSC`]   | [`super::CONTROL`]  | looks, decides and drives, once a millisecond    |
//! | `console` | [`super::COMMON`]   | frames and text on USART1, storage               |
//! | `servos`  | [`super::COMMON`]   | the servo bus on USART2                          |
//!
//! The control tick is a plain interrupt that SysTick requests: no executor, no future, nothing in it can panic
//! (`cargo xtask image --panics`).
//!
//! A board that is held after crashes has the console alone, with the bootstrap set, see [`crate::rescue`].
//! Else the console and the servo bus report to the control tick; it resets the board when one is silent, see [`crate::life`].
use core::mem::MaybeUninit;
use core::pin::pin;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use darm_core::duty::DutyMeters;
use darm_core::profile::Profile;
use darm_core::table::Table;
use darm_core::units::Micros;
use darm_core::wire::bootstrap::{CrashRecord, Identity};
use darm_core::wire::caps::Caps;
use embassy_executor::InterruptExecutor;
use static_cell::StaticCell;
use stm32_metapac::interrupt;

use super::flash::Flash;
use super::gpio::{ChainClock, ChainData, ChainEnable, ChainLatch, Switches, user_button_pressed};
use super::pins::SWITCHES;
use super::time::BoardClock;
use super::{crash, restart, uart, watchdog};
use crate::app::serve;
use crate::clock::Clock;
use crate::control::{Control, Inputs, Shared};
use crate::dispatch::{BUILD, Board, Dispatcher};
use crate::life::{Pulse, STEADY, Start, Watch};
use crate::nearest::Room;
use crate::rescue;
use crate::servo::Bus;
use crate::solenoid::{Pins, Solenoids};
use crate::store::SLOT_BYTES;

static COMMON: InterruptExecutor = InterruptExecutor::new();
/// What the tasks share.
pub static SHARED: Shared<'static> = Shared::new();

static CONSOLE_PULSE: Pulse = Pulse::new();
static SERVO_PULSE: Pulse = Pulse::new();

/// The large ones are built before the tasks run: a task that builds them needs their room on the stack for ever.
static TABLE: StaticCell<Table> = StaticCell::new();
static ROOM: StaticCell<Room> = StaticCell::new();
static PROFILE: StaticCell<Profile> = StaticCell::new();
/// How long each output has been on. Start-up code neither clears nor fills this section, so it outlives a reset, unless
/// the option byte SRAM2_RST has it erased; each meter finds by its checksum whether it did.
#[unsafe(link_section = ".above.USED")]
static mut USED: MaybeUninit<DutyMeters> = MaybeUninit::uninit();
/// In the memory that nothing clears at the start, see `memory.x`.
#[unsafe(link_section = ".above.TICKER")]
static mut TICKER: MaybeUninit<Ticker> = MaybeUninit::uninit();
/// In the same memory.
#[unsafe(link_section = ".above.DISPATCHER")]
static mut DISPATCHER: MaybeUninit<OnBoard> = MaybeUninit::uninit();
/// When the requested tick is due, modulo 2³² µs.
static DUE_US: AtomicU32 = AtomicU32::new(0);

type OnBoard = Dispatcher<'static, 'static, Flash, BoardClock>;

/// Requests the control tick that is due now. From SysTick, once a [`TICK`](crate::control::TICK); a tick that still waits keeps its time.
pub(super) fn request_tick(due: Micros) {
    if !NVIC::is_pending(super::CONTROL) {
        DUE_US.store(due.0 as u32, Ordering::Relaxed);
        NVIC::pend(super::CONTROL);
    }
}

#[interrupt]
fn TSC() {
    let ticker = &raw mut TICKER;
    // SAFETY: this is unmasked when the value is there; nothing else refers to it, and an interrupt does not nest in itself.
    let ticker = unsafe { (*ticker).assume_init_mut() };
    let now = BoardClock.now();
    let late_us = (now.0 as u32).wrapping_sub(DUE_US.load(Ordering::Relaxed));
    ticker.tick(now, now - Micros(late_us.into()));
}

#[interrupt]
unsafe fn SWPMI1() {
    // SAFETY: this is the interrupt of the common executor, unmasked when that starts.
    unsafe { COMMON.on_interrupt() }
}

type Chain = Solenoids<ChainData, ChainClock, ChainLatch, ChainEnable>;

/// What the control tick owns.
struct Ticker {
    control: Control<'static>,
    switches: Switches,
    solenoids: Chain,
    watch: Watch,
    /// The start has run for [`STEADY`].
    steady: bool,
}

impl Ticker {
    /// Takes over the pins, outputs disabled. What drives them cannot fail on this board.
    fn new(now: Micros) -> Self {
        let Ok(solenoids) = Solenoids::new(Pins {
            data: ChainData::new(false),
            clock: ChainClock::new(false),
            latch: ChainLatch::new(false),
            enable: ChainEnable::new(true),
        });
        let control = Control::new(now, &SHARED, used());
        Self { control, switches: Switches::new(), solenoids, watch: Watch::new(now), steady: false }
    }

    /// Looks, decides and drives; then feeds the watchdog if the tasks report.
    fn tick(&mut self, now: Micros, due: Micros) {
        #[cfg(feature = "bench")]
        let began = super::measure::begin_tick();
        #[cfg(feature = "bench")]
        super::measure::note_lateness(due, now);
        let inputs = Inputs { switches: self.switches.read(), button: user_button_pressed() };
        let outputs = self.control.tick(now, due, inputs, &SHARED);
        let Ok(()) = self.solenoids.apply(outputs.lines, outputs.enabled);
        self.look_after(now);
        #[cfg(feature = "bench")]
        super::measure::end_tick(began, &outputs);
    }

    fn look_after(&mut self, now: Micros) {
        if let Some(task) = self.watch.silent(now, [CONSOLE_PULSE.count(), SERVO_PULSE.count()]) {
            crash::end_silence(task);
        }
        watchdog::feed();
        if !self.steady && now >= STEADY {
            self.steady = true;
            crash::forget_crashes();
        }
    }
}

#[embassy_executor::task]
async fn console(
    dispatcher: &'static mut OnBoard,
    table: &'static mut Table,
    profile: &'static mut Profile,
    start: Start,
) {
    let (mut receiver, mut sender) = uart::start_console();
    let into = match start {
        Start::Normal => {
            let work = pin!(async {
                open(dispatcher, table, profile).await;
                serve(dispatcher, &mut receiver, &mut sender).await
            });
            CONSOLE_PULSE.during(&BoardClock, work).await
        }
        Start::Recovery => rescue::serve(&dispatcher.board, &BoardClock, &mut receiver, &mut sender).await,
    };
    restart::restart(into)
}

async fn open(dispatcher: &mut OnBoard, table: &'static mut Table, profile: &'static mut Profile) {
    let flash = Flash::open();
    if let Err(error) = &flash {
        defmt::error!("no storage: {}", defmt::Debug2Format(error));
    }
    dispatcher.open(flash.ok(), table, profile).await;
    defmt::info!("storage {=bool}", dispatcher.has_store());
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

fn caps() -> Caps {
    Caps { inputs: SWITCHES.len() as u8, ..Caps::largest(super::NAME, SLOT_BYTES as u32, BUILD) }
}

/// What the console owns. Each of these is built in a separate call, so that no two need their stack at once.
#[inline(never)]
fn dispatcher(crash: Option<CrashRecord>, room: &'static mut Room) -> &'static mut OnBoard {
    let dispatcher = &raw mut DISPATCHER;
    let board = Board { identity: identity(), crash, caps: caps() };
    // SAFETY: nothing else refers to it, as this takes the room, which can be built once only.
    unsafe { (*dispatcher).write(Dispatcher::new(board, BoardClock, &SHARED, room)) }
}

/// The room for a search. Called once.
#[inline(never)]
pub fn room() -> &'static mut Room {
    ROOM.init_with(Room::default)
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
fn start_control() {
    let ticker = &raw mut TICKER;
    // SAFETY: nothing else refers to it, as its interrupt is still masked.
    unsafe { (*ticker).write(Ticker::new(BoardClock.now())) };
    watchdog::start();
    NVIC::unpend(super::CONTROL);
    // SAFETY: what the handler uses is there.
    unsafe { NVIC::unmask(super::CONTROL) };
}

/// Builds what the tasks own and starts them. Its stack is free again when they run.
///
/// A board that is held has the console alone, and its outputs disabled.
#[inline(never)]
pub fn start(crash: Option<CrashRecord>, start: Start, room: &'static mut Room) {
    let Ok(console) = console(dispatcher(crash, room), table(), profile(), start) else { twice() };
    if start == Start::Recovery {
        // The pin keeps the level that it gets here.
        ChainEnable::new(true);
        COMMON.start(super::COMMON).spawn(console);
        return;
    }
    let Ok(servos) = servos() else { twice() };
    start_control();
    let common = COMMON.start(super::COMMON);
    common.spawn(console);
    common.spawn(servos);
}

fn twice() -> ! {
    crash::give_up(format_args!("a task was started twice"))
}
