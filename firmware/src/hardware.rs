//! What differs between boards, behind one trait: a board is a type that implements [`Hardware`], its pins, and a start.
//!
//! ```text
//!   board crate                         this library
//!   ───────────                         ────────────
//!   timer interrupt, 1 ms ────────────► tick::Ticker::tick ──► Pins: chain, switches, button
//!   console port (Read, Write) ───────► console ─────────────► Flash, restart
//!   servo port (Read, Write) ─────────► servos
//!   panic, fault of the processor ────► crash::end ──────────► disable_outputs, Kept, reset
//! ```
//!
//! Everything that decides is in this library and is tested on a PC; a board only moves bits. `docs/add-a-board.md` says
//! how a board is added.

use core::pin::{Pin, pin};

use darm_core::output::{MAX_LINES, MAX_SERVOS};
use darm_core::profile::Profile;
use darm_core::table::Table;
use darm_core::table::nearest_search::NearestSearch;
use darm_core::units::{DeviceId, Micros};
use darm_core::wire::bootstrap::{CrashRecord, Identity, RebootTarget};
use darm_core::wire::caps::Caps;
use darm_core::wire::health::Health;
use embassy_futures::select::{Either, select};
use embedded_io_async::{Read, Write};
use embedded_storage_async::nor_flash::NorFlash;
use static_cell::StaticCell;

use crate::app::{Inbox, serve, work};
use crate::clock::Clock;
pub use crate::control::Converted;
use crate::control::{Inputs, Shared};
use crate::dispatch::{BUILD, Board, Dispatcher};
use crate::kept::{Kept, forget_crashes};
use crate::life::Pulse;
use crate::rescue;
use crate::servo::Bus;
use crate::solenoid::Chain;
use crate::store::SLOT_BYTES;

/// Time from one feed of the watchdog to the next while a board is held; its period is at least 47 ms.
const RECOVERY_FEED: Micros = Micros::from_millis(10);

/// A board. All its functions may be called from any interrupt.
pub trait Hardware: Sized + 'static {
    /// Name by which it identifies itself, at most 16 bytes of ASCII.
    const NAME: &'static str;
    /// Output lines that a chain of shift registers may have.
    const LINES: u8 = MAX_LINES as u8;
    /// Inputs for limit switches.
    const INPUTS: u8;
    /// Servos on its bus.
    const SERVOS: u8 = MAX_SERVOS as u8;
    /// The chip's loader is on the console's own cable, where anyone with the port could write firmware: it is entered only
    /// while a person holds the button.
    const GUARDS_LOADER: bool;
    /// Time since its start.
    type Clock: Clock + Copy;
    /// The clock of all tasks; the board has started it.
    const CLOCK: Self::Clock;
    /// What the control tick drives and reads.
    type Pins: Pins;
    /// What holds tables, profile and records.
    type Flash: NorFlash;

    /// The chip's unique number.
    fn device() -> DeviceId;

    /// Output lines that its chain has now, where it can count them; the most that it may have where it cannot.
    fn lines() -> u8 {
        Self::LINES
    }

    /// What it reports of itself; the library adds what the tasks count, and what [`Pins::convert`] gives.
    fn health() -> Health {
        Health::default()
    }

    /// Takes the flash, once; `None` when it does not answer.
    fn open_flash() -> Option<Self::Flash>;

    /// Gives the control tick another period of the watchdog, which the board has started.
    fn feed_watchdog();

    /// Masks interrupts, then disables the output chain in one edge.
    fn disable_outputs();

    /// Resets the chip after a crash. Memory of [`Hardware::kept`] keeps its content.
    fn reset() -> !;

    /// Whether the contact of the button is closed.
    fn is_button_closed() -> bool;

    /// Resets the chip on request, into the firmware or into the chip's loader. A board whose loader starts by a jumper alone
    /// starts the firmware again.
    fn restart(_: RebootTarget) -> ! {
        Self::disable_outputs();
        Self::reset()
    }

    /// Memory that start-up code neither clears nor fills.
    fn kept() -> &'static Kept;
}

/// The pins of the control tick.
pub trait Pins: Chain {
    /// Switches and button as they are now.
    fn inputs(&self) -> Inputs;

    /// Takes what the converter has finished since the last call, and begins the next one of its conversions, of supply and
    /// temperature in turn. Each 5 ms, from the control tick alone: it never waits. A board without a converter gives nothing, and
    /// refuses a profile with a threshold of the supply.
    fn convert(&mut self) -> Option<Converted> {
        None
    }

    /// Drives the pulse to a camera. Never called unless the profile has one; until then its pin is no output.
    fn set_sync(&mut self, _high: bool) {}
}

/// What a board can do.
pub fn caps<H: Hardware>() -> Caps {
    Caps { lines: H::lines(), inputs: H::INPUTS, servos: H::SERVOS, ..Caps::largest(H::NAME, SLOT_BYTES as u32, BUILD) }
}

/// Memory of what the console task owns.
pub struct ConsoleMemory<H: Hardware> {
    table: StaticCell<Table>,
    room: StaticCell<NearestSearch>,
    profile: StaticCell<Profile>,
    dispatcher: StaticCell<OnBoard<H>>,
}

