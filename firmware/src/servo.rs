//! Servo joints on a half-duplex bus: Feetech STS servos, up to [`MAX_SERVOS`] of them.
//!
//! The bus task visits every servo of the profile once a [`CYCLE`], those first that a stop is to hold: it reads position,
//! speed, load and status, writes what the servo is to do when that changed, and reports to the control tick. A servo that does
//! not answer keeps its last answer's time, and the sequencer finds that too old. What is written is clamped to the profile's
//! limits again.
//!
//! | action    | written                                                                                     |
//! |-----------|---------------------------------------------------------------------------------------------|
//! | `Go`      | torque on, the target, its speed and torque                                                  |
//! | `Hold`    | the present position as the goal, at the profile's speed and torque, where the servo has torque |
//! | `Release` | torque off                                                                                  |
//!
//! What was written is read back in the next visit, and written again until the servo has it; one that still has not after
//! four tries counts as silent. No single answer decides: where a servo is, is a vote of the reads and of the place before,
//! and the middle one of three that agree becomes a goal; registers count as read when two answers in a row are the same.
//!
//! Range, speed and motion are compared with the profile in each visit, whatever the servo is to do. A breach that lasts for two
//! visits goes to the control tick, and at once one that a vote shows.
//!
//! Angles are those of the shaft; its zero is the servo's middle position, 2048 of 4096 steps a turn.
//! Source: Feetech, STS3215 memory table.

pub mod echo;
mod packet;
mod place;

use core::f32::consts::TAU;

use darm_core::output::{MAX_SERVOS, SERVO_STEPS_PER_TURN, ServoWiring};
use darm_core::sequencer::{ServoAction, ServoBreach, ServoSeen, ServoTarget};
use darm_core::units::Micros;
use embassy_futures::select::{Either, select};
use embedded_io_async::{Read, Write};

use crate::clock::Clock;
use crate::control::{Joint, Joints, Shared};
use packet::{Packet, Parser};
use place::{Place, Sample};

/// Time from one visit of a servo to the next.
pub const CYCLE: Micros = Micros::from_millis(10);
/// An answer takes at most this long; a servo answers within half a millisecond, an emulated one when its host runs.
pub const ANSWER_TIMEOUT: Micros = Micros::from_millis(20);
/// The bus is quiet after this time without a byte.
const QUIET: Micros = Micros::from_millis(2);
/// What a servo does is written, or read back, again after this many visits even if it did not change: the servo may have lost
/// power.
const REWRITE_VISITS: u8 = 50;
/// Times that an order is written before a servo that answers and does not take it counts as silent: two may be damaged.
const MAX_TRIES: u8 = 4;
/// Reads of one visit until enough agree: four may be damaged.
const MAX_READS: u8 = 8;
/// Votes that make a place the one where a servo is. The place of the visit before has one less.
const ENOUGH_VOTES: u8 = 4;
/// A place that is older says nothing of where a servo is: it is read each [`CYCLE`], or after the one before it was silent.
const MAX_AGE: Micros = Micros::from_millis(35);
/// A hold that starts again keeps its goal where the load has bent the servo by less than this, steps: 1.4°. A new goal each
/// time would creep.
const BENT_STEPS: u16 = 16;

const RANGE_MARGIN_STEPS: i16 = (ServoWiring::RANGE_MARGIN_RAD * (SERVO_STEPS_PER_TURN / TAU)) as i16;
/// Resolution of the speed that a servo reports, steps/s: twice the coarsest unit of the series.
const REPORT_STEPS_S: f32 = 100.0;
/// Farther than this from what it is to hold a servo was moved, steps: 0.1 rad, twice what the load of a sound arm bends it.
const STRAY_STEPS: u16 = 65;
/// After another target a servo may turn on at its speed for as long as [`SETTLE_VISITS`] take, s.
const BRAKE_S: f32 = SETTLE_VISITS as f32 * CYCLE.0 as f32 / 1e6;
/// Over this time the mean speed of a servo is judged: the noise of the two places, 16 steps, is then 80 steps/s, 0.12 rad/s.
const SPEED_SPAN: Micros = Micros::from_millis(200);
/// Visits in which a servo brakes, or turns round, after another order.
const SETTLE_VISITS: u8 = 30;

const MIDDLE: f32 = 2048.0;

