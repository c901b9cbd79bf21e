//! Servo joints on a half-duplex bus: Feetech STS servos, up to [`MAX_SERVOS`] of them.
//!
//! The bus task visits every wired servo once a [`CYCLE`]: it writes the target when that changed, reads position,
//! load and status, and tells the control tick. It decides nothing: a servo that does not answer keeps its last
//! answer's time, and the sequencer finds that too old.
//!
//! Joint angle = servo angle − offset; the servo's own zero is its middle position, 2048 of 4096 steps a turn.
//! Source: Feetech, STS3215 memory table.

mod packet;

use core::f32::consts::TAU;

use darm_core::output::{MAX_SERVOS, SERVO_STEPS_PER_TURN};
use darm_core::sequencer::{ServoSeen, ServoTarget};
use darm_core::units::Micros;
use embassy_futures::select::{Either, select};
use embedded_io_async::{Read, Write};

use crate::clock::Clock;
use crate::control::{Joint, Shared};
use packet::{Packet, Parser};

/// Time from one visit of a servo to the next.
pub const CYCLE: Micros = Micros::from_millis(10);
/// An answer takes at most this long; a servo answers within half a millisecond, an emulated one when its host runs.
pub const ANSWER_TIMEOUT: Micros = Micros::from_millis(20);
/// The bus is quiet after so long without a byte.
const QUIET: Micros = Micros::from_millis(2);
/// A target is written again after so many visits even if it did not change: the servo may have lost power.
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
    /// An answer of another length than asked for.
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
    failures: u32,
}

/// What a servo was told last.
#[derive(Clone, Copy, PartialEq)]
struct Written {
    joint: Joint,
    offset_rad: f32,
    visits: u8,
}

/// What a servo answered.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Present {
    angle_rad: f32,
    load: f32,
    error: u8,
}

impl<R: Read, W: Write, C: Clock> Bus<R, W, C> {
    /// A bus on which nothing was said yet.
    pub fn new(reader: R, writer: W, clock: C) -> Self {
        Self { reader, writer, clock, parser: Parser::default(), written: [None; MAX_SERVOS], failures: 0 }
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

    /// Visits without an answer so far.
    pub fn failures(&self) -> u32 {
        self.failures
    }

    /// Visits every wired joint once.
    pub async fn visit_all(&mut self, shared: &Shared<'_>) {
        let (joints, offsets_rad) = (shared.joints(), shared.offsets_rad());
        for (index, (joint, offset_rad)) in joints.into_iter().zip(offsets_rad).enumerate() {
            let Some(joint) = joint else {
                self.written[index] = None;
                continue;
            };
            match self.visit(index, joint, offset_rad).await {
                Ok(present) => shared.see_servo(
                    index,
                    ServoSeen {
                        angle_rad: present.angle_rad - offset_rad,
                        load: present.load,
                        error: present.error,
                        answered: Some(self.clock.now()),
                    },
                ),
                Err(_) => {
                    self.failures = self.failures.saturating_add(1);
                    self.written[index] = None;
                    self.settle().await;
                }
            }
        }
    }

    async fn visit(&mut self, index: usize, joint: Joint, offset_rad: f32) -> Result<Present, BusError> {
        let visits = match self.written[index] {
            Some(last) if last.joint == joint && last.offset_rad == offset_rad && last.visits < REWRITE_VISITS => {
                last.visits + 1
            }
            _ => {
                self.command(joint, offset_rad).await?;
                0
            }
        };
        self.written[index] = Some(Written { joint, offset_rad, visits });
        let answer = self.ask(&Packet::read(joint.id, PRESENT, PRESENT_LEN)).await?;
        let &[p0, p1, _, _, l0, l1] = answer.parameters() else { return Err(BusError::Length) };
        let load = u16::from_le_bytes([l0, l1]) & (LOAD_SIGN - 1);
        Ok(Present {
            angle_rad: angle_rad(u16::from_le_bytes([p0, p1])),
            load: f32::from(load) * 1e-3,
            error: answer.code,
        })
    }

    async fn command(&mut self, joint: Joint, offset_rad: f32) -> Result<(), BusError> {
        let packet = match joint.target {
            Some(target) => Packet::write(joint.id, TORQUE_ENABLE, &goal(&target, offset_rad)),
            None => Packet::write(joint.id, TORQUE_ENABLE, &[0]),
        };
        self.ask(&packet).await.map(drop)
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

/// The ten registers from [`TORQUE_ENABLE`] on.
fn goal(target: &ServoTarget, offset_rad: f32) -> [u8; 10] {
    let position = steps(target.angle_rad + offset_rad).to_le_bytes();
    // A speed of 0 means the servo's own maximum.
    let speed = (target.speed_rad_s * (SERVO_STEPS_PER_TURN / TAU)).clamp(1.0, 32_767.0) as u16;
    let speed = speed.to_le_bytes();
    let torque = ((target.torque * 1000.0).clamp(0.0, 1000.0) as u16).to_le_bytes();
    [1, 0, position[0], position[1], 0, 0, speed[0], speed[1], torque[0], torque[1]]
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
