//! One look at the board: asks it, and makes of its answers what pages show.

use std::sync::Arc;
use std::time::{Duration, Instant};

use darm_core::output::{ActuatorWiring, CoilLimit, Wiring};
use darm_core::sequencer::ServoSeen;
use darm_core::units::{Digest, Micros, Word};
use darm_core::wire::health::Health;
use darm_core::wire::message::{Hello, OutputState, Status};
use darm_device::client::{Client, ClientError};

use super::supply::Supply;
use crate::history::Seen;
use crate::hub::Hub;
use crate::picture::{Picture, Posture};
use crate::program::drive_name;
use crate::unix_time;
use crate::view::{ActuatorView, BoardView, EventView, OutputView, PhaseView, QualityView, ServoView, SwitchView};

/// Interval at which on-times, four answers of the largest board, and supply are requested.
const OUTPUTS_PERIOD: Duration = Duration::from_millis(500);
/// Events from before the connection that are fetched.
const EARLIER_EVENTS: u32 = 20;
/// Events that wait for the history, at most.
const MAX_UNKEPT: usize = 1000;
/// Requests for events in one look.
const EVENT_REQUESTS: usize = 8;
/// A servo that turns less changes no picture, rad.
const SMALLEST_TURN_RAD: f64 = 2e-4;

/// After the end of a stroke the arm still swings.
const SETTLING_S: f64 = 0.05;

/// What was seen at earlier looks.
pub(super) struct Observer {
    hub: Arc<Hub>,
    next_event: u32,
    /// The first event that is certain to be of the table that the board has; `None` before the first look.
    table_from: Option<u32>,
    /// Events that the history has not taken yet.
    unkept: Vec<EventView>,
    outputs: Vec<OutputState>,
    health: Option<Health>,
    outputs_due: Instant,
    /// When the board said so of its outputs, s of the link's time.
    outputs_s: f64,
    supply: Supply,
    word: Word,
    previous: Word,
    /// Since when each coil is on, s of the link's time: bit of the wiring.
    on_since_s: Vec<Option<f64>>,
    /// When each actuator changed last, s of the link's time.
    changed_s: Vec<f64>,
    shown: Option<Posture>,
}

impl Observer {
    pub(super) fn new(hub: Arc<Hub>, client: &Client) -> Self {
        let hello = client.hello();
        hub.forget_events();
        let next_event = hello.map_or(0, |hello| first_wanted(&hub, client, hello));
        Self {
            hub,
            next_event,
            table_from: None,
            unkept: Vec::new(),
            outputs: Vec::new(),
            health: None,
            outputs_due: Instant::now(),
            outputs_s: 0.0,
            supply: Supply::of_start(client.now_s() - 1e-6 * client.answered_at().0 as f64),
            word: Word::default(),
            previous: Word::default(),
            on_since_s: Vec::new(),
            changed_s: Vec::new(),
            shown: None,
        }
    }

    /// Asks the board and shows what it answers.
    pub(super) fn look(&mut self, client: &mut Client) -> Result<(), ClientError> {
        let asked_s = client.now_s();
        let status = client.status()?;
        let now_s = client.now_s();
        let events = self.new_events(client)?;
        if Instant::now() >= self.outputs_due {
            self.outputs = client.outputs()?;
            self.outputs_s = client.now_s();
            self.health = client.health()?;
            // A program may have brought another table over this port.
            client.renew_hello()?;
            self.outputs_due = Instant::now() + OUTPUTS_PERIOD;
        }
        let hub = Arc::clone(&self.hub);
        let wiring = hub.wired().map(|wired| &wired.wiring);
        self.follow_word(&status, wiring, now_s);
        self.show_picture(&status);
        let board = self.board(client, &status, now_s, now_s - asked_s);
        self.keep_events(&board, &status, board_now_s(client, now_s), &events);
        hub.set_board(board, events);
        Ok(())
    }

