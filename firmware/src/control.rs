//! The control tick and what it shares with the slower tasks.
//!
//! ```text
//!   dispatcher (console) ──order──► ┌──────────────┐ ──lines──► solenoid chain
//!                  ◄─outcome─ │ Control::tick │ ◄─switches
//!                  ◄─events── └──────────────┘
//!                               │ joints  ▲ seen
//!                               ▼         │
//!                             servo bus task
//! ```
//!
//! The tick waits for nobody: orders are fetched when they are there, at most one a tick, and everything that is
//! handed over is small or a reference. A table changes hands as `&mut`, so it is never copied and never shared.
//!
//! A stop goes past all orders: it is a counter that the tick looks at first. A command says how many stops there were
//! when it was requested, and is refused when there has been another since.
mod button;
mod order;

use core::cell::Cell;
use core::sync::atomic::{AtomicBool, AtomicI16, AtomicU16, AtomicU32, Ordering};

pub use darm_core::duty::TICK;
use darm_core::duty::{DutyMeters, MeterLimit};
use darm_core::output::{MAX_SERVOS, ServoWiring};
use darm_core::sequencer::{
    Command, CommandError, EnableLevel, Event, FarEnd, Outputs, Seen, Sequencer, ServoAction, ServoBreach, ServoSeen,
};
use darm_core::table::Table;
use darm_core::units::Micros;
use darm_core::wire::bootstrap::Servos;
use darm_core::wire::message::OutputState;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;

use crate::inputs::InputLog;
use crate::ring::Ring;
use button::Button;
use order::{Order, Outcome};
pub use order::{Snapshot, Summary};

/// What the converter of a board gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Converted {
    /// Supply of the board, mV; 0 where it gave nothing.
    SupplyMv(u16),
    /// Temperature of the chip.
    ChipCelsius(Option<i16>),
}

/// Events that wait for the dispatcher, as many as a second of rows each 20 ms makes; beyond that the newest are lost, and their
/// numbers show it.
const WAITING_EVENTS: usize = 56;

/// An event with its number since the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbered {
    /// Counts all events; a gap means that events were lost.
    pub number: u32,
    /// When it happened.
    pub at: Micros,
    /// What happened.
    pub event: Event,
}

/// What one servo of the profile is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Its limits; angles are those of its shaft.
    pub limit: ServoWiring,
    /// What it is to do.
    pub action: ServoAction,
}

/// All servos of the profile.
pub type Joints = [Option<Joint>; MAX_SERVOS];

/// What the pins say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inputs {
    /// Bit `i` is input `i`, high when closed.
    pub switches: u32,
    /// The contact of the board's button is closed.
    pub button: bool,
    /// The output chain does not return what was shifted into it.
    pub chain_broken: bool,
    /// The level at which output enable stays although the board drives the other one.
    pub enable_stuck: Option<EnableLevel>,
    /// What the far end of the output chain shows.
    pub far_end: FarEnd,
    /// Supply of the board where a measurement has ended since the tick before, mV; 0 where it gave nothing.
    pub supply_mv: Option<u16>,
}

/// No temperature is known.
const NO_CELSIUS: i16 = i16::MIN;

type Raw = CriticalSectionRawMutex;

/// What the tasks share.
pub struct Shared<'t> {
    orders: Ring<Order<'t>, 1>,
    outcomes: Ring<Outcome<'t>, 1>,
    /// What happened, for the dispatcher.
    pub events: Ring<Numbered, WAITING_EVENTS>,
    /// When the inputs changed.
    pub(crate) inputs: InputLog,
    seen: Mutex<Raw, Cell<[ServoSeen; MAX_SERVOS]>>,
    breaches: Mutex<Raw, Cell<[Option<ServoBreach>; MAX_SERVOS]>>,
    joints: Mutex<Raw, Cell<Joints>>,
    /// Stops that were requested, and those that have been done.
    stops: AtomicU32,
    stops_done: AtomicU32,
    /// The emergency stop was pressed: what has been received and not yet done is dropped, as behind any stop.
    pub(crate) pressed: Signal<Raw, ()>,
    /// There may be servos that no profile knows.
    has_lost_servos: AtomicBool,
    /// Visits of servos that got no answer.
    servos_unanswered: AtomicU32,
    /// Times that the output chain returned something else than was shifted into it.
    chain_errors: AtomicU32,
    /// Supply of the board, mV, 0 where it is not measured; temperature of the chip.
    supply_mv: AtomicU16,
    chip_celsius: AtomicI16,
}