/// First of: torque on, acceleration, goal position, time, speed, torque limit.
const TORQUE_ENABLE: u8 = 40;
/// The same without the torque: what a hold writes gives torque to no servo.
const ACCELERATION: u8 = 41;
/// Registers of a goal, from [`TORQUE_ENABLE`] on.
const GOAL_LEN: u8 = 10;
/// First of: present position, speed, load.
const PRESENT: u8 = 56;
/// Sign bit of positions.
const POSITION_SIGN: u16 = 1 << 15;
/// Sign bit of loads.
const LOAD_SIGN: u16 = 1 << 10;

/// Why a servo was not reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusError {
    /// No answer in time.
    Silent,
    /// An answer of another length than requested.
    Length,
    /// Its answers contradict each other.
    Doubtful,
    /// The port failed.
    Port,
}

/// The bus with its port and its clock.
pub struct Bus<R, W, C> {
    reader: R,
    writer: W,
    clock: C,
    parser: Parser,
    known: [Known; MAX_SERVOS],
    /// Stops that have reached the holds.
    stops: u32,
}

/// How far a servo is with what it is to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Progress {
    /// It has not been written.
    #[default]
    Due,
    /// It was written; whether the servo has taken it is not known.
    Written,
    /// The servo has answered that it has it.
    Done,
}

/// What the bus knows of one servo.
#[derive(Clone, Copy, Debug, Default)]
struct Known {
    /// What it is to do since the last visit that got as far as that.
    action: Option<ServoAction>,
    /// Where it was seen last; `None` when it has not answered since, or never.
    place: Option<Place>,
    /// Where it was at the begin of the span in which its mean speed is judged.
    span_from: Option<Place>,
    /// The position that it is to hold, steps.
    goal: Option<i16>,
    /// What it is to do is its first order since the start.
    is_first: bool,
    /// Steps that it has gone away from its targets and has not come back: another target forgives none of them.
    away: i32,
    /// Of these, those that it may need to brake: what it turns in [`BRAKE_S`] at the speed that it had when its target changed.
    brake: i32,
    /// The speed that its last answer reports, steps/s.
    speed: u16,
    progress: Progress,
    /// Visits since it was done.
    visits: u8,
    /// Times that it was written since it was done.
    tries: u8,
    /// It had torque when that was last written or read.
    is_driven: bool,
    /// Why it was not reached when it was visited last.
    missed: Option<BusError>,
    /// Visits until it has braked.
    settling: u8,
    /// What its last answer breached.
    breach: Option<ServoBreach>,
}

impl<R: Read, W: Write, C: Clock> Bus<R, W, C> {
    /// A bus on which nothing was said yet.
    pub fn new(reader: R, writer: W, clock: C) -> Self {
        Self { reader, writer, clock, parser: Parser::default(), known: [Known::default(); MAX_SERVOS], stops: 0 }
    }

    /// Serves the joints for ever.
    pub async fn run(&mut self, shared: &Shared<'_>) -> ! {
        let mut due = self.clock.now();
        loop {
            self.visit_all(shared).await;
            due = (due + CYCLE).max(self.clock.now());
            self.clock.wait_until(due).await;
        }
    }

    /// Visits every servo once, first those that are to hold and still go to a target; of these first those that answer.
    pub async fn visit_all(&mut self, shared: &Shared<'_>) {
        let mut waiting = [true; MAX_SERVOS];
        loop {
            self.hear_stop(shared.stops());
            let Some((index, joint)) = self.next_visit(&mut waiting, &shared.joints()) else { break };
            let Some(joint) = joint else {
                self.note(index, |known| *known = Known::default());
                shared.set_servo_breach(index, None);
                continue;
            };
            match self.visit(index, &joint.limit, shared).await {
                Ok(seen) => shared.see_servo(index, seen),
                Err(_) => {
                    shared.note_unanswered();
                    self.settle().await;
                }
            }
        }
    }

    /// Each stop starts all holds again: the one before may have gone wrong.
    fn hear_stop(&mut self, stops: u32) {
        if stops != self.stops {
            self.stops = stops;
            for known in self.known.iter_mut().filter(|known| known.action == Some(ServoAction::Hold)) {
                known.progress = Progress::Due;
            }
        }
    }

