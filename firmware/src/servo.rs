//! Servo joints on a half-duplex bus: Feetech STS servos, up to [`MAX_SERVOS`] of them.
//!
//! The bus task visits every servo of the profile once a [`CYCLE`], those first that a stop is to hold: it reads position,
//! load and status, writes what the servo is to do when that changed, and reports to the control tick. A servo that does not
//! answer keeps its last answer's time, and the sequencer finds that too old. What is written is clamped to the profile's
//! limits again.
//!
//! | action    | written                                                                                    |
//! |-----------|--------------------------------------------------------------------------------------------|
//! | `Go`      | torque on, the target, its speed and torque                                                |
//! | `Hold`    | the present position as the goal, once, and only where the servo has torque                 |
//! | `Release` | torque off                                                                                 |
//!
//! Angles are those of the shaft; its zero is the servo's middle position, 2048 of 4096 steps a turn.
//! Source: Feetech, STS3215 memory table.

pub mod echo;
mod packet;

use core::f32::consts::TAU;

use darm_core::output::{MAX_SERVOS, SERVO_STEPS_PER_TURN, ServoWiring};
use darm_core::sequencer::{ServoAction, ServoSeen, ServoTarget};
use darm_core::units::Micros;
use embassy_futures::select::{Either, select};
use embedded_io_async::{Read, Write};

use crate::clock::Clock;
use crate::control::{Joint, Joints, Shared};
use packet::{Packet, Parser};

/// Time from one visit of a servo to the next.
pub const CYCLE: Micros = Micros::from_millis(10);
/// An answer takes at most this long; a servo answers within half a millisecond, an emulated one when its host runs.
pub const ANSWER_TIMEOUT: Micros = Micros::from_millis(20);
/// The bus is quiet after this time without a byte.
const QUIET: Micros = Micros::from_millis(2);
/// A target is written again after this many visits even if it did not change: the servo may have lost power.
const REWRITE_VISITS: u8 = 50;

const MIDDLE: f32 = 2048.0;

/// First of: torque on, acceleration, goal position, time, speed, torque limit.
const TORQUE_ENABLE: u8 = 40;
/// First of: present position, speed, load.
const PRESENT: u8 = 56;
const PRESENT_LEN: u8 = 6;
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
    /// The port failed.
    Port,
}

/// The bus with its port and its clock.
pub struct Bus<R, W, C> {
    reader: R,
    writer: W,
    clock: C,
    parser: Parser,
    written: [Option<Written>; MAX_SERVOS],
}

/// What was written to a servo last.
#[derive(Clone, Copy, PartialEq)]
struct Written {
    joint: Joint,
    visits: u8,
    /// It did not answer when it was visited last.
    is_silent: bool,
}

