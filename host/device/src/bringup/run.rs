//! The bring-up itself: one output at a time, short, with consent, each off after its time, and a stop at the end.

use darm_arm::image::UploadImage;
use darm_core::output::{ActuatorWiring, Drive};
use darm_core::sequencer::{Command, CommandError, FaultKind, Phase};
use darm_core::table::{Record, Row};
use darm_core::units::{Digest, Micros, ModelHash, Word};
use darm_core::wire::message::Refusal;

use super::finding::Finding;
use super::judge::judge;
use super::kind::Kind;
use super::operator::{Consent, Look, Operator, Step};
use super::stroke::{Sample, Sight, Span, Stroke, TICKS};
use super::subject::{Place, Subject};
use super::travel::{Travel, travels};
use crate::client::{Client, ClientError};

/// An output is on for at most this time.
const MAX_ON_MS: u32 = 2_000;
/// Added to twice the time of travel.
const SETTLE_MS: u32 = 50;
/// Between two attempts to switch an output that recovers, and two looks at the emergency stop.
const RETRY_S: f64 = 0.2;
/// A person presses the emergency stop, or releases it, within this time.
const PRESS_S: f64 = 20.0;

/// What a bring-up has found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Every stroke.
    pub strokes: Vec<Stroke>,
    /// What is wrong.
    pub findings: Vec<Finding>,
    /// Times of the strokes that did what they should.
    pub travels: Vec<Travel>,
    /// Outputs that were not switched.
    pub skipped: Vec<u8>,
    /// The emergency stop was pressed and seen.
    pub is_stop_checked: bool,
    /// The operator has not ended it early.
    pub is_complete: bool,
}

/// Why a bring-up ended early. Everything is off, as far as the board could be reached.
#[derive(Debug, thiserror::Error)]
pub enum BringupError {
    /// The board does not answer, or refuses.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// The board has latched its safe state, not for the emergency stop.
    #[error("the board is in its safe state: {0}; remove the cause, then run `darm stop --clear`")]
    Safe(FaultKind),
}

/// Why not all outputs were switched.
enum End {
    Quit,
    Error(BringupError),
}

impl<E: Into<BringupError>> From<E> for End {
    fn from(error: E) -> Self {
        Self::Error(error.into())
    }
}

/// Brings up these actuators of an arm. The board must hold the profile with this digest. Its table is replaced by one without
/// limit switches and rows.
///
/// # Errors
///
/// [`BringupError::Client`]: the board does not answer or refuses, for instance because a program runs.
/// [`BringupError::Safe`]: it has latched its safe state for another reason than its emergency stop.
pub fn run(
    client: &mut Client,
    subject: &Subject,
    profile: Digest,
    actuators: &[usize],
    operator: &mut dyn Operator,
) -> Result<Outcome, BringupError> {
    let mut bringup = Bringup { client, subject, operator, outcome: Outcome::default() };
    let end = bringup.all(profile, actuators);
    // Off, whatever has happened; after an interrupt the stop has gone out already.
    let stopped = bringup.client.stop_at_once();
    let mut outcome = bringup.outcome;
    match end {
        Ok(()) => outcome.is_complete = true,
        Err(End::Quit) => {}
        Err(End::Error(error)) => return Err(error),
    }
    stopped?;
    outcome.findings.extend(judge(subject, &outcome.strokes));
    outcome.travels = travels(subject, &outcome.strokes);
    Ok(outcome)
}

struct Bringup<'a> {
    client: &'a mut Client,
    subject: &'a Subject,
    operator: &'a mut dyn Operator,
    outcome: Outcome,
}