    /// The servo to visit next of those that wait, and what it is to do now.
    fn next_visit(&self, waiting: &mut [bool; MAX_SERVOS], joints: &Joints) -> Option<(usize, Option<Joint>)> {
        let waits = |index: &usize| waiting.get(*index) == Some(&true);
        let next = (0..MAX_SERVOS).filter(waits).min_by_key(|index| self.rank(*index, joints))?;
        *waiting.get_mut(next)? = false;
        Some((next, joints.get(next).copied().flatten()))
    }

    /// 0 for a servo that may go to a target which it is to leave, 1 for a silent one, 2 for others.
    fn rank(&self, index: usize, joints: &Joints) -> u8 {
        let is_to_go = joints.get(index).copied().flatten().is_some_and(|joint| goes(&joint.action));
        let known = self.known(index);
        let has_hold = known.progress == Progress::Done && !known.action.as_ref().is_some_and(goes);
        if is_to_go || has_hold { 2 } else { u8::from(known.missed == Some(BusError::Silent)) }
    }

    fn known(&self, index: usize) -> Known {
        self.known.get(index).copied().unwrap_or_default()
    }

    fn note(&mut self, index: usize, change: impl FnOnce(&mut Known)) {
        if let Some(known) = self.known.get_mut(index) {
            change(known);
        }
    }

    /// Reads first: what is written may depend on where the servo is.
    async fn visit(&mut self, index: usize, limit: &ServoWiring, shared: &Shared<'_>) -> Result<ServoSeen, BusError> {
        let before = self.known(index).place;
        let sample = match self.agree(limit, before).await {
            Ok(sample) => sample,
            Err(error) => {
                self.note(index, |known| known.miss(error));
                shared.set_servo_breach(index, None);
                return Err(error);
            }
        };
        let breach = self.known.get_mut(index).and_then(|known| known.judge(limit, before, &sample));
        self.note(index, |known| (known.place, known.missed) = (Some(sample.place), None));
        let seen = sample.seen();
        shared.set_servo_breach(index, breach);
        // What it is to do may have changed meanwhile: no target from before a stop is written after it.
        let Some(joint) = shared.joints().get(index).copied().flatten() else { return Ok(seen) };
        self.note(index, |known| known.begin(joint.action));
        if goes(&joint.action) && shared.servo_seen(index).answered.is_none() {
            // What is written next drives it although its answer may be lost: from now on its silence counts. A servo that is to hold has
            // not answered before it has that order: a start waits for it.
            shared.see_servo(index, seen);
        }
        let known = self.known(index);
        if known.progress == Progress::Done && known.visits <= REWRITE_VISITS {
            return Ok(seen);
        }
        let is_new = known.progress == Progress::Due;
        match joint.action {
            ServoAction::Go(target) => self.go(index, &joint, goal(&target, &joint.limit), shared).await?,
            ServoAction::Hold => self.hold(index, &joint.limit, &sample, before.is_none()).await?,
            ServoAction::Release => self.release(index, joint.limit.id).await?,
        }
        // Orders that change in each visit leave none to read one back.
        let is_deaf = self.known(index).tries > MAX_TRIES && !(is_new && self.has_taken(index, &joint).await?);
        Ok(if is_deaf { ServoSeen { answered: shared.servo_seen(index).answered, ..seen } } else { seen })
    }

    /// Whether a servo has what was written to it in this visit.
    async fn has_taken(&mut self, index: usize, joint: &Joint) -> Result<bool, BusError> {
        let found = self.registers(joint.limit.id).await?;
        let own = self.known(index).goal.map(|steps| goal_registers(steps, &joint.limit));
        let has_taken = match joint.action {
            ServoAction::Go(target) => does(&found, &goal(&target, &joint.limit)),
            ServoAction::Hold => own.is_some_and(|own| keeps(&found, &own)),
            ServoAction::Release => found.first() == Some(&0),
        };
        if has_taken {
            self.note(index, |known| known.tries = 0);
        }
        Ok(has_taken)
    }