/// What the console task owns.
pub struct Owned<H: Hardware> {
    /// Answers requests.
    pub dispatcher: &'static mut OnBoard<H>,
    /// Memory for the table that is loaded.
    pub table: &'static mut Table,
    /// Memory for the profile in force.
    pub profile: &'static mut Profile,
}

impl<H: Hardware> ConsoleMemory<H> {
    /// Nothing is built yet.
    pub const fn new() -> Self {
        Self {
            table: StaticCell::new(),
            room: StaticCell::new(),
            profile: StaticCell::new(),
            dispatcher: StaticCell::new(),
        }
    }

    /// Builds it, once, before the tasks run: a task that built it would need its room on the stack for ever.
    pub fn build(&'static self, crash: Option<CrashRecord>, shared: &'static Shared<'static>) -> Owned<H> {
        Owned { dispatcher: self.dispatcher(crash, shared), table: self.table(), profile: self.profile() }
    }

    // Each of these is built in a separate call, so that no two need their stack at once.

    #[inline(never)]
    fn dispatcher(
        &'static self,
        crash: Option<CrashRecord>,
        shared: &'static Shared<'static>,
    ) -> &'static mut OnBoard<H> {
        self.dispatcher.init_with(|| {
            // SAFETY: the dispatcher is built once.
            let log = unsafe { H::kept().log() };
            Dispatcher::new(describe::<H>(crash), H::CLOCK, shared, self.room(), log)
        })
    }

    #[inline(never)]
    fn room(&'static self) -> &'static mut NearestSearch {
        self.room.init_with(NearestSearch::default)
    }

    #[inline(never)]
    fn table(&'static self) -> &'static mut Table {
        self.table.init_with(Table::default)
    }

    #[inline(never)]
    fn profile(&'static self) -> &'static mut Profile {
        self.profile.init_with(Profile::empty)
    }
}

impl<H: Hardware> Default for ConsoleMemory<H> {
    fn default() -> Self {
        Self::new()
    }
}

/// What the dispatcher knows of a board.
pub fn describe<H: Hardware>(crash: Option<CrashRecord>) -> Board<'static> {
    let board = heapless::String::try_from(H::NAME).unwrap_or_default();
    Board {
        identity: Identity { device: H::device(), board },
        crash,
        caps: caps::<H>(),
        guards_loader: H::GUARDS_LOADER,
        health: H::health,
        kept: Some(H::kept()),
    }
}

/// The dispatcher of a board.
pub type OnBoard<H> = Dispatcher<'static, 'static, <H as Hardware>::Flash, <H as Hardware>::Clock>;

/// Opens the store and serves the console until somebody asks for a restart; into what.
///
/// Table and profile come apart: in one value with the dispatcher they cost the stack of a task 8 KiB.
pub async fn console<H: Hardware>(
    dispatcher: &'static mut OnBoard<H>,
    table: &'static mut Table,
    profile: &'static mut Profile,
    reader: &mut impl Read,
    writer: &mut impl Write,
) -> RebootTarget {
    dispatcher.open(H::open_flash(), table, profile).await;
    serve(dispatcher, reader, writer).await
}

/// The same where [`crate::app::scan`] fills the inbox at a higher priority.
pub async fn console_behind<H: Hardware>(
    dispatcher: &'static mut OnBoard<H>,
    table: &'static mut Table,
    profile: &'static mut Profile,
    inbox: &Inbox,
    writer: &mut impl Write,
) -> RebootTarget {
    dispatcher.open(H::open_flash(), table, profile).await;
    work(inbox, dispatcher, writer).await
}

/// Serves the console of a board that is held after crashes, the bootstrap set alone (see [`crate::rescue`]), and restarts as
/// it says.
pub async fn recovery_console<H: Hardware>(
    dispatcher: &OnBoard<H>,
    reader: &mut impl Read,
    writer: &mut impl Write,
) -> ! {
    let clock = H::CLOCK;
    let serve = rescue::serve(&dispatcher.board, H::is_button_closed, &clock, reader, writer);
    match select(serve, feed_for_ever::<H>()).await {
        Either::First(into) => restart::<H>(into),
        Either::Second(never) => never,
    }
}

/// Runs the console, which reports by its pulse, and restarts as it says.
pub async fn until_restart<H: Hardware>(pulse: &Pulse, console: Pin<&mut impl Future<Output = RebootTarget>>) -> ! {
    restart::<H>(pulse.during(&H::CLOCK, console).await)
}

/// A restart on request ends the crashes in a row.
fn restart<H: Hardware>(into: RebootTarget) -> ! {
    forget_crashes(H::kept());
    H::restart(into)
}

/// Feeds the watchdog of a board that is held: no control tick does. A console that hangs is reset, and the crashes in a
/// row, which only a reboot ends, hold the board again.
async fn feed_for_ever<H: Hardware>() -> ! {
    loop {
        H::feed_watchdog();
        H::CLOCK.wait_until(H::CLOCK.now() + RECOVERY_FEED).await;
    }
}

/// Serves the servo bus for ever, and reports.
pub async fn servos<H: Hardware>(shared: &Shared<'static>, pulse: &Pulse, reader: impl Read, writer: impl Write) -> ! {
    let mut bus = Bus::new(reader, writer, H::CLOCK);
    pulse.at_each_poll(pin!(bus.run(shared))).await
}
