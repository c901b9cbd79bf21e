//! Runs a table: a pure state machine that looks, decides and says what the outputs are to be. It owns every limit.
//!
//! ```text
//!            play         servos and latches are there      end, stop
//!   Idle ───────────► Approaching ───────────► Playing ───────────► Idle
//!    │  ▲ stop             │                      │
//!    ▼  │                  │ a limit breaks,      │
//!   Manual ────────────────┴── a switch or servo ─┴──► Safe ──clear──► Idle
//!                              contradicts
//! ```
//!
//! `Safe` is latched: all coils without current, servos as their fallback says, until somebody clears it. A stop leaves
//! no coil with current and lets every servo hold the angle that it has. No servo moves unasked: not when a table or a
//! calibration is loaded, and not before it has answered.
//! [`Sequencer::step`] is called once a millisecond with what the board sees and returns what the board drives.
#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::arithmetic_side_effects, clippy::unwrap_used))]

mod bits;
mod coils;
mod command;
mod fault;
mod io;
mod loading;
mod phase;
mod servos;
mod switches;

use crate::duty::DutyMeters;
use crate::output::MAX_SERVOS;
use crate::profile::{BUILT_IN, Profile};
use crate::table::{Row, Table};
use crate::units::{Micros, Word};
use coils::Coils;
pub use command::{Command, CommandError};
pub use fault::{Fault, FaultKind};
pub use io::{EnableLevel, FarEnd, Outputs, Seen, ServoAction, ServoBreach, ServoSeen, ServoTarget};
pub use phase::{Event, Phase};
use servos::{APPROACH_SPEED, APPROACH_TOLERANCE_RAD, Servo, check_servo, is_silent};
use switches::Switches;

/// Outputs or actuators that one tick takes over.
const TAKEN_A_TICK: usize = 12;
/// A tick that comes later than this after the one before says nothing of the time between: while the flash is erased no tick and no
/// task runs, 45 to 400 ms on the Pico.
pub const LATE: Micros = Micros::from_millis(2);
/// What measurements of the supply below the threshold add up to before that is a fault, what each of them adds, and one that is not
/// low takes off. With one each 10 ms a dip of 40 ms, such as that of a motor that starts, passes once in 0.84 s; a supply that
/// collapses again and again, as one does that switches itself off at overload, does not.
const MAX_LOW_SUPPLY: u8 = 100;
const LOW_SUPPLY: u8 = 20;
/// The approach may take this time.
const APPROACH_TIMEOUT: Micros = Micros::from_millis(30_000);

/// The state machine. It borrows the table, so that the board can hand it over without copying it.
#[derive(Debug)]
pub struct Sequencer<'t> {
    profile: &'t Profile,
    table: Option<&'t mut Table>,
    /// Actuators of the table, from the base, that are wired up.
    n_wired: usize,
    phase: Phase,
    coils: Coils<'t>,
    switches: Switches,
    /// Outputs were requested since the start, or since the last fault.
    is_armed: bool,
    servos: [Servo; MAX_SERVOS],
    /// When servos on their way were to hold last; `None` where that order leaves with the next tick.
    hold_since: Option<Micros>,
    emergency_stop: bool,
    /// The supply that was measured last, mV, and in how many measurements in a row it was below the threshold.
    supply_mv: u16,
    low_supply: u8,
    /// A row began in this tick.
    has_begun_row: bool,
    now: Micros,
    events: heapless::Deque<(Micros, Event), 8>,
}

impl<'t> Sequencer<'t> {
    /// Idle, without a table, under the profile that is built in. `used` says how long each output has been on, as far
    /// as memory has kept it.
    pub fn new(used: &'t mut DutyMeters) -> Self {
        let mut sequencer = Self {
            profile: &BUILT_IN,
            table: None,
            n_wired: 0,
            phase: Phase::Idle,
            coils: Coils::new(used),
            switches: Switches::default(),
            is_armed: false,
            servos: [Servo::default(); MAX_SERVOS],
            hold_since: Some(Micros(0)),
            emergency_stop: false,
            supply_mv: 0,
            low_supply: 0,
            has_begun_row: false,
            now: Micros(0),
            events: heapless::Deque::new(),
        };
        sequencer.servos_to_fallback();
        sequencer
    }