    async fn go(
        &mut self,
        index: usize,
        joint: &Joint,
        registers: [u8; GOAL_LEN as usize],
        shared: &Shared<'_>,
    ) -> Result<(), BusError> {
        let id = joint.limit.id;
        // Damage can keep the sum of a request: the servo then goes elsewhere and answers that all is well.
        if self.known(index).progress != Progress::Due {
            if does(&self.registers(id).await?, &registers) {
                self.note(index, |known| known.is_done(true));
                return Ok(());
            }
            // Reading took a millisecond or more, in which a stop may have come.
            if shared.joints().get(index).copied().flatten() != Some(*joint) {
                return Ok(());
            }
        }
        // Whether it does this or still the last is not known before it answers.
        self.note(index, |known| known.is_written(false));
        self.write(id, TORQUE_ENABLE, &registers).await?;
        self.note(index, |known| known.is_driven = true);
        Ok(())
    }

    /// Out of the range by more than its load bends it, or further round than one turn, it holds too: to turn back would be a motion that
    /// nobody requested. `is_back`: it had been silent.
    async fn hold(
        &mut self,
        index: usize,
        limit: &ServoWiring,
        sample: &Sample,
        is_back: bool,
    ) -> Result<(), BusError> {
        let known = self.known(index);
        let (mut first, mut in_force) = (*sample, None);
        // One that has answered that it goes has torque: its first hold does not wait for a further answer.
        if known.progress != Progress::Due || !known.is_driven || known.goal.is_some() {
            let found = self.registers(limit.id).await?;
            let [torque, ..] = found;
            if torque == 0 {
                self.note(index, |known| {
                    // One that loses its torque while it holds keeps its goal: where it sinks from there, it has moved. Another stop, or
                    // a supply that was away, lets it be moved by hand.
                    if known.progress == Progress::Due || is_back {
                        known.goal = None;
                    }
                    known.is_done(false);
                });
                return Ok(());
            }
            let wanted = known.goal.map(|steps| goal_registers(steps, limit));
            if known.progress != Progress::Due && wanted.is_some_and(|wanted| keeps(&found, &wanted)) {
                self.note(index, |known| known.is_done(true));
                return Ok(());
            }
            // What another start ordered it to hold is as good as what this one did; damage may have given it another goal since.
            let goal = place::signed(position(&found));
            in_force = Some(goal).filter(|goal| known.goal.map_or(known.is_first, |own| own == *goal));
            // Reading the registers took a millisecond.
            first = self.agree(limit, Some(first.place)).await?;
        }
        let second = self.agree(limit, Some(first.place)).await?;
        let third = self.agree(limit, Some(second.place)).await?;
        let has_jumped = first.has_jumped || second.has_jumped || third.has_jumped;
        let seen = median([first, second, third].map(|sample| sample.place.steps));
        // Its load has bent it from the goal that it has: its place for another goal would bend it again, and again with each stop. How far
        // it may leave the goal that it was given is for `judge` to say.
        let is_kept =
            |goal: &i16| known.goal.is_some() || goal.abs_diff(seen) <= BENT_STEPS && is_in_range(*goal, limit);
        let steps = in_force.filter(is_kept).unwrap_or_else(|| place_to_hold(seen, limit));
        self.note(index, |known| {
            // One that has jumped is held all the same; the next visit finds it, and reports it.
            known.place = if has_jumped { known.place } else { Some(third.place) };
            if known.goal != Some(steps) {
                (known.goal, known.settling) = (Some(steps), SETTLE_VISITS);
            }
            known.is_written(known.is_driven);
        });
        let [_, values @ ..] = goal_registers(steps, limit);
        self.write(limit.id, ACCELERATION, &values).await
    }

    async fn release(&mut self, index: usize, id: u8) -> Result<(), BusError> {
        if self.known(index).progress != Progress::Due {
            let [torque, ..] = self.registers(id).await?;
            if torque == 0 {
                self.note(index, |known| known.is_done(false));
                return Ok(());
            }
        }
        self.note(index, |known| known.is_written(false));
        self.write(id, TORQUE_ENABLE, &[0]).await
    }

