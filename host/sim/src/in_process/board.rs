//! The firmware's own tasks as one future, on the board's pins.

use std::cell::{Cell, RefCell};
use std::convert::Infallible;
use std::future::{Future, poll_fn};
use std::pin::pin;
use std::rc::Rc;
use std::task::Poll;

use darm_core::duty::DutyMeters;
use darm_core::profile::Profile;
use darm_core::table::Table;
use darm_core::table::nearest_search::NearestSearch;
use darm_core::units::{DeviceId, Micros};
use darm_core::wire::bootstrap::{Identity, RebootTarget};
use darm_core::wire::caps::Caps;
use darm_core::wire::health::Health;
use darm_firmware::app::serve;
use darm_firmware::clock::Clock;
use darm_firmware::control::{Inputs, Shared, TICK};
use darm_firmware::dispatch::{BUILD, Board, Dispatcher};
use darm_firmware::hardware::{self, Converted};
use darm_firmware::kept::Kept;
use darm_firmware::life::{Pulse, Task};
use darm_firmware::log::LogMemory;
use darm_firmware::pipe::{Pipe, PipeReader, PipeWriter};
use darm_firmware::servo::Bus;
use darm_firmware::solenoid::{self, Chain, ReadBack};
use darm_firmware::store::SLOT_BYTES;
use darm_firmware::tick::{Ticker, WatchdogAction};
use embassy_futures::select::{Either3, select3};
use embedded_hal::digital::{ErrorType, InputPin, OutputPin};
use embedded_storage_async::nor_flash::NorFlash;

use super::chip::Chip;
use super::flash::{MemoryFlash, Rp2040, Stm32l475};

/// Number of the simulated device.
pub const DEVICE: DeviceId = DeviceId(*b"in-process!!");

/// One of the four pins that drive the chain of shift registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pin {
    /// Serial data.
    Data,
    /// Shift clock, rising edge.
    Clock,
    /// Latch, rising edge.
    Latch,
    /// Output enable, active low.
    Enable,
}

/// What is wrong between the board and its chain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChainFaults {
    /// The wire from the serial output of the last chip is cut: it reads low.
    pub return_cut: bool,
    /// The level that output enable reads, `true` for high, whatever the board drives.
    pub enable: Option<bool>,
}

/// Memory that outlives a reset.
#[derive(Clone)]
pub(super) struct Outliving {
    /// How long each output has been on.
    pub(super) used: Rc<RefCell<DutyMeters>>,
    /// What writes of the flash have used up, and the crashes.
    pub(super) kept: Rc<Kept>,
}

impl Outliving {
    /// After a power cut.
    pub(super) fn blank() -> Self {
        Self { used: Rc::default(), kept: Rc::new(Kept::blank()) }
    }
}

/// Board time that the simulation advances.
#[derive(Default)]
pub(super) struct ManualClock(Cell<u64>);

impl ManualClock {
    /// Advances the time.
    pub(super) fn advance(&self, span: Micros) {
        self.0.set(self.0.get() + span.0);
    }
}

impl Clock for ManualClock {
    fn now(&self) -> Micros {
        Micros(self.0.get())
    }

    fn wait_until(&self, at: Micros) -> impl Future<Output = ()> {
        poll_fn(move |_| if self.now() >= at { Poll::Ready(()) } else { Poll::Pending })
    }
}

/// The board's pins and bytes queues.
pub(super) struct Wires {
    pub(super) clock: ManualClock,
    pub(super) console_in: Pipe<1024>,
    pub(super) console_out: Pipe<1024>,
    pub(super) bus_in: Pipe<256>,
    pub(super) bus_out: Pipe<256>,
    /// Limit switches: bit `i` is input `i`.
    pub(super) switches: Cell<u32>,
    /// A person holds the user button.
    pub(super) button: Cell<bool>,
    /// Supply of the board, mV; `None` where it measures none.
    pub(super) supply_mv: Cell<Option<u16>>,
    /// What is wrong with the chain.
    pub(super) faults: Cell<ChainFaults>,
    /// The chips of the chain.
    pub(super) chips: Cell<u8>,
    /// The stages of the shift registers, that of the last chip highest.
    stages: Cell<u64>,
    /// Pins that are high, by bit of [`Pin`].
    levels: Cell<u8>,
    /// Edges since they were taken last.
    edges: RefCell<Vec<(Pin, bool)>>,
}