impl Bringup<'_> {
    fn all(&mut self, profile: Digest, actuators: &[usize]) -> Result<(), End> {
        self.check_phase()?;
        if let Some(kind) = self.released_stop()? {
            self.outcome.findings.push(Finding::new(kind, self.subject));
            return Ok(());
        }
        let image = table(self.subject, profile);
        self.client.upload(&image, &mut |_| {})?;
        self.check_emergency_stop()?;
        let places: Vec<Place> = self.subject.places().filter(|place| actuators.contains(&place.actuator)).collect();
        // What moved when the supply came on is at rest.
        let settle_ms = places.iter().map(|place| away_ms(self.subject, place)).max().unwrap_or(0);
        self.client.listen(1e-3 * f64::from(settle_ms))?;
        places.iter().try_for_each(|place| self.output(place))
    }

    /// The board may be in its safe state for its emergency stop only.
    fn check_phase(&mut self) -> Result<(), End> {
        match self.client.status()?.phase {
            Phase::Safe(fault) if fault.kind != FaultKind::EmergencyStop => Err(BringupError::Safe(fault.kind).into()),
            _ => Ok(()),
        }
    }

    /// What is wrong with the emergency stop if it is pressed all the time.
    fn released_stop(&mut self) -> Result<Option<Kind>, End> {
        let status = self.client.status()?;
        let Some(stop) = self.subject.emergency_stop else { return Ok(None) };
        if !stop.is_pressed(status.switches) {
            self.clear()?;
            return Ok(None);
        }
        let closed_at_rest = |input: &u8| {
            let actuator =
                self.subject.actuator_at(*input).and_then(|actuator| self.subject.wiring.actuators.get(actuator));
            let switch = actuator.and_then(|wiring| wiring.switch);
            status.switches >> input & 1 == 1 && switch.is_some_and(|switch| !switch.closed(0))
        };
        let with = (0..32).find(closed_at_rest).filter(|_| stop.opens);
        Ok(Some(match with {
            Some(with) => Kind::StopSwapped { input: stop.input, with },
            None => Kind::StopPressed { input: stop.input },
        }))
    }

    fn clear(&mut self) -> Result<(), End> {
        if matches!(self.client.status()?.phase, Phase::Safe(_)) {
            // The emergency stop has ended the connection.
            self.client.say_hello()?;
            self.client.command(Command::Clear)?;
        }
        Ok(())
    }

    /// Has the emergency stop pressed and released.
    fn check_emergency_stop(&mut self) -> Result<(), End> {
        let Some(stop) = self.subject.emergency_stop else { return Ok(()) };
        if !self.operator.emergency_stop(true) {
            return Ok(());
        }
        self.outcome.is_stop_checked = self.wait_for(|inputs| stop.is_pressed(inputs))?;
        if !self.outcome.is_stop_checked {
            let dead = Finding::new(Kind::StopDead { input: stop.input }, self.subject);
            self.outcome.findings.push(dead);
        }
        self.operator.emergency_stop(false);
        self.wait_for(|inputs| !stop.is_pressed(inputs))?;
        self.clear()
    }

    /// Whether the inputs become like this within the time that a person needs.
    fn wait_for(&mut self, wanted: impl Fn(u32) -> bool) -> Result<bool, End> {
        let end_s = self.client.now_s() + PRESS_S;
        while self.client.now_s() < end_s {
            self.check_interrupt()?;
            if wanted(self.client.status()?.switches) {
                return Ok(true);
            }
            self.client.listen(RETRY_S)?;
        }
        Ok(false)
    }

    fn check_interrupt(&mut self) -> Result<(), End> {
        if self.operator.is_interrupted() { Err(End::Quit) } else { Ok(()) }
    }

    /// One output, as often as the operator wants to see it.
    fn output(&mut self, place: &Place) -> Result<(), End> {
        let subject = self.subject;
        let (output, actuator) = (place.coil.output, place.actuator);
        let step = Step { subject, output, actuator, state: place.digit(), on_ms: on_ms(subject, place) };
        loop {
            match self.operator.consent(&step) {
                Consent::Go => {}
                Consent::Skip => {
                    self.outcome.skipped.push(output);
                    return Ok(());
                }
                Consent::Quit => return Err(End::Quit),
            }
            let stroke = self.stroke(place, &step)?;
            let sight = match self.operator.moved(&step) {
                Look::Again => continue,
                Look::Nobody => None,
                Look::Moved(moved) => Some(Sight { moved, in_state: None }),
            };
            let stroke = self.with_state(Stroke { sight, ..stroke }, &step);
            self.outcome.strokes.push(stroke);
            return Ok(());
        }
    }

    /// Asks for the state of the actuator where the switch shows the opposite.
    fn with_state(&mut self, mut stroke: Stroke, step: &Step<'_>) -> Stroke {
        let unknown = Kind::Inverted { output: step.output };
        let is_unknown = judge(self.subject, std::slice::from_ref(&stroke)).iter().any(|found| found.kind == unknown);
        if let Some(sight) = stroke.sight.as_mut().filter(|_| is_unknown) {
            sight.in_state = self.operator.in_state(step);
        }
        stroke
    }

    /// Switches the output on for a time that the board ends, and looks until the actuator is back. No separate stop comes after
    /// it: that would end the connection, and with a new one a stop of somebody else would be forgotten.
    fn stroke(&mut self, place: &Place, step: &Step<'_>) -> Result<Stroke, End> {
        let output = step.output;
        if let Drive::Latch { pulse_ms, .. } = place.coil.drive {
            // The state of a latch is unknown until it was reset.
            self.switch(output, 0)?;
            self.client.listen(1e-3 * f64::from(u32::from(pulse_ms) + away_ms(self.subject, place)))?;
        }
        let before = self.switch(output, step.on_ms)?;
        let on = Span { first: before.at, last: self.client.answered_at() + TICKS };
        let mut samples = vec![before];
        let on_for = Micros::from_millis(step.on_ms);
        let end = on.last + on_for + Micros::from_millis(away_ms(self.subject, place));
        while samples.last().is_none_or(|sample| sample.at < end) {
            self.check_interrupt()?;
            samples.push(self.sample()?);
        }
        Ok(Stroke { output, on, on_for, samples, sight: None })
    }

    /// Switches; the longest time in ms until the board will do it, where the output recovers.
    fn refused(&mut self, output: u8, on_ms: u32) -> Result<Option<u32>, End> {
        match self.client.command(Command::Coil { coil: output, on_ms }) {
            Ok(()) => Ok(None),
            Err(ClientError::Refused(Refusal::Command(CommandError::Recovering { wait_ms, .. }))) => Ok(Some(wait_ms)),
            Err(error) => Err(error.into()),
        }
    }

    /// Switches the output, once it has recovered; the inputs just before.
    fn switch(&mut self, output: u8, on_ms: u32) -> Result<Sample, End> {
        let mut waits = false;
        loop {
            let before = self.sample()?;
            let Some(wait_ms) = self.refused(output, on_ms)? else { return Ok(before) };
            if !std::mem::replace(&mut waits, true) {
                self.operator.waiting(output, wait_ms);
            }
            self.check_interrupt()?;
            self.client.listen(RETRY_S)?;
        }
    }

    fn sample(&mut self) -> Result<Sample, End> {
        let status = self.client.status()?;
        match status.phase {
            Phase::Safe(fault) => Err(BringupError::Safe(fault.kind).into()),
            _ => Ok(Sample { at: self.client.answered_at(), inputs: status.switches }),
        }
    }
}