    /// Reads where a servo is, by a vote. A read that the servo can have come to from the place so far counts for that place,
    /// another one against it, and a place without votes gives way to what is read. `before`, where it was seen last, begins with
    /// all votes but one: damaged answers that agree with each other have to outvote it, and what is new to it too. An old place has
    /// none: while the flash let nothing run the servo may have gone anywhere, and a damaged answer would be as possible as a right one.
    async fn agree(&mut self, limit: &ServoWiring, mut before: Option<Place>) -> Result<Sample, BusError> {
        let (mut place, mut votes) = (before, before.map_or(0, |_| ENOUGH_VOTES.saturating_sub(1)));
        for _ in 0..MAX_READS {
            // An answer may wait to be read while the flash lets nothing run: it is as old as its request.
            let asked = self.clock.now();
            let (values, error) = self.read(limit.id, PRESENT).await?;
            let came = self.clock.now();
            let mut sample = Sample::new(values, error, asked, came);
            // The flash may have let nothing run since the read before.
            if place.is_some_and(|place| place.age(came) > MAX_AGE) {
                (before, place, votes) = (None, None, 0);
            }
            if place.is_some_and(|place| place.leads_to(&sample, limit)) {
                votes = votes.saturating_add(1);
                place = Some(sample.place);
                if votes >= ENOUGH_VOTES {
                    sample.has_jumped = before.is_some_and(|before| !before.leads_to(&sample, limit));
                    return Ok(sample);
                }
            } else if votes > 0 {
                votes = votes.saturating_sub(1);
            } else {
                (place, votes) = (Some(sample.place), 1);
            }
        }
        Err(BusError::Doubtful)
    }

    /// The registers of its goal, as two answers in a row say.
    async fn registers(&mut self, id: u8) -> Result<[u8; GOAL_LEN as usize], BusError> {
        let mut before = None;
        for _ in 0..MAX_READS {
            let (values, _) = self.read(id, TORQUE_ENABLE).await?;
            if before == Some(values) {
                return Ok(values);
            }
            before = Some(values);
        }
        Err(BusError::Doubtful)
    }

    /// Values of registers, and the error bits of the answer.
    async fn read<const N: usize>(&mut self, id: u8, first: u8) -> Result<([u8; N], u8), BusError> {
        let answer = self.ask(&Packet::read(id, first, N as u8), N).await?;
        let values = answer.parameters().try_into().map_err(|_| BusError::Length)?;
        Ok((values, answer.code))
    }

    async fn write(&mut self, id: u8, first: u8, values: &[u8]) -> Result<(), BusError> {
        self.ask(&Packet::write(id, first, values), 0).await.map(drop)
    }

    /// One request, and the answer of the servo it was meant for, with as many values as were requested.
    async fn ask(&mut self, request: &Packet, values: usize) -> Result<Packet, BusError> {
        self.parser = Parser::default();
        self.writer.write_all(request.encode().as_slice()).await.map_err(|_| BusError::Port)?;
        self.writer.flush().await.map_err(|_| BusError::Port)?;
        let deadline = self.clock.now() + ANSWER_TIMEOUT;
        let mut bytes = [0; 16];
        loop {
            let n = self.read_until(deadline, &mut bytes).await?.ok_or(BusError::Silent)?;
            let mut answer = None;
            for byte in bytes.iter().take(n) {
                answer = self.parser.push(*byte).filter(|packet| packet.id == request.id).or(answer);
            }
            if let Some(answer) = answer {
                return if answer.parameters().len() == values { Ok(answer) } else { Err(BusError::Length) };
            }
        }
    }

    /// Reads until the bus is quiet, so that a late answer is not taken for the next one.
    async fn settle(&mut self) {
        let mut bytes = [0; 16];
        while let Ok(Some(_)) = self.read_until(self.clock.now() + QUIET, &mut bytes).await {}
    }

    /// `None` when the deadline passes first.
    async fn read_until(&mut self, deadline: Micros, bytes: &mut [u8]) -> Result<Option<usize>, BusError> {
        match select(self.reader.read(bytes), self.clock.wait_until(deadline)).await {
            Either::First(read) => read.map(Some).map_err(|_| BusError::Port),
            Either::Second(()) => Ok(None),
        }
    }
}

impl Known {
    /// It did not answer, or not clearly. Whether it does what was written last is not known: that is written again, or read back.
    /// A position that is held stays the goal all the same: where the load has bent it to is no new one. Answers that contradict
    /// each other do not show where it is, and where it was limits where it can be; one that was silent twice in a row may have been
    /// turned. On a worn cable each second answer may be lost: what the one before breached is not forgotten for that.
    fn miss(&mut self, error: BusError) {
        if self.missed.is_some() {
            // Out of its range, or away from its goal, it is wherever it was before.
            self.breach = self.breach.filter(|breach| *breach != ServoBreach::Speed);
            if error != BusError::Doubtful {
                (self.place, self.span_from) = (None, None);
            }
        }
        (self.is_driven, self.visits, self.missed) = (false, REWRITE_VISITS, Some(error));
    }