impl<'t> Shared<'t> {
    /// Nothing asked, nothing seen.
    pub const fn new() -> Self {
        const UNSEEN: ServoSeen = ServoSeen { angle_rad: 0.0, load: 0.0, error: 0, answered: None };
        Self {
            orders: Ring::new(),
            outcomes: Ring::new(),
            events: Ring::new(),
            inputs: InputLog::new(),
            seen: Mutex::new(Cell::new([UNSEEN; MAX_SERVOS])),
            breaches: Mutex::new(Cell::new([None; MAX_SERVOS])),
            joints: Mutex::new(Cell::new([None; MAX_SERVOS])),
            stops: AtomicU32::new(0),
            stops_done: AtomicU32::new(0),
            pressed: Signal::new(),
            has_lost_servos: AtomicBool::new(false),
            servos_unanswered: AtomicU32::new(0),
            chain_errors: AtomicU32::new(0),
            supply_mv: AtomicU16::new(0),
            chip_celsius: AtomicI16::new(NO_CELSIUS),
        }
    }

    /// What the servo bus is to do.
    pub fn joints(&self) -> Joints {
        self.joints.lock(Cell::get)
    }

    /// Instructs the servo bus.
    pub fn set_joints(&self, joints: Joints) {
        self.joints.lock(|cell| cell.set(joints));
    }

    /// What a servo answered last.
    pub fn servo_seen(&self, index: usize) -> ServoSeen {
        self.seen.lock(|seen| seen.as_array_of_cells().get(index).map(Cell::get)).unwrap_or_default()
    }

    /// Takes in what a servo answered.
    pub fn see_servo(&self, index: usize, answer: ServoSeen) {
        self.seen.lock(|seen| seen.as_array_of_cells().get(index).map(|seen| seen.set(answer)));
    }

    /// Takes in what a servo does that its profile does not allow, until this says otherwise.
    pub fn set_servo_breach(&self, index: usize, breach: Option<ServoBreach>) {
        self.breaches.lock(|breaches| breaches.as_array_of_cells().get(index).map(|slot| slot.set(breach)));
    }

    /// What each servo does that its profile does not allow.
    pub fn servo_breaches(&self) -> [Option<ServoBreach>; MAX_SERVOS] {
        self.breaches.lock(Cell::get)
    }

    /// Visits of servos that got no answer, since the start.
    pub fn servos_unanswered(&self) -> u32 {
        self.servos_unanswered.load(Ordering::Relaxed)
    }

    /// A servo did not answer. From the servo bus only.
    pub fn note_unanswered(&self) {
        self.servos_unanswered.store(self.servos_unanswered().saturating_add(1), Ordering::Relaxed);
    }

    /// Times that the output chain returned something else than was shifted into it, since the start.
    pub fn chain_errors(&self) -> u32 {
        self.chain_errors.load(Ordering::Relaxed)
    }

    /// Sets that number. From the control tick only.
    pub fn set_chain_errors(&self, errors: u32) {
        self.chain_errors.store(errors, Ordering::Relaxed);
    }

    /// Supply of the board, mV, where it is measured.
    pub fn supply_mv(&self) -> Option<u16> {
        Some(self.supply_mv.load(Ordering::Relaxed)).filter(|mv| *mv > 0)
    }

    /// Temperature of the chip, °C, where it is measured.
    pub fn chip_celsius(&self) -> Option<i16> {
        Some(self.chip_celsius.load(Ordering::Relaxed)).filter(|celsius| *celsius != NO_CELSIUS)
    }