/// Time in which an actuator is at its stop for sure, ms.
fn away_ms(subject: &Subject, place: &Place) -> u32 {
    let travel_ms = subject.wiring.actuators.get(place.actuator).map_or(0, |wiring| wiring.travel_ms);
    2 * u32::from(travel_ms) + SETTLE_MS
}

/// How long the output is on: there, after a peak, and no longer than it may.
fn on_ms(subject: &Subject, place: &Place) -> u32 {
    let burst_ms = match place.coil.drive {
        Drive::Hold { .. } => 0,
        Drive::PeakHold { peak_ms, .. } => peak_ms,
        Drive::Latch { pulse_ms, .. } => pulse_ms,
    };
    let allowed_ms = match place.coil.drive {
        // Current flows for its pulse only.
        Drive::Latch { .. } => MAX_ON_MS,
        Drive::Hold { .. } | Drive::PeakHold { .. } => {
            let limit = place.coil.limit;
            limit.max_on_ms.min((u64::from(limit.window_ms) * u64::from(limit.duty_percent) / 100) as u32)
        }
    };
    (away_ms(subject, place) + u32::from(burst_ms)).min(allowed_ms).min(MAX_ON_MS)
}

/// A table that wires the arm without its limit switches and servos, and plays nothing.
fn table(subject: &Subject, profile: Digest) -> UploadImage {
    let wiring = &subject.wiring;
    let model = ModelHash(0);
    let mut records = vec![Record::Start { model, device: None, profile, switch_limit: wiring.switch_limit }];
    records.extend(wiring.coils.iter().copied().map(Record::Coil));
    let blind = wiring.actuators.iter().map(|actuator| ActuatorWiring { switch: None, ..*actuator });
    records.extend(blind.map(Record::Actuator));
    let word = Word::zeros(wiring.actuators.len() as u8).expect("an arm has no more actuators than a word has digits");
    records.push(Record::Row(Row { at: Micros(0), word, servos: Default::default() }));
    records.push(Record::End { at: Micros::from_millis(1) });
    UploadImage::table(&records, model)
}