impl Default for Wires {
    /// After a reset: the pull-up holds output enable high.
    fn default() -> Self {
        Self {
            clock: ManualClock::default(),
            console_in: Pipe::default(),
            console_out: Pipe::default(),
            bus_in: Pipe::default(),
            bus_out: Pipe::default(),
            switches: Cell::new(0),
            button: Cell::new(false),
            supply_mv: Cell::new(None),
            faults: Cell::default(),
            chips: Cell::new(8),
            stages: Cell::new(0),
            levels: Cell::new(1 << Pin::Enable as u8),
            edges: RefCell::default(),
        }
    }
}

impl Wires {
    /// Sets a pin; a repeated level is no edge.
    fn set(&self, pin: Pin, high: bool) {
        let (levels, bit) = (self.levels.get(), 1 << pin as u8);
        if (levels & bit != 0) != high {
            self.levels.set(levels ^ bit);
            if pin == Pin::Clock && high {
                self.stages.set(self.stages.get() << 1 | u64::from(levels >> Pin::Data as u8 & 1));
            }
            self.edges.borrow_mut().push((pin, high));
        }
    }

    /// Moves the edges since the last call to the end of `into`.
    pub(super) fn take_edges(&self, into: &mut Vec<(Pin, bool)>) {
        into.append(&mut self.edges.borrow_mut());
    }
}

/// One output pin.
struct Wire(Rc<Wires>, Pin);

impl ErrorType for Wire {
    type Error = Infallible;
}

impl OutputPin for Wire {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set(self.1, false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set(self.1, true);
        Ok(())
    }
}

impl InputPin for Wire {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        let stuck = self.0.faults.get().enable.filter(|_| self.1 == Pin::Enable);
        Ok(stuck.unwrap_or(self.0.levels.get() >> self.1 as u8 & 1 != 0))
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|is_high| !is_high)
    }
}

/// The serial output of the last chip, wired back to an input.
struct FarEnd(Rc<Wires>);

impl ErrorType for FarEnd {
    type Error = Infallible;
}

impl InputPin for FarEnd {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        let last = 8 * self.0.chips.get().clamp(1, 8) - 1;
        Ok(!self.0.faults.get().return_cut && self.0.stages.get() >> last & 1 == 1)
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|is_high| !is_high)
    }
}

/// The pins of the control tick.
struct BoardPins {
    chain: ReadBack<Wire, Wire, Wire, Wire, FarEnd>,
    wires: Rc<Wires>,
    /// The converter measured the supply last, and not the temperature.
    has_measured_supply: bool,
}

impl BoardPins {
    fn new(wires: &Rc<Wires>) -> Self {
        let pin = |pin| Wire(wires.clone(), pin);
        let [data, clock, latch, enable] = [Pin::Data, Pin::Clock, Pin::Latch, Pin::Enable].map(pin);
        let chain = ReadBack::new(solenoid::Pins { data, clock, latch, enable }, FarEnd(wires.clone()));
        Self { chain, wires: wires.clone(), has_measured_supply: false }
    }
}

impl Chain for BoardPins {
    fn shift(&mut self, lines: u64) {
        self.chain.shift(lines);
    }

    fn verify(&mut self, lines: u64) -> Option<bool> {
        self.chain.verify(lines)
    }

    fn prime(&mut self) {
        self.chain.prime();
    }

    fn count(&mut self) -> Option<u8> {
        self.chain.count()
    }

    fn set_enabled(&mut self, enabled: bool) {
        self.chain.set_enabled(enabled);
    }