impl<R: Read, W: Write, C: Clock> Bus<R, W, C> {
    /// A bus on which nothing was said yet.
    pub fn new(reader: R, writer: W, clock: C) -> Self {
        Self { reader, writer, clock, parser: Parser::default(), written: [None; MAX_SERVOS] }
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
        while let Some((index, joint)) = self.next_visit(&mut waiting, &shared.joints()) {
            let Some(joint) = joint else {
                self.set_written(index, None);
                continue;
            };
            match self.visit(index, joint, shared).await {
                Ok(seen) => shared.see_servo(index, seen),
                Err(_) => {
                    shared.note_unanswered();
                    self.settle().await;
                }
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

    /// 0 for a servo that goes to a target which it is to leave, 1 for a silent one, 2 for others.
    fn rank(&self, index: usize, joints: &Joints) -> u8 {
        let is_to_go = joints.get(index).copied().flatten().is_some_and(|joint| goes(&joint));
        match self.written.get(index).copied().flatten() {
            Some(last) if goes(&last.joint) && !is_to_go => u8::from(last.is_silent),
            _ => 2,
        }
    }

    /// Whether it does what was written last is not known: the next visit writes what it is to do. A position that is held is
    /// not written again all the same: where the load has bent it to is no new goal.
    fn doubt(&mut self, index: usize, is_silent: bool) {
        if let Some(Some(last)) = self.written.get_mut(index) {
            *last = Written { visits: REWRITE_VISITS, is_silent, ..*last };
        }
    }

    fn set_written(&mut self, index: usize, written: Option<Written>) {
        if let Some(slot) = self.written.get_mut(index) {
            *slot = written;
        }
    }

    /// Reads first: what is written may depend on where the servo is.
    async fn visit(&mut self, index: usize, joint: Joint, shared: &Shared<'_>) -> Result<ServoSeen, BusError> {
        let (seen, position) = match self.look(joint.limit.id).await {
            Ok(found) => found,
            Err(error) => {
                self.doubt(index, true);
                return Err(error);
            }
        };
        if shared.servo_seen(index).answered.is_none() {
            // What is written next may drive it although its answer is lost: from now on its silence counts.
            shared.see_servo(index, seen);
        }
        // What it is to do may have changed meanwhile: no target from before a stop is written after it.
        let Some(joint) = shared.joints().get(index).copied().flatten() else { return Ok(seen) };
        let visits = match self.written.get(index).copied().flatten() {
            Some(last) if last.joint == joint && last.visits < REWRITE_VISITS => last.visits.saturating_add(1),
            // The position that is held was written once; again it would creep.
            Some(last) if last.joint == joint && joint.action == ServoAction::Hold => last.visits,
            _ => {
                // Whether it does this or still the last is not known before it answers.
                if goes(&joint) {
                    self.set_written(index, Some(Written { joint, visits: REWRITE_VISITS, is_silent: false }));
                } else {
                    self.doubt(index, false);
                }
                self.act(&joint, position).await?;
                0
            }
        };
        self.set_written(index, Some(Written { joint, visits, is_silent: false }));
        Ok(seen)
    }

    /// What a servo reports, and its position in steps.
    async fn look(&mut self, id: u8) -> Result<(ServoSeen, u16), BusError> {
        // An answer may wait to be read while the flash lets nothing run: it is as old as its request.
        let asked = self.clock.now();
        let answer = self.ask(&Packet::read(id, PRESENT, PRESENT_LEN)).await?;
        let &[p0, p1, _, _, l0, l1] = answer.parameters() else { return Err(BusError::Length) };
        let position = u16::from_le_bytes([p0, p1]);
        let load = u16::from_le_bytes([l0, l1]) & (LOAD_SIGN - 1);
        let seen = ServoSeen {
            angle_rad: angle_rad(position),
            load: f32::from(load) * 1e-3,
            error: answer.code,
            answered: Some(asked),
        };
        Ok((seen, position))
    }

    async fn act(&mut self, joint: &Joint, position: u16) -> Result<(), BusError> {
        let id = joint.limit.id;
        match joint.action {
            ServoAction::Go(target) => self.write(id, &goal(&target, &joint.limit)).await,
            ServoAction::Release => self.write(id, &[0]).await,
            ServoAction::Hold => {
                let answer = self.ask(&Packet::read(id, TORQUE_ENABLE, 1)).await?;
                match answer.parameters() {
                    [0] => Ok(()),
                    [_] => {
                        let (speed_rad_s, torque) = (joint.limit.max_speed_rad_s, joint.limit.max_torque);
                        // Out of the range, or further round than one turn, it holds too: to turn back would be a motion
                        // that nobody requested.
                        self.write(id, &registers(position, speed_rad_s, torque)).await
                    }
                    _ => Err(BusError::Length),
                }
            }
        }
    }

    async fn write(&mut self, id: u8, values: &[u8]) -> Result<(), BusError> {
        self.ask(&Packet::write(id, TORQUE_ENABLE, values)).await.map(drop)
    }

    /// One request, and the answer of the servo it was meant for.
    async fn ask(&mut self, request: &Packet) -> Result<Packet, BusError> {
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
                return Ok(answer);
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

/// Whether it moves.
fn goes(joint: &Joint) -> bool {
    matches!(joint.action, ServoAction::Go(_))
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

/// Servo angle of a position register.
fn angle_rad(register: u16) -> f32 {
    let magnitude = f32::from(register & (POSITION_SIGN - 1));
    let steps = if register & POSITION_SIGN == 0 { magnitude } else { -magnitude };
    (steps - MIDDLE) * (TAU / SERVO_STEPS_PER_TURN)
}

#[cfg(test)]
mod tests;