    /// Begins another action, or continues the same one.
    fn begin(&mut self, action: ServoAction) {
        if self.action != Some(action) {
            let brake = (BRAKE_S * f32::from(self.speed)) as i32;
            (self.away, self.brake) = if !self.action.as_ref().is_some_and(goes) {
                // Its load may bend it before it has torque.
                (0, brake.max(i32::from(STRAY_STEPS)))
            } else if self.away > place::NOISE_STEPS as i32 {
                // It has not come back from where it braked before.
                (self.away, self.brake.max(brake))
            } else {
                (self.away, brake)
            };
            // One that goes has no position that it holds.
            self.is_first = self.action.is_none();
            (self.action, self.progress, self.goal, self.settling) = (Some(action), Progress::Due, None, SETTLE_VISITS);
        }
        self.visits = self.visits.saturating_add(1);
    }

    /// What it does that its profile does not allow, if it did so in the visit before too, in the same way or another, for a single answer may
    /// be damaged; or in this one alone, where a vote shows it far from `before`, where it was then, or from where it was a while ago.
    fn judge(&mut self, limit: &ServoWiring, before: Option<Place>, sample: &Sample) -> Option<ServoBreach> {
        self.settling = self.settling.saturating_sub(1);
        self.speed = sample.place.speed;
        let (breach, last) = (self.breach(limit, before, sample), self.breach);
        self.breach = breach;
        let reported = breach.filter(|_| last.is_some() || sample.has_jumped);
        let reported = reported.or_else(|| self.is_fast(limit, sample).then_some(ServoBreach::Speed));
        if reported == Some(ServoBreach::Moved) && self.action == Some(ServoAction::Hold) {
            // That was reported. It holds where it is now, so that the safe state can be left.
            (self.goal, self.progress) = (None, Progress::Due);
        }
        reported
    }

    /// Whether it has turned too far in a span of [`SPEED_SPAN`]: in a single visit the noise of a place is worth
    /// 1.2 rad/s.
    fn is_fast(&mut self, limit: &ServoWiring, sample: &Sample) -> bool {
        let Some(from) = self.span_from.filter(|from| from.age(sample.asked) >= SPEED_SPAN) else {
            self.span_from = self.span_from.or(Some(sample.place));
            return false;
        };
        self.span_from = Some(sample.place);
        from.distance(sample) > 2.0 * place::NOISE_STEPS + place::limit_steps_s(limit) * from.elapsed_s(sample)
    }

    fn breach(&mut self, limit: &ServoWiring, before: Option<Place>, sample: &Sample) -> Option<ServoBreach> {
        let has_strayed = self.has_strayed(limit, before, sample.place.steps);
        let allowed = place::limit_steps_s(limit);
        let is_farther =
            |before: Place| before.distance(sample) > place::NOISE_STEPS + allowed * before.elapsed_s(sample);
        let reports_speed = f32::from(sample.place.speed) > allowed + REPORT_STEPS_S;
        if !limit.keeps_range(place::angle_rad(place::register(sample.place.steps))) {
            Some(ServoBreach::Range)
        } else if reports_speed || before.is_some_and(is_farther) {
            Some(ServoBreach::Speed)
        } else if has_strayed {
            Some(ServoBreach::Moved)
        } else {
            None
        }
    }

    /// Whether it leaves what it holds, or its target. One without torque may be moved by hand.
    fn has_strayed(&mut self, limit: &ServoWiring, before: Option<Place>, at: i16) -> bool {
        match self.action {
            Some(ServoAction::Go(target)) => {
                let goal = steps(target.angle_rad.clamp(limit.min_rad, limit.max_rad)) as i16;
                let distance = |at: i16| i32::from(at.abs_diff(goal));
                let farther = before.map_or(0, |before| distance(at).saturating_sub(distance(before.steps)));
                self.away = self.away.saturating_add(farther).max(0);
                if self.settling == 0 {
                    self.brake = self.brake.min(self.away);
                }
                self.away > self.brake.saturating_add(i32::from(STRAY_STEPS))
            }
            Some(ServoAction::Hold) => {
                self.settling == 0 && self.goal.is_some_and(|goal| goal.abs_diff(at) > STRAY_STEPS)
            }
            Some(ServoAction::Release) | None => false,
        }
    }