    fn reads_disabled(&mut self) -> Option<bool> {
        self.chain.reads_disabled()
    }
}

impl hardware::Pins for BoardPins {
    fn inputs(&self) -> Inputs {
        Inputs { switches: self.wires.switches.get(), button: self.wires.button.get(), ..Inputs::default() }
    }

    /// Supply and temperature in turn.
    fn convert(&mut self) -> Option<Converted> {
        let mv = self.wires.supply_mv.get()?;
        self.has_measured_supply = !self.has_measured_supply;
        Some(if self.has_measured_supply { Converted::SupplyMv(mv) } else { Converted::ChipCelsius(Some(25)) })
    }
}

/// Runs the firmware from its start until a restart is requested.
pub(super) async fn run(wires: Rc<Wires>, flash: MemoryFlash, memory: Outliving) -> RebootTarget {
    match flash.chip() {
        Chip::Stm32l475 => run_on(Stm32l475(flash), Chip::Stm32l475, wires, memory).await,
        Chip::Rp2040 => run_on(Rp2040(flash), Chip::Rp2040, wires, memory).await,
    }
}

#[expect(clippy::await_holding_refcell_ref, reason = "one start at a time holds the meters, and ends with its future")]
async fn run_on(flash: impl NorFlash, chip: Chip, wires: Rc<Wires>, memory: Outliving) -> RebootTarget {
    let mut table = Box::<Table>::default();
    let mut room = Box::<NearestSearch>::default();
    let mut profile = Box::new(Profile::empty());
    let mut log = Box::<LogMemory>::default();
    let mut used = memory.used.borrow_mut();
    let shared = Shared::new();
    let pulses = [const { Pulse::new() }; Task::ALL.len()];
    let [console_pulse, bus_pulse] = &pulses;
    let console = async {
        let name = "in-process";
        let identity = Identity { device: DEVICE, board: name.parse().expect("a name that fits") };
        // A threshold of the supply needs a board that measures it.
        let of_caps = wires.supply_mv.get().map_or(name, |_| chip.pins().board);
        let caps = Caps::largest(of_caps, SLOT_BYTES as u32, BUILD);
        let mut dispatcher = Dispatcher::new(
            Board {
                identity,
                crash: None,
                caps,
                guards_loader: chip.guards_loader(),
                health: Health::default,
                kept: Some(&*memory.kept),
            },
            &wires.clock,
            &shared,
            &mut room,
            &mut log,
        );
        dispatcher.open(Some(flash), &mut table, &mut profile).await;
        serve(&mut dispatcher, &mut PipeReader(&wires.console_in), &mut PipeWriter(&wires.console_out)).await
    };
    let bus =
        async { Bus::new(PipeReader(&wires.bus_in), PipeWriter(&wires.bus_out), &wires.clock).run(&shared).await };
    let (console, bus) = (pin!(console), pin!(bus));
    let control = control(&wires, &shared, &mut used, &pulses);
    match select3(console_pulse.during(&&wires.clock, console), control, bus_pulse.at_each_poll(bus)).await {
        Either3::First(into) => into,
        Either3::Second(()) => RebootTarget::Application,
        Either3::Third(never) => never,
    }
}

/// The control task, as on the chip: once per millisecond, until a task is silent, which resets a board.
async fn control<'t>(
    wires: &Rc<Wires>,
    shared: &Shared<'t>,
    used: &'t mut DutyMeters,
    pulses: &[Pulse; Task::ALL.len()],
) {
    let mut ticker = Ticker::new(wires.clock.now(), BoardPins::new(wires), used, shared);
    let mut due = wires.clock.now();
    loop {
        due = due + TICK;
        wires.clock.wait_until(due).await;
        // Ticks that were missed meanwhile are left out, as the timers of the boards do.
        while due + TICK <= wires.clock.now() {
            due = due + TICK;
        }
        let (_, care) = ticker.step(wires.clock.now(), due, shared, pulses);
        if matches!(care, WatchdogAction::End(_)) {
            return;
        }
    }
}