    /// Puts a profile in force, once after a start: nothing is driven before.
    pub fn configure(&mut self, profile: &'t Profile) {
        self.profile = profile;
        self.coils.configure(self.now, profile);
        // What an earlier run left on its way gets its order now, and not when the clock began.
        self.hold_since = None;
        self.servos_to_fallback();
    }

    /// True when nothing runs; the safe state counts, no coil carries current in it.
    pub fn is_idle(&self) -> bool {
        matches!(self.phase, Phase::Idle | Phase::Safe(_))
    }

    /// What it does now.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// The word that the coils hold now.
    pub fn word(&self) -> Word {
        self.coils.word()
    }

    /// How long each output has been on.
    pub fn used(&self) -> &DutyMeters {
        self.coils.used()
    }

    /// The profile in force.
    pub fn profile(&self) -> &'t Profile {
        self.profile
    }

    /// The loaded table.
    pub fn table(&self) -> Option<&Table> {
        self.table.as_deref()
    }

    /// The next thing that happened, in order.
    pub fn next_event(&mut self) -> Option<(Micros, Event)> {
        self.events.pop_front()
    }

    /// Looks at what the board sees, decides, and says what the outputs are until the next call.
    pub fn step(&mut self, now: Micros, seen: &Seen) -> Outputs {
        self.skip_missed_ticks(now - self.now);
        (self.now, self.has_begun_row) = (now, false);
        self.hold_since.get_or_insert(now);
        self.take_over(TAKEN_A_TICK);
        self.emergency_stop = self.profile.emergency_stop.is_some_and(|stop| stop.is_pressed(seen.switches));
        self.weigh_supply(seen);
        let is_safe = matches!(self.phase, Phase::Safe(_));
        match self.check_inputs(seen).and_then(|()| self.advance(seen)) {
            Err(kind) if !is_safe => self.enter_safe(kind),
            // In the safe state metering continues; further faults are ignored.
            Ok(()) | Err(_) => {}
        }
        let lines = if self.is_armed { self.coils.lines() } else { 0 };
        let sync = self.has_begun_row && self.profile.sync;
        Outputs { lines, enabled: lines != 0, sync, servos: self.servos.map(|servo| servo.action) }
    }

    /// Does what is asked or says why not. Outputs change with the next [`step`](Self::step).
    ///
    /// # Errors
    ///
    /// Why the command is refused: see [`CommandError`]. A stop is never refused.
    pub fn command(&mut self, command: Command) -> Result<(), CommandError> {
        if !matches!(command, Command::Stop | Command::Clear) {
            while !self.has_taken_over() {
                self.take_over(TAKEN_A_TICK);
            }
        }
        match command {
            Command::Stop => {
                self.stop();
                Ok(())
            }
            Command::Clear => self.clear(),
            Command::Play => self.play(),
            Command::Coil { .. } | Command::Word(_) | Command::Servo { .. } => self.run_by_hand(command),
        }
    }

    fn play(&mut self) -> Result<(), CommandError> {
        self.check_free()?;
        if self.table.as_deref().and_then(Table::end).is_none() {
            return Err(CommandError::NoTable);
        }
        self.check_servo_spans()?;
        self.check_servos_answer()?;
        self.all_off();
        self.coils.prepare();
        self.is_armed = true;
        self.phase = Phase::Approaching { since: self.now };
        Ok(())
    }

    fn stop(&mut self) {
        if matches!(self.phase, Phase::Safe(_)) {
            return;
        }
        if !matches!(self.phase, Phase::Idle) {
            self.note(Event::Stopped);
        }
        self.all_off();
        self.hold_servos();
    }

    fn clear(&mut self) -> Result<(), CommandError> {
        if self.emergency_stop {
            return Err(CommandError::EmergencyStop);
        }
        if matches!(self.phase, Phase::Safe(_)) {
            self.note(Event::Cleared);
            self.all_off();
        }
        Ok(())
    }

    /// All coils off, nothing runs. The servos continue as they are.
    fn all_off(&mut self) {
        self.coils.all_off();
        self.switches.expect_nothing();
        self.phase = Phase::Idle;
    }

    fn check_free(&self) -> Result<(), CommandError> {
        match self.phase {
            Phase::Safe(_) if self.emergency_stop => Err(CommandError::EmergencyStop),
            Phase::Safe(_) => Err(CommandError::Safe),
            Phase::Playing { .. } | Phase::Approaching { .. } => Err(CommandError::Playing),
            Phase::Idle | Phase::Manual => Ok(()),
        }
    }

    fn run_by_hand(&mut self, command: Command) -> Result<(), CommandError> {
        self.check_free()?;
        // Off drives nothing, but for a latch, which a pulse resets.
        let drives = match command {
            Command::Coil { coil, on_ms: 0 } => self.coils.is_latch(coil),
            _ => true,
        };
        if drives {
            self.check_servos_answer()?;
        }
        let wiring = self.table.as_deref().ok_or(CommandError::NoTable)?.wiring();
        match command {
            Command::Coil { coil, on_ms } => self.coils.pulse(self.now, coil, on_ms, wiring)?,
            Command::Word(word) => self.coils.want(self.now, word, wiring)?,
            Command::Servo { servo, angle_rad } => self.turn_servo(servo, angle_rad)?,
            Command::Play | Command::Stop | Command::Clear => {}
        }
        // Where nothing runs there is nothing to switch off, and nothing that a silent servo would have to stop.
        if drives || !self.is_idle() {
            self.is_armed = true;
            self.phase = Phase::Manual;
        }
        Ok(())
    }

    /// Everything that must hold before anything moves.
    fn check_inputs(&mut self, seen: &Seen) -> Result<(), FaultKind> {
        for (servo, seen) in self.servos.iter_mut().zip(&seen.servos) {
            servo.answered = servo.answered.max(seen.answered);
        }
        self.coils.pass(self.now)?;
        if self.emergency_stop {
            return Err(FaultKind::EmergencyStop);
        }
        if let Some(min_mv) = self.profile.min_supply_mv.filter(|_| self.low_supply >= MAX_LOW_SUPPLY) {
            return Err(FaultKind::Supply { mv: self.supply_mv, min_mv });
        }
        self.look_at_chain(seen)?;
        self.look_at_breaches(seen)?;
        let Some(table) = self.table.as_deref() else {
            return Ok(());
        };
        let wiring = table.wiring();
        self.switches.check(self.now, seen.switches, &self.coils.word(), wiring)?;
        let is_active = !matches!(self.phase, Phase::Idle | Phase::Safe(_));
        for (index, ((joint, servo), seen)) in self.joints().zip(&self.servos).zip(&seen.servos).enumerate() {
            let number = index as u8;
            if matches!(servo.action, ServoAction::Go(_)) {
                let angle_rad = seen.angle_rad - servo.offset_rad;
                check_servo(self.now, number, joint, &ServoSeen { angle_rad, answered: servo.answered, ..*seen })?;
            } else if is_active && is_silent(self.now, joint, servo.answered) {
                // A servo that holds may bear the arm: while anything is driven it has to answer, too.
                return Err(FaultKind::ServoSilent { servo: number });
            }
        }
        Ok(())
    }

    /// A supply that stays low latches the safe state again in the first tick after it was cleared.
    fn weigh_supply(&mut self, seen: &Seen) {
        let Some(mv) = seen.supply_mv else { return };
        self.supply_mv = mv;
        let is_low = self.profile.min_supply_mv.is_some_and(|min_mv| mv < min_mv);
        let changed =
            if is_low { self.low_supply.saturating_add(LOW_SUPPLY) } else { self.low_supply.saturating_sub(1) };
        self.low_supply = changed.min(MAX_LOW_SUPPLY);
    }

    /// What is between the board and the drivers.
    fn look_at_chain(&self, seen: &Seen) -> Result<(), FaultKind> {
        if seen.chain_broken {
            return Err(FaultKind::Chain);
        }
        match seen.enable_stuck {
            Some(EnableLevel::Low) => return Err(FaultKind::OutputEnable),
            Some(EnableLevel::High) => return Err(FaultKind::OutputEnableHigh),
            None => {}
        }
        let Some(expected) = self.profile.board.chips else { return Ok(()) };
        match seen.far_end {
            FarEnd::Chips(chips) if chips != expected => Err(FaultKind::FarEnd { expected, counted: chips }),
            FarEnd::Silent => Err(FaultKind::FarEnd { expected, counted: 0 }),
            // Nothing is switched before the far end has had its time.
            FarEnd::Trying if !self.is_idle() => Err(FaultKind::FarEnd { expected, counted: 0 }),
            FarEnd::Absent | FarEnd::Trying | FarEnd::Chips(_) => Ok(()),
        }
    }

    fn advance(&mut self, seen: &Seen) -> Result<(), FaultKind> {
        match self.phase {
            Phase::Idle | Phase::Safe(_) => Ok(()),
            Phase::Manual => self.release(),
            Phase::Approaching { since } => self.approach(since, seen),
            Phase::Playing { started, next } => self.run_row(started, next),
        }
    }

    fn release(&mut self) -> Result<(), FaultKind> {
        let actuators = self.coils.release(self.now)?;
        self.switches.travel(self.now, actuators);
        Ok(())
    }

    fn approach(&mut self, since: Micros, seen: &Seen) -> Result<(), FaultKind> {
        let Some(table) = self.table.as_deref() else {
            return Ok(());
        };
        let Some(first) = table.rows().first() else {
            return self.begin();
        };
        let can_begin = self.coils.set_latches(self.now, first.word)?;
        let away = first.servos.iter().zip(&seen.servos).zip(&self.servos).position(|((angle_rad, seen), servo)| {
            let off_rad = seen.angle_rad - servo.offset_rad - angle_rad;
            seen.answered.is_none() || off_rad.abs() > APPROACH_TOLERANCE_RAD
        });
        self.command_servos(0, APPROACH_SPEED);
        match away {
            None if can_begin => self.begin(),
            None => Ok(()),
            Some(servo) if self.now - since > APPROACH_TIMEOUT => Err(FaultKind::ServoStalled { servo: servo as u8 }),
            Some(_) => Ok(()),
        }
    }

    fn begin(&mut self) -> Result<(), FaultKind> {
        self.note(Event::Started);
        self.phase = Phase::Playing { started: self.now, next: 0 };
        self.switches.begin(self.now);
        self.run_row(self.now, 0)
    }

    /// At most one row a tick: rows that became due together still go out in their order.
    fn run_row(&mut self, started: Micros, next: u16) -> Result<(), FaultKind> {
        let Some(table) = self.table.as_deref() else {
            return Ok(());
        };
        let elapsed = self.now - started;
        if let Some(row) = table.rows().get(usize::from(next)) {
            if row.at <= elapsed {
                let Row { at, word, .. } = *row;
                let before = self.coils.word();
                self.coils.switch(self.now, started + at, word)?;
                self.switches.travel(self.now, word.differing(&before));
                self.command_servos(next, 1.0);
                self.has_begun_row = true;
                self.note(Event::Row { row: next, word });
                self.phase = Phase::Playing { started, next: next.saturating_add(1) };
            }
        } else if table.end().is_none_or(|end| end <= elapsed) {
            self.note(Event::Finished);
            self.all_off();
        }
        Ok(())
    }

    fn enter_safe(&mut self, kind: FaultKind) {
        let row = match self.phase {
            Phase::Playing { next, .. } => next.checked_sub(1),
            Phase::Idle | Phase::Manual | Phase::Approaching { .. } | Phase::Safe(_) => None,
        };
        let fault = Fault { at: self.now, row, kind };
        self.note(Event::Fault(fault));
        self.all_off();
        self.is_armed = false;
        self.servos_to_fallback();
        self.phase = Phase::Safe(fault);
    }

    /// The owner drains the events after every step, which makes at most three.
    fn note(&mut self, event: Event) {
        let _ = self.events.push_back((self.now, event));
    }
}

#[cfg(test)]
mod tests;