    fn is_written(&mut self, is_driven: bool) {
        (self.progress, self.tries, self.is_driven) = (Progress::Written, self.tries.saturating_add(1), is_driven);
    }

    fn is_done(&mut self, is_driven: bool) {
        (self.progress, self.visits, self.tries, self.is_driven) = (Progress::Done, 0, 0, is_driven);
    }
}

/// Whether it moves.
fn goes(action: &ServoAction) -> bool {
    matches!(action, ServoAction::Go(_))
}

/// The position to hold, steps: where the servo is. One that its load has bent over the edge of its range holds at the edge: with its
/// place for the goal each start would bend it further out.
fn place_to_hold(seen: i16, limit: &ServoWiring) -> i16 {
    let [low, high] = range_steps(limit);
    let bent = low.saturating_sub(RANGE_MARGIN_STEPS)..=high.saturating_add(RANGE_MARGIN_STEPS);
    if bent.contains(&seen) { seen.max(low).min(high) } else { seen }
}

fn is_in_range(goal: i16, limit: &ServoWiring) -> bool {
    let [low, high] = range_steps(limit);
    (low..=high).contains(&goal)
}

fn range_steps(limit: &ServoWiring) -> [i16; 2] {
    [limit.min_rad, limit.max_rad].map(|rad| steps(rad) as i16)
}

/// The middle one: a single one that is damaged is none of the three, or lies between the two others.
fn median(mut steps: [i16; 3]) -> i16 {
    steps.sort_unstable();
    let [_, middle, _] = steps;
    middle
}

/// The registers of a servo that holds a position.
fn goal_registers(steps: i16, limit: &ServoWiring) -> [u8; GOAL_LEN as usize] {
    registers(place::register(steps), limit.max_speed_rad_s, limit.max_torque)
}

/// The goal among its registers.
fn position(&[_, _, low, high, ..]: &[u8; GOAL_LEN as usize]) -> u16 {
    u16::from_le_bytes([low, high])
}

/// Whether registers that were read hold the goal of others as strongly, and no faster. A hold with less torque lets the arm sag.
fn keeps(found: &[u8; GOAL_LEN as usize], wanted: &[u8; GOAL_LEN as usize]) -> bool {
    let parts = |&[.., s0, s1, t0, t1]: &[u8; GOAL_LEN as usize]| [[s0, s1], [t0, t1]].map(u16::from_le_bytes);
    let ([speed, torque], [max_speed, max_torque]) = (parts(found), parts(wanted));
    position(found) == position(wanted) && (1..=max_speed).contains(&speed) && torque == max_torque
}

/// Whether a servo goes to the target of these registers.
fn does(found: &[u8; GOAL_LEN as usize], wanted: &[u8; GOAL_LEN as usize]) -> bool {
    found.first() == wanted.first() && keeps(found, wanted)
}

/// The registers of a target, no farther, faster or stronger than the limit.
fn goal(target: &ServoTarget, limit: &ServoWiring) -> [u8; 10] {
    let angle_rad = target.angle_rad.clamp(limit.min_rad, limit.max_rad);
    let (speed_rad_s, torque) = (target.speed_rad_s.min(limit.max_speed_rad_s), target.torque.min(limit.max_torque));
    registers(steps(angle_rad), speed_rad_s, torque)
}

/// The ten registers from [`TORQUE_ENABLE`] on.
fn registers(steps: u16, speed_rad_s: f32, torque: f32) -> [u8; 10] {
    let [p0, p1] = steps.to_le_bytes();
    // A speed of 0 means the servo's own maximum.
    let [s0, s1] = ((speed_rad_s * (SERVO_STEPS_PER_TURN / TAU)).clamp(1.0, 32_767.0) as u16).to_le_bytes();
    let [t0, t1] = ((torque * 1000.0).clamp(0.0, 1000.0) as u16).to_le_bytes();
    [1, 0, p0, p1, 0, 0, s0, s1, t0, t1]
}

/// Position register of a servo angle; nearest step within one turn.
fn steps(servo_rad: f32) -> u16 {
    (servo_rad * (SERVO_STEPS_PER_TURN / TAU) + MIDDLE + 0.5).clamp(0.0, SERVO_STEPS_PER_TURN - 1.0) as u16
}

#[cfg(test)]
mod tests;