    fn new_events(&mut self, client: &mut Client) -> Result<Vec<EventView>, ClientError> {
        let mut events = Vec::new();
        for _ in 0..EVENT_REQUESTS {
            let new = client.events(self.next_event)?;
            let Some(last) = new.last() else { break };
            self.next_event = last.number.wrapping_add(1);
            events.extend(new.iter().map(|timed| EventView::of(timed.number, timed.at, &timed.event)));
        }
        Ok(events)
    }

    /// Keeps new events in the history before any page sees them; where that fails they wait for the next look.
    fn keep_events(&mut self, board: &BoardView, status: &Status, board_now_s: f64, events: &[EventView]) {
        let is_first = self.table_from.is_none();
        let table_from = *self.table_from.get_or_insert_with(|| first_of_table(events, self.next_event));
        let Some(history) = self.hub.history() else { return };
        let runs = table_from < self.next_event || matches!(board.phase.name, "approaching" | "playing");
        self.unkept.extend_from_slice(events);
        if self.unkept.is_empty() && !is_first {
            return;
        }
        let model = status.model.map(|model| model.to_string());
        let seen = Seen {
            board: &board.name,
            device: &board.device,
            boots: board.boots,
            table: board.table.as_deref(),
            table_from,
            is_idle: is_first && !runs,
            model: model.as_deref(),
            profile: board.profile.as_deref(),
            board_now_s,
            now_ms: unix_time::now_ms(),
            events: &self.unkept,
        };
        match history.see(&seen) {
            Ok(()) => self.unkept.clear(),
            // The page of the history says why; the oldest are given up first.
            Err(_) => drop(self.unkept.drain(..self.unkept.len().saturating_sub(MAX_UNKEPT))),
        }
    }

    /// Notes when coils and actuators changed.
    fn follow_word(&mut self, status: &Status, wiring: Option<&Wiring>, now_s: f64) {
        let Some(wiring) = wiring else { return };
        let coils_on = wiring.coils_on(&status.word);
        self.supply.see(now_s, wiring, coils_on);
        self.on_since_s.resize(wiring.coils.len(), None);
        for (index, since_s) in self.on_since_s.iter_mut().enumerate() {
            let is_on = coils_on >> index & 1 == 1;
            *since_s = is_on.then(|| since_s.unwrap_or(now_s));
        }
        self.changed_s.resize(wiring.actuators.len(), f64::NEG_INFINITY);
        let differing = status.word.differing(&self.word);
        let changed = self.changed_s.iter_mut().enumerate().filter(|(index, _)| differing >> index & 1 == 1);
        changed.for_each(|(_, changed_s)| *changed_s = now_s);
        if differing != 0 || self.word.len() != status.word.len() {
            (self.previous, self.word) = (self.word, status.word);
        }
    }

    /// Draws the arm again where its posture has changed.
    fn show_picture(&mut self, status: &Status) {
        let Some(wired) = self.hub.wired() else { return };
        let is_word = status.word.len() == wired.arm.n_actuators();
        let word = if is_word { status.word } else { wired.arm.rest() };
        let previous = if self.previous.len() == word.len() { self.previous } else { word };
        let angle = |servo: usize| status.servos.get(servo).map_or(0.0, |seen| f64::from(seen.angle_rad));
        let posture = Posture { word, previous, servos_rad: (0..wired.arm.n_servos()).map(angle).collect() };
        if self.shown.as_ref().is_some_and(|shown| is_same(shown, &posture)) {
            return;
        }
        let travel_ms = wired.wiring.actuators.iter().map(|actuator| actuator.travel_ms).max().unwrap_or(0);
        self.hub.set_picture(Picture::of(&wired.arm, &posture), 1e-3 * f64::from(travel_ms) + SETTLING_S);
        self.shown = Some(posture);
    }

    /// What the board reports of itself in mV, in V.
    fn volts(&self, of: fn(&Health) -> Option<u16>) -> Option<f64> {
        self.health.as_ref().and_then(of).map(|mv| 1e-3 * f64::from(mv))
    }