    /// Takes in what the converter gave. From the control tick only.
    pub(crate) fn see_converted(&self, converted: Converted) {
        match converted {
            Converted::SupplyMv(mv) => self.supply_mv.store(mv, Ordering::Relaxed),
            Converted::ChipCelsius(celsius) => {
                self.chip_celsius.store(celsius.unwrap_or(NO_CELSIUS), Ordering::Relaxed)
            }
        }
    }

    /// Number of requested stops.
    pub fn stops(&self) -> u32 {
        self.stops.load(Ordering::Acquire)
    }

    /// Refuses what was requested when there were this many stops, if there has been another since.
    pub(crate) fn check_stops(&self, then: u32) -> Result<(), CommandError> {
        if self.stops() == then { Ok(()) } else { Err(CommandError::Stopped) }
    }

    /// All coils off and servos held with the next tick, before any order; connections that are open end.
    pub fn stop(&self) {
        // Not every core adds in one step, and tasks of two priorities may stop.
        critical_section::with(|_| self.stops.store(self.stops().wrapping_add(1), Ordering::Release));
    }

    /// What a stop does with the servos of the profile.
    pub(crate) fn servos(&self) -> Servos {
        if self.joints().iter().any(Option::is_some) {
            Servos::Ordered
        } else if self.has_lost_servos.load(Ordering::Relaxed) {
            // They may still be on the way to what a profile that is lost let them be sent to.
            Servos::Uncontrolled
        } else {
            Servos::Absent
        }
    }

    /// No profile says which servos there are, though there was one.
    pub(crate) fn lose_servos(&self) {
        self.has_lost_servos.store(true, Ordering::Relaxed);
    }

    /// Whether all requested stops have been done.
    pub fn has_stopped(&self) -> bool {
        self.stops_done.load(Ordering::Acquire) == self.stops()
    }
}

impl Default for Shared<'_> {
    fn default() -> Self {
        Self::new()
    }
}

/// The control tick's own state.
pub struct Control<'t> {
    sequencer: Sequencer<'t>,
    joints: Joints,
    /// The limits of `joints` are those of the profile in force.
    has_limits: bool,
    seen: Seen,
    button: Button,
    now: Micros,
    worst_lateness: Micros,
    next_event: u32,
    /// An order may wait since the last tick.
    waited: bool,
    /// An order was obeyed in the last tick.
    has_obeyed: bool,
}

impl<'t> Control<'t> {
    /// Idle, without a table. `used` is what memory has kept of how long each output was on. `Booted` is the first event.
    pub fn new(now: Micros, shared: &Shared<'t>, used: &'t mut DutyMeters) -> Self {
        let mut control = Self {
            sequencer: Sequencer::new(used),
            joints: [None; MAX_SERVOS],
            has_limits: false,
            seen: Seen::default(),
            button: Button::new(now),
            now,
            worst_lateness: Micros(0),
            next_event: 0,
            waited: false,
            has_obeyed: false,
        };
        control.report(now, Event::Booted, shared);
        control
    }