    fn board(&mut self, client: &Client, status: &Status, now_s: f64, round_trip_s: f64) -> BoardView {
        let (hello, counts) = (client.hello(), client.counts());
        let [major, minor, patch] = client.version().firmware;
        let arm = self.hub.wired().map(|wired| wired.arm.hash());
        let profile = hello.map(|hello| hello.profile).filter(|profile| *profile != Digest::default());
        let hub = Arc::clone(&self.hub);
        let wiring = hub.wired().map(|wired| &wired.wiring);
        let table = hello.and_then(|hello| hello.table);
        // The limit of another profile is not known here.
        let has_own_profile = hub.wired().is_some_and(|wired| profile == Some(wired.profile.profile.digest));
        let supply = wiring.filter(|_| has_own_profile).map(|wiring| self.supply.view(now_s, &wiring.switch_limit));
        let wait_s = supply.map_or(0.0, |supply| supply.wait_s);
        let board_now = board_now_s(client, now_s);
        BoardView {
            name: client.identity().board.to_string(),
            device: client.identity().device.to_string(),
            firmware: format!("{major}.{minor}.{patch}"),
            boots: hello.map_or(0, |hello| hello.boots),
            table: table.map(|table| table.to_string()),
            profile: profile.map(|profile| profile.to_string()),
            // The built-in profile has outputs.
            is_profile_lost: profile.is_none() && self.outputs.is_empty(),
            supply,
            has_other_model: table.is_some() && arm.zip(status.model).is_some_and(|(arm, board)| arm != board),
            rows: status.rows,
            phase: PhaseView::of(&status.phase, Micros((1e6 * board_now.max(0.0)) as u64)),
            word: status.word.to_string(),
            actuators: wiring.map_or_else(Vec::new, |wiring| self.actuators(wiring, status, now_s)),
            outputs: self.outputs.iter().map(|output| self.output(output, wiring, now_s, wait_s)).collect(),
            servos: status.servos.iter().map(servo).collect(),
            quality: QualityView {
                round_trip_s,
                sent: counts.sent,
                again: counts.again,
                damaged: counts.damaged,
                bad_frames: status.bad_frames,
                worst_lateness_s: 1e-6 * f64::from(status.worst_lateness_us),
                supply_v: self.volts(|health| health.supply_mv),
                min_supply_v: self.volts(|health| health.min_supply_mv),
            },
        }
    }

    fn actuators(&self, wiring: &Wiring, status: &Status, now_s: f64) -> Vec<ActuatorView> {
        let actuators = wiring.actuators.iter().enumerate().zip(&self.changed_s);
        let view = |((index, actuator), changed_s): ((usize, &ActuatorWiring), &f64)| {
            let is_moving = now_s < changed_s + 1e-3 * f64::from(actuator.travel_ms);
            actuator_view(actuator, status.word.digit(index), status.switches, is_moving)
        };
        actuators.map(view).collect()
    }

    fn output(&self, state: &OutputState, wiring: Option<&Wiring>, now_s: f64, wait_s: f64) -> OutputView {
        let coil = wiring.and_then(|wiring| wiring.coils.iter().position(|coil| coil.output == state.output));
        let seconds = |ms: u32| 1e-3 * f64::from(ms);
        let since_s = coil.and_then(|coil| self.on_since_s.get(coil).copied().flatten());
        let on_s = since_s.map(|since_s| now_s - since_s);
        // The board was asked a moment ago, and has been on since then.
        let unseen_s = on_s.map_or(0.0, |on_s| on_s.min(now_s - self.outputs_s));
        OutputView {
            output: state.output,
            actuator: wiring.zip(coil).and_then(|(wiring, coil)| owner(wiring, coil)),
            drive: wiring
                .zip(coil)
                .and_then(|(wiring, coil)| wiring.coils.get(coil))
                .map(|coil| drive_name(&coil.drive)),
            is_on: coil.map(|_| since_s.is_some()),
            on_s,
            left_s: left_s(seconds(state.left_ms) - unseen_s, seconds(state.limit.max_on_ms), on_s),
            wait_s: if on_s.is_some() { 0.0 } else { wait_s },
            allowed_s: allowed_s(&state.limit),
            recovery_s: seconds(state.recovery_ms),
            limit: state.limit.into(),
        }
    }
}

/// How long an output may still be on, s: what is left of its window, or of its pulse, whichever ends first.
fn left_s(in_window_s: f64, max_on_s: f64, on_s: Option<f64>) -> f64 {
    in_window_s.min(max_on_s - on_s.unwrap_or(0.0)).max(0.0)
}

/// How long an output may be on at most, when all of its window is free.
fn allowed_s(limit: &CoilLimit) -> f64 {
    let [max_on_s, window_s] = [limit.max_on_ms, limit.window_ms].map(|ms| 1e-3 * f64::from(ms));
    max_on_s.min(0.01 * f64::from(limit.duty_percent) * window_s)
}

/// Of what was seen at the first look, the first event of the table that the board has now: the beginning of the program that
/// runs. A program that has ended may have been of another table.
fn first_of_table(seen: &[EventView], next_event: u32) -> u32 {
    let change = seen.iter().rev().find(|event| ["started", "finished", "stopped", "fault"].contains(&event.kind));
    change.filter(|event| event.kind == "started").map_or(next_event, |event| event.number)
}

/// The first event to fetch: some from before the connection, and all that the history does not have.
fn first_wanted(hub: &Hub, client: &Client, hello: &Hello) -> u32 {
    let earlier = hello.next_event.saturating_sub(EARLIER_EVENTS);
    let device = client.identity().device.to_string();
    let known = hub.history().and_then(|history| history.last_event(&device, hello.boots).ok().flatten());
    known.map_or(earlier, |known| earlier.min(known))
}

/// Time of the board's clock, s.
fn board_now_s(client: &Client, now_s: f64) -> f64 {
    client.clock().offset().map_or(0.0, |offset| now_s - offset.at_s)
}

/// An actuator at a digit; `switches` are the bits of the limit switches as seen.
fn actuator_view(actuator: &ActuatorWiring, digit: u8, switches: u32, is_moving: bool) -> ActuatorView {
    let switch = actuator.switch.map(|switch| SwitchView {
        input: switch.input,
        expected: switch.closed(digit),
        seen: switches.checked_shr(switch.input.into()).unwrap_or(0) & 1 == 1,
        is_moving,
    });
    ActuatorView { digit, switch }
}

/// The actuator that a coil of the wiring belongs to.
fn owner(wiring: &Wiring, coil: usize) -> Option<usize> {
    (0..wiring.actuators.len()).rev().find(|actuator| wiring.first_coil(*actuator) <= coil)
}

fn is_same(shown: &Posture, posture: &Posture) -> bool {
    let turns = shown.servos_rad.iter().zip(&posture.servos_rad);
    shown.word == posture.word && turns.into_iter().all(|(from, to)| (from - to).abs() < SMALLEST_TURN_RAD)
}

fn servo(seen: &ServoSeen) -> ServoView {
    ServoView {
        angle_rad: seen.angle_rad,
        load: seen.load,
        error_bits: seen.error,
        has_answered: seen.answered.is_some(),
    }
}

#[cfg(test)]
mod tests {
    use super::{allowed_s, left_s};
    use darm_core::output::CoilLimit;

    /// A latch of 8 s on, 50 % of 1200 s: the page promised 600 s until the board latched the safe state after 8 s.
    #[test]
    fn an_output_may_be_on_for_what_is_left_of_its_pulse_or_of_its_window() {
        let limit = CoilLimit { max_on_ms: 8_000, duty_percent: 50, window_ms: 1_200_000 };
        assert_eq!(allowed_s(&limit), 8.0);
        assert_eq!(left_s(600.0, 8.0, None), 8.0);
        assert_eq!(left_s(600.0, 8.0, Some(7.5)), 0.5);
        assert_eq!(left_s(600.0, 8.0, Some(9.0)), 0.0);
        assert_eq!(left_s(2.0, 8.0, Some(1.0)), 2.0);
    }
}