    /// One tick: looks, decides, and returns what the outputs are until the next tick. Obeys at most one order, which
    /// shows in the outputs of the next tick.
    ///
    /// `due` is when the tick should have started.
    pub fn tick(&mut self, now: Micros, due: Micros, inputs: Inputs, shared: &Shared<'t>) -> Outputs {
        self.worst_lateness = self.worst_lateness.max(now - due);
        if inputs.switches != self.seen.switches {
            shared.inputs.push(now, inputs.switches);
        }
        let emergency_stop = self.sequencer.profile().emergency_stop;
        let is_pressed = |switches: u32| emergency_stop.is_some_and(|stop| stop.is_pressed(switches));
        let [was_pressed, is_pressed] = [self.seen.switches, inputs.switches].map(is_pressed);
        self.seen.switches = inputs.switches;
        self.seen.chain_broken = inputs.chain_broken;
        (self.seen.enable_stuck, self.seen.far_end) = (inputs.enable_stuck, inputs.far_end);
        self.seen.supply_mv = inputs.supply_mv;
        self.button.look(now, inputs.button);
        self.now = now;
        let stops = shared.stops();
        if stops != shared.stops_done.load(Ordering::Relaxed) {
            // Stop is never refused.
            let _ = self.sequencer.command(Command::Stop);
        }
        shared.seen.lock(|seen| self.seen.servos = seen.get());
        self.seen.servo_breaches = shared.servo_breaches();
        let outputs = self.sequencer.step(now, &self.seen);
        let events_before = self.next_event;
        while let Some((at, event)) = self.sequencer.next_event() {
            self.report(at, event, shared);
        }
        self.aim(&outputs, shared);
        shared.stops_done.store(stops, Ordering::Release);
        if is_pressed && !was_pressed {
            // It has latched the safe state; what was requested before it must not act once it is released.
            shared.stop();
        }
        if is_pressed != was_pressed {
            // Nor what has waited since: `clear` would be refused as long as it is pressed.
            shared.pressed.signal(());
        }
        // A tick that switched coils has done enough; the order waits for the next one, and never longer.
        self.waited = self.next_event != events_before && !self.waited;
        self.has_obeyed = !self.waited && self.sequencer.is_ready() && self.poll_request(shared);
        outputs
    }

    /// Whether the last tick obeyed an order.
    pub fn has_obeyed(&self) -> bool {
        self.has_obeyed
    }

    /// Obeys the order that waits, if there is one; whether there was.
    fn poll_request(&mut self, shared: &Shared<'t>) -> bool {
        let Some(order) = shared.orders.take() else { return false };
        // The dispatcher has fetched the last outcome before it asked again, so there is room.
        let _ = shared.outcomes.put(self.execute(order, shared));
        true
    }

    fn output_state(&self, number: u8) -> Option<OutputState> {
        let of_profile = self.sequencer.profile().output(number)?.limit;
        // A table can only be tighter, and is what latches.
        let wired = self.sequencer.table().and_then(|table| table.wiring().coil(number));
        let limit = wired.map_or(of_profile, |coil| coil.limit);
        let meter = self.sequencer.used().meters.get(usize::from(number))?;
        let counted = MeterLimit::of(&limit);
        let [left_ms, recovery_ms] = [meter.left_us(&counted), meter.recovery_us(&counted)].map(|us| us / 1000);
        Some(OutputState { output: number, limit, left_ms, recovery_ms })
    }

    fn snapshot(&self) -> Snapshot {
        let table = self.sequencer.table();
        Snapshot {
            phase: self.sequencer.phase(),
            word: self.sequencer.word(),
            rows: table.map_or(0, |table| table.rows().len() as u16),
            model: table.map(Table::model),
            switches: self.seen.switches,
            n_servos: table.map_or(0, |table| table.wiring().servos.len() as u8),
            button: self.button.is_pressed(self.now),
            is_moving: self.sequencer.has_moving_servo(&self.seen),
            is_stopping: self.sequencer.has_stopping_servo(&self.seen),
            worst_lateness: self.worst_lateness,
        }
    }

    fn report(&mut self, at: Micros, event: Event, shared: &Shared<'t>) {
        let number = self.next_event;
        self.next_event = number.wrapping_add(1);
        // When the dispatcher is too slow the event is lost, and the gap in the numbers shows it.
        let _ = shared.events.put(Numbered { number, at, event });
    }

    fn aim(&mut self, outputs: &Outputs, shared: &Shared<'t>) {
        // As a rule nothing is new: limits change with the profile alone, and are not compared in every tick.
        let is_known =
            |(joint, action): (&Option<Joint>, &ServoAction)| joint.is_none_or(|joint| joint.action == *action);
        if self.has_limits && self.joints.iter().zip(&outputs.servos).all(is_known) {
            return;
        }
        self.has_limits = true;
        self.joints = [None; MAX_SERVOS];
        let servos = self.sequencer.profile().servos.iter().zip(outputs.servos);
        for (joint, (servo, action)) in self.joints.iter_mut().zip(servos) {
            *joint = Some(Joint { limit: servo.limit, action });
        }
        shared.set_joints(self.joints);
    }
}
