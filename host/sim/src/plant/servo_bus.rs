//! Feetech STS servos on a half-duplex bus, as the board sees them: bytes in, bytes out, angles that turn with time.
//!
//! | packet  | bytes                                              |
//! |---------|----------------------------------------------------|
//! | request | `FF FF id len instruction parameters… check`       |
//! | answer  | `FF FF id len status parameters… check`            |
//!
//! `len` counts what follows it, `check` is the inverted sum of all bytes after `FF FF`. Two-byte registers are little
//! endian. Position 2048 of 4096 steps a turn is servo angle 0. A servo turns at constant speed; its inertia is left out.
//! One that bears a load rests a little beside its goal, by its bend.
//! Source: Feetech, "Communication Protocol Manual" and the memory table of the STS3215.

use darm_core::output::SERVO_STEPS_PER_TURN;
use std::f32::consts::TAU;
use std::ops::Range;

/// The registers that matter to the motion.
mod register {
    pub(super) const ID: usize = 5;
    pub(super) const TORQUE_ENABLE: usize = 40;
    pub(super) const GOAL_POSITION: usize = 42;
    pub(super) const GOAL_SPEED: usize = 46;
    pub(super) const TORQUE_LIMIT: usize = 48;
    pub(super) const PRESENT_POSITION: usize = 56;
    pub(super) const PRESENT_SPEED: usize = 58;
    pub(super) const PRESENT_LOAD: usize = 60;
    pub(super) const VOLTAGE: usize = 62;
    pub(super) const TEMPERATURE: usize = 63;
    pub(super) const STATUS: usize = 65;
    pub(super) const MOVING: usize = 66;
    pub(super) const COUNT: usize = 71;
}

mod instruction {
    pub(super) const PING: u8 = 1;
    pub(super) const READ: u8 = 2;
    pub(super) const WRITE: u8 = 3;
    pub(super) const SYNC_READ: u8 = 0x82;
    pub(super) const SYNC_WRITE: u8 = 0x83;
}

/// All servos listen to this address and none answers.
const BROADCAST: u8 = 0xFE;
/// Registers that a host may write.
const WRITABLE: Range<usize> = 5..56;
/// Position register at servo angle 0.
const CENTRE: f32 = 2048.0;
/// Speed without a limit, steps/s: that of an STS3215 at 7.4 V.
const TOP_SPEED: f32 = 3400.0;
/// Load while turning freely, and all that a servo can bear, thousandths.
const FREE_LOAD: u16 = 60;
const FULL_LOAD: u16 = 1000;
/// In the load register this bit is the sign.
const LOAD_SIGN: u16 = 1 << 10;

/// Torque limit of a servo that protects itself, thousandths.
const PROTECTED_TORQUE: u16 = 100;

/// Status bit of a servo that bears more than it can.
const OVERLOADED: u8 = 1 << 5;
/// Of this number of answers of a servo with a bad contact one is damaged.
const DAMAGED_IN: u64 = 3;
/// The same of requests.
const MISLED_IN: u64 = 2;

/// Servos with faults: bit `i` is servo joint `i`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ServoFaults {
    /// They hear nothing and answer nothing.
    pub silent: u8,
    /// They cannot turn.
    pub blocked: u8,
    /// They do what they are sent, and none of their answers arrives.
    pub mute: u8,
    /// They answer what they are asked, and nothing that is written to them arrives.
    pub deaf: u8,
    /// They answer all that is written to them and keep what they have.
    pub stubborn: u8,
    /// They do what is written to them, and their answers to that do not arrive.
    pub unconfirmed: u8,
    /// Some of their answers arrive with two bits changed, and with a sum that is right.
    pub damaged: u8,
    /// They report an overload.
    pub overloaded: u8,
    /// Some of what is written to them arrives with two bits changed, and with a sum that is right: they do that.
    pub misled: u8,
    /// While they have torque they report to bear all the torque that they have, whatever their limit.
    pub strained: u8,
}

impl ServoFaults {
    /// Those of one servo, as masks of bit 0.
    fn of(&self, index: usize) -> Self {
        let bit = |mask: u8| mask.checked_shr(index as u32).unwrap_or(0) & 1;
        Self {
            silent: bit(self.silent),
            blocked: bit(self.blocked),
            mute: bit(self.mute),
            deaf: bit(self.deaf),
            stubborn: bit(self.stubborn),
            unconfirmed: bit(self.unconfirmed),
            damaged: bit(self.damaged),
            overloaded: bit(self.overloaded),
            misled: bit(self.misled),
            strained: bit(self.strained),
        }
    }
}

/// What one servo does, apart from all that it reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoState {
    /// Address.
    pub id: u8,
    /// Where the shaft is, steps: 2048 at angle 0.
    pub step: f32,
    /// Whether it has torque.
    pub has_torque: bool,
    /// The goal in force, steps.
    pub goal_step: u16,
    /// The torque limit in force, thousandths of the torque that it has.
    pub torque_limit: u16,
    /// Answers to questions that it has sent, each with its position or not.
    pub answers: u32,
    /// Its shaft cannot turn.
    pub is_blocked: bool,
    /// Requests that it has obeyed and that had been damaged on their way.
    pub misled: u32,
}

/// One servo.
#[derive(Clone, Debug)]
struct Servo {
    registers: [u8; register::COUNT],
    /// Joint angle = servo angle − offset.
    offset_rad: f32,
    position: f32,
    /// Where it rests beside its goal, steps.
    bend_steps: f32,
    answers: u32,
    misled: u32,
    /// How its last two damaged answers begin: with its position, as a rule.
    damaged: [[u8; 2]; 2],
    faults: ServoFaults,
}

impl Servo {
    fn new(id: u8, offset_rad: f32) -> Self {
        let position = CENTRE + offset_rad * SERVO_STEPS_PER_TURN / TAU;
        let mut registers = [0; register::COUNT];
        registers[..6].copy_from_slice(&[3, 10, 0, 9, 3, id]);
        registers[register::VOLTAGE] = 74;
        registers[register::TEMPERATURE] = 30;
        let (bend_steps, answers, misled, damaged) = (0.0, 0, 0, [[0; 2]; 2]);
        let faults = ServoFaults::default();
        let mut servo = Self { registers, offset_rad, position, bend_steps, answers, misled, damaged, faults };
        servo.set(register::TORQUE_LIMIT, 1000);
        servo.set(register::GOAL_POSITION, position as u16);
        servo.show(0.0);
        servo
    }

    fn id(&self) -> u8 {
        self.registers[register::ID]
    }

    /// Whether it does what is written to it, if it hears that at all.
    fn obeys(&self) -> bool {
        self.faults.deaf | self.faults.stubborn == 0
    }

    fn get(&self, at: usize) -> u16 {
        u16::from_le_bytes([self.registers[at], self.registers[at + 1]])
    }

    fn set(&mut self, at: usize, value: u16) {
        self.registers[at..at + 2].copy_from_slice(&value.to_le_bytes());
    }

    /// Steps to go; 0 without torque.
    fn away(&self) -> f32 {
        let torque = self.registers[register::TORQUE_ENABLE] == 1;
        if torque { f32::from(self.get(register::GOAL_POSITION)) + self.bend_steps - self.position } else { 0.0 }
    }

    fn is_blocked(&self) -> bool {
        self.faults.blocked != 0
    }

    fn is_moving(&self) -> bool {
        self.away() != 0.0 && !self.is_blocked()
    }

    fn state(&self) -> ServoState {
        ServoState {
            id: self.id(),
            step: self.position,
            has_torque: self.registers[register::TORQUE_ENABLE] == 1,
            goal_step: self.get(register::GOAL_POSITION),
            torque_limit: self.get(register::TORQUE_LIMIT),
            answers: self.answers,
            is_blocked: self.is_blocked(),
            misled: self.misled,
        }
    }

    fn advance(&mut self, span_s: f64) {
        let limit = match self.get(register::GOAL_SPEED) & 0x7FFF {
            0 => TOP_SPEED,
            limit => f32::from(limit).min(TOP_SPEED),
        };
        let step = limit * span_s as f32;
        let turned = if self.is_blocked() { 0.0 } else { self.away().clamp(-step, step) };
        self.position += turned;
        self.show(if self.is_moving() { limit.copysign(turned) } else { 0.0 });
    }

    /// Brings the readable registers up to date.
    fn show(&mut self, speed: f32) {
        let away = self.away();
        let load = match (away != 0.0, self.is_blocked()) {
            (false, _) => 0,
            (true, false) => FREE_LOAD,
            (true, true) => self.get(register::TORQUE_LIMIT).min(FULL_LOAD),
        };
        let is_strained = self.faults.strained != 0 && self.registers[register::TORQUE_ENABLE] == 1;
        let load = if is_strained { FULL_LOAD } else { load };
        let sign = |negative: bool, bit: u16| if negative { bit } else { 0 };
        self.set(register::PRESENT_POSITION, self.position.round().clamp(0.0, 4095.0) as u16);
        self.set(register::PRESENT_SPEED, speed.abs() as u16 | sign(speed < 0.0, 1 << 15));
        self.set(register::PRESENT_LOAD, load | sign(away < 0.0, LOAD_SIGN));
        self.registers[register::MOVING] = u8::from(self.is_moving());
    }

    fn angle_rad(&self) -> f32 {
        (self.position - CENTRE) * TAU / SERVO_STEPS_PER_TURN - self.offset_rad
    }

    fn read(&self, at: u8, count: u8) -> Option<&[u8]> {
        self.registers.get(usize::from(at)..usize::from(at) + usize::from(count))
    }

    fn write(&mut self, at: u8, bytes: &[u8]) {
        for (register, &byte) in (usize::from(at)..).zip(bytes) {
            if WRITABLE.contains(&register) {
                self.registers[register] = byte;
            }
        }
    }
}

/// The servos on the bus, along the chain of joints.
#[derive(Clone, Debug)]
pub struct ServoBus {
    servos: Vec<Servo>,
    /// Bytes of a packet that is not complete.
    pending: Vec<u8>,
    now_s: f64,
    /// Decides which answers are damaged, and where.
    noise: u64,
}

impl ServoBus {
    /// Servos with these addresses, each at joint angle 0; a missing offset is 0.
    pub fn new(ids: impl Iterator<Item = u8>, offsets_rad: &[f32]) -> Self {
        let offsets = offsets_rad.iter().copied().chain(std::iter::repeat(0.0));
        let servos = ids.zip(offsets).map(|(id, offset_rad)| Servo::new(id, offset_rad)).collect();
        Self { servos, pending: Vec::new(), now_s: 0.0, noise: 0x9e37_79b9_7f4a_7c15 }
    }

    /// Lets the servos turn until `now_s`.
    pub fn advance(&mut self, now_s: f64) {
        let span_s = (now_s - self.now_s).max(0.0);
        self.now_s = self.now_s.max(now_s);
        self.servos.iter_mut().for_each(|servo| servo.advance(span_s));
    }

    /// Takes bytes from the board and returns what the servos answer.
    pub fn receive(&mut self, now_s: f64, bytes: &[u8]) -> Vec<u8> {
        self.advance(now_s);
        self.pending.extend(bytes);
        let mut answers = Vec::new();
        while let Some(packet) = next_packet(&mut self.pending) {
            self.execute(&packet, &mut answers);
        }
        answers
    }

    /// Joint angles.
    pub fn angles_rad(&self) -> Vec<f32> {
        self.servos.iter().map(Servo::angle_rad).collect()
    }

    /// Whether a servo turns.
    pub fn is_moving(&self) -> bool {
        self.servos.iter().any(Servo::is_moving)
    }

    /// What each servo does.
    pub fn states(&self) -> impl Iterator<Item = ServoState> + '_ {
        self.servos.iter().map(Servo::state)
    }

    /// Another servo on the bus, at its middle.
    pub fn add(&mut self, id: u8) {
        self.servos.push(Servo::new(id, 0.0));
    }

    /// Where each servo rests beside its goal, steps; 0 for those that are not listed.
    pub fn bend(&mut self, steps: &[f32]) {
        for (servo, steps) in self.servos.iter_mut().zip(steps) {
            servo.bend_steps = *steps;
        }
    }

    /// Somebody turns this servo by this number of steps; where it is then, steps. `None` where it has torque.
    pub fn turn_by_hand(&mut self, index: usize, steps: f32) -> Option<f32> {
        let servo = self.servos.get_mut(index).filter(|servo| !servo.state().has_torque)?;
        servo.position += steps;
        Some(servo.position)
    }

    /// This servo lowers its torque limit by itself, as one does that protects itself, and keeps its goal.
    pub fn weaken(&mut self, index: usize) {
        if let Some(servo) = self.servos.get_mut(index) {
            servo.set(register::TORQUE_LIMIT, PROTECTED_TORQUE);
        }
    }

    /// Breaks and repairs servos, from now on.
    pub fn set_broken(&mut self, faults: ServoFaults) {
        for (index, servo) in self.servos.iter_mut().enumerate() {
            servo.faults = faults.of(index);
            servo.registers[register::STATUS] = if servo.faults.overloaded != 0 { OVERLOADED } else { 0 };
        }
    }

    fn servo(&mut self, id: u8) -> Option<&mut Servo> {
        self.servos.iter_mut().find(|servo| servo.id() == id && servo.faults.silent == 0)
    }

    fn execute(&mut self, packet: &Packet, answers: &mut Vec<u8>) {
        match (packet.instruction, packet.parameters.as_slice()) {
            (instruction::PING, []) => self.answer(packet.id, answers, |_| Some(&[])),
            (instruction::READ, &[at, count]) => self.answer(packet.id, answers, |servo| servo.read(at, count)),
            (instruction::WRITE, [at, bytes @ ..]) if packet.id == BROADCAST => {
                let hearing = |servo: &&mut Servo| servo.faults.silent == 0 && servo.obeys();
                self.servos.iter_mut().filter(hearing).for_each(|servo| servo.write(*at, bytes));
            }
            (instruction::WRITE, [at, bytes @ ..]) => {
                let bytes = self.heard(packet.id, bytes);
                self.answer(packet.id, answers, |servo| {
                    if servo.faults.deaf != 0 {
                        return None;
                    }
                    if servo.obeys() {
                        servo.write(*at, &bytes);
                    }
                    (servo.faults.unconfirmed == 0).then_some(&[])
                });
            }
            (instruction::SYNC_READ, [at, count, ids @ ..]) => {
                for &id in ids {
                    self.answer(id, answers, |servo| servo.read(*at, *count));
                }
            }
            (instruction::SYNC_WRITE, [at, count, rest @ ..]) => {
                for part in rest.chunks_exact(1 + usize::from(*count)) {
                    if let Some(servo) = self.servo(part[0]).filter(|servo| servo.obeys()) {
                        servo.write(*at, &part[1..]);
                    }
                }
            }
            _ => {}
        }
        self.servos.iter_mut().for_each(|servo| servo.advance(0.0));
    }

    /// What arrives of values that are written to the servo of this address.
    fn heard(&mut self, id: u8, bytes: &[u8]) -> Vec<u8> {
        let (mut heard, mut noise) = (bytes.to_vec(), self.noise);
        let Some(servo) = self.servo(id).filter(|servo| servo.faults.misled != 0 && servo.obeys()) else {
            return heard;
        };
        noise = scrambled(noise);
        if (noise >> 32).is_multiple_of(MISLED_IN) {
            damage(&mut heard, noise);
            servo.misled += u32::from(heard != bytes);
        }
        self.noise = noise;
        heard
    }

    /// Lets the servo of this address do something and answer.
    fn answer(&mut self, id: u8, answers: &mut Vec<u8>, act: impl FnOnce(&mut Servo) -> Option<&[u8]>) {
        let mut noise = self.noise;
        let Some(servo) = self.servo(id) else {
            return;
        };
        let status = servo.registers[register::STATUS];
        let Some(mut bytes) = act(servo).map(<[u8]>::to_vec).filter(|_| servo.faults.mute == 0) else { return };
        servo.answers = servo.answers.wrapping_add(1);
        if servo.faults.damaged != 0 {
            noise = scrambled(noise);
            if (noise >> 32).is_multiple_of(DAMAGED_IN) {
                servo.damage_answer(&mut bytes, noise);
            }
        }
        answers.extend(packet(id, status, &bytes));
        self.noise = noise;
    }
}

impl Servo {
    /// Damages an answer, but no third one in the same way: what a board promises of damaged answers holds for two that agree.
    fn damage_answer(&mut self, bytes: &mut Vec<u8>, noise: u64) {
        let mut damaged = bytes.clone();
        damage(&mut damaged, noise);
        let [own, other] = [&*bytes, &damaged].map(|bytes| bytes.first_chunk::<2>().copied().unwrap_or_default());
        if other == own || self.damaged != [other; 2] {
            self.damaged = if other == own { self.damaged } else { [self.damaged[1], other] };
            *bytes = damaged;
        }
    }
}

/// The next number of xorshift64.
fn scrambled(mut noise: u64) -> u64 {
    noise ^= noise << 13;
    noise ^= noise >> 7;
    noise ^ noise << 17
}

/// Changes one bit of two bytes in opposite directions, where two differ in it: the sum of the packet stays. Each such place is
/// as likely as any other.
fn damage(bytes: &mut [u8], noise: u64) {
    let bytes_of_bit = |bit: u8| (0..bytes.len()).map(move |first| (first, bit));
    let pairs = |(first, bit): (usize, u8)| (first + 1..bytes.len()).map(move |second| (first, second, bit));
    let differs = |&(first, second, bit): &(usize, usize, u8)| (bytes[first] ^ bytes[second]) >> bit & 1 == 1;
    let places: Vec<_> = (0..8).flat_map(bytes_of_bit).flat_map(pairs).filter(differs).collect();
    if let Some(&(first, second, bit)) = places.get((noise >> 3) as usize % places.len().max(1)) {
        bytes[first] ^= 1 << bit;
        bytes[second] ^= 1 << bit;
    }
}

/// The content of a complete request.
struct Packet {
    id: u8,
    instruction: u8,
    parameters: Vec<u8>,
}

/// Takes the first complete packet out; bytes that begin none are dropped.
fn next_packet(pending: &mut Vec<u8>) -> Option<Packet> {
    loop {
        let start = pending.windows(2).position(|pair| pair == [0xFF, 0xFF]);
        // The last byte may be the first of a header.
        pending.drain(..start.unwrap_or(pending.len().saturating_sub(1)));
        let len = usize::from(*pending.get(3)?);
        let end = 4 + len;
        if pending[2] == 0xFF || len < 2 {
            pending.drain(..1);
            continue;
        }
        let body = pending.get(2..end)?;
        if check(&body[..body.len() - 1]) != body[body.len() - 1] {
            pending.drain(..1);
            continue;
        }
        let packet = Packet { id: body[0], instruction: body[2], parameters: body[3..body.len() - 1].to_vec() };
        pending.drain(..end);
        return Some(packet);
    }
}

/// A packet with its header and checksum.
fn packet(id: u8, kind: u8, parameters: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0xFF, 0xFF, id, parameters.len() as u8 + 2, kind];
    bytes.extend(parameters);
    bytes.push(check(&bytes[2..]));
    bytes
}

fn check(body: &[u8]) -> u8 {
    !body.iter().fold(0u8, |sum, &byte| sum.wrapping_add(byte))
}

#[cfg(test)]
mod tests {
    use super::{ServoBus, ServoFaults, instruction, packet};

    fn bus() -> ServoBus {
        ServoBus::new([1, 2].into_iter(), &[])
    }

    /// Torque on and a goal of 2048 + 1024 steps, a quarter turn, at 1024 steps/s.
    fn quarter_turn(bus: &mut ServoBus) {
        bus.receive(0.0, &packet(1, instruction::WRITE, &[40, 1]));
        bus.receive(0.0, &packet(1, instruction::WRITE, &[42, 0, 12, 0, 0, 0, 4]));
    }

    #[test]
    fn ping_is_answered_as_the_manual_says() {
        // "FF FF 01 02 01 FB" and "FF FF 01 02 00 FC": the manual's own example.
        let ping = [0xFF, 0xFF, 1, 2, 1, 0xFB];
        assert_eq!(bus().receive(0.0, &ping), [0xFF, 0xFF, 1, 2, 0, 0xFC]);
        assert!(bus().receive(0.0, &packet(9, instruction::PING, &[])).is_empty());
    }

    #[test]
    fn a_servo_turns_at_its_speed() {
        let mut bus = bus();
        quarter_turn(&mut bus);
        bus.advance(0.5);
        assert!(bus.is_moving());
        assert_eq!(bus.receive(0.5, &packet(1, instruction::READ, &[56, 2]))[5..7], (2048u16 + 512).to_le_bytes());
        bus.advance(1.01);
        assert!(!bus.is_moving());
        assert!((bus.angles_rad()[0] - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
        assert_eq!(bus.angles_rad()[1], 0.0);
    }

    #[test]
    fn noise_and_damaged_packets_are_passed_over() {
        let mut bus = bus();
        let mut bytes = vec![0x00, 0xFF, 0x13];
        let mut damaged = packet(1, instruction::PING, &[]);
        damaged[5] ^= 1;
        bytes.extend(damaged);
        bytes.extend(packet(2, instruction::PING, &[]));
        let answers: Vec<u8> = bytes.iter().flat_map(|&byte| bus.receive(0.0, &[byte])).collect();
        assert_eq!(answers, packet(2, 0, &[]));
    }

    #[test]
    fn all_servos_answer_in_turn() {
        let answers = bus().receive(0.0, &packet(0xFE, instruction::SYNC_READ, &[56, 2, 2, 1]));
        assert_eq!(answers, [packet(2, 0, &[0, 8]), packet(1, 0, &[0, 8])].concat());
    }

    #[test]
    fn a_blocked_servo_bears_its_torque_and_a_silent_one_is_silent() {
        let mut bus = bus();
        quarter_turn(&mut bus);
        bus.set_broken(ServoFaults { silent: 0b10, blocked: 0b01, ..ServoFaults::default() });
        bus.advance(1.0);
        assert_eq!(bus.angles_rad()[0], 0.0);
        assert_eq!(bus.receive(1.0, &packet(1, instruction::READ, &[60, 2]))[5..7], 1000u16.to_le_bytes());
        assert!(bus.receive(1.0, &packet(2, instruction::PING, &[])).is_empty());
    }

    #[test]
    fn without_torque_nothing_turns() {
        let mut bus = bus();
        bus.receive(0.0, &packet(1, instruction::WRITE, &[42, 0, 12]));
        bus.advance(1.0);
        assert!(!bus.is_moving() && bus.angles_rad()[0] == 0.0);
    }

    fn broken(faults: ServoFaults) -> ServoBus {
        let mut bus = bus();
        bus.set_broken(faults);
        bus
    }

    #[test]
    fn a_mute_servo_turns_a_deaf_or_stubborn_one_answers_and_an_unconfirmed_write_acts() {
        let mut mute = broken(ServoFaults { mute: 1, ..ServoFaults::default() });
        quarter_turn(&mut mute);
        assert!(mute.is_moving() && mute.states().next().is_some_and(|state| state.answers == 0));
        let mut deaf = broken(ServoFaults { deaf: 1, ..ServoFaults::default() });
        quarter_turn(&mut deaf);
        assert!(!deaf.is_moving());
        assert!(!deaf.receive(0.0, &packet(1, instruction::READ, &[56, 2])).is_empty());
        let mut stubborn = broken(ServoFaults { stubborn: 1, ..ServoFaults::default() });
        quarter_turn(&mut stubborn);
        assert!(!stubborn.is_moving());
        assert!(!stubborn.receive(0.0, &packet(1, instruction::WRITE, &[40, 1])).is_empty());
        let mut unconfirmed = broken(ServoFaults { unconfirmed: 1, ..ServoFaults::default() });
        assert!(unconfirmed.receive(0.0, &packet(1, instruction::WRITE, &[40, 1])).is_empty());
        assert!(unconfirmed.states().next().is_some_and(|state| state.has_torque));
    }

    #[test]
    fn a_damaged_answer_has_another_position_and_a_sum_that_is_right() {
        let mut bus = broken(ServoFaults { damaged: 1, ..ServoFaults::default() });
        let read = packet(1, instruction::READ, &[56, 6]);
        let answers: Vec<Vec<u8>> = (0..60).map(|_| bus.receive(0.0, &read)).collect();
        assert!(answers.iter().all(|answer| answer[5 + 6] == super::check(&answer[2..5 + 6])));
        let other = answers.iter().filter(|answer| answer[5..7] != [0, 8]).count();
        assert!((5..40).contains(&other), "{other} of 60");
        let damaged: Vec<&[u8]> = answers.iter().map(|answer| &answer[5..7]).filter(|place| *place != [0, 8]).collect();
        assert!(damaged.windows(3).all(|three| three[0] != three[1] || three[1] != three[2]), "no three agree");
    }

    #[test]
    fn a_damaged_request_is_obeyed_as_it_arrives_and_counted() {
        let mut bus = broken(ServoFaults { misled: 1, ..ServoFaults::default() });
        let written = [1, 0, 0, 12, 0, 0, 0, 1, 232, 3];
        let mut others = 0;
        for _ in 0..40 {
            let answer = bus.receive(0.0, &packet(1, instruction::WRITE, &[&[40][..], &written].concat()));
            assert_eq!(answer, packet(1, 0, &[]), "it answers that all is well");
            others += u32::from(bus.receive(0.0, &packet(1, instruction::READ, &[40, 10]))[5..15] != written);
        }
        assert!((8..32).contains(&others), "{others} of 40");
        assert_eq!(bus.states().next().map(|state| state.misled), Some(others));
    }

    #[test]
    fn a_load_bends_a_servo_that_has_torque() {
        let mut bus = bus();
        bus.bend(&[-4.0]);
        bus.advance(0.1);
        assert_eq!(bus.states().next().map(|state| state.step), Some(2048.0));
        quarter_turn(&mut bus);
        bus.advance(2.0);
        assert_eq!(bus.states().next().map(|state| state.step), Some(2048.0 + 1024.0 - 4.0));
    }

    #[test]
    fn a_strained_servo_reports_all_its_torque_as_load() {
        let mut bus = broken(ServoFaults { strained: 1, ..ServoFaults::default() });
        assert_eq!(bus.receive(0.0, &packet(1, instruction::READ, &[60, 2]))[5..7], [0, 0], "it has no torque");
        quarter_turn(&mut bus);
        bus.advance(0.5);
        assert_eq!(bus.receive(0.5, &packet(1, instruction::READ, &[60, 2]))[5..7], 1000u16.to_le_bytes());
    }

    #[test]
    fn an_overload_is_in_the_status_of_each_answer() {
        let mut bus = broken(ServoFaults { overloaded: 0b10, ..ServoFaults::default() });
        assert_eq!(bus.receive(0.0, &packet(2, instruction::PING, &[])), packet(2, 32, &[]));
        assert_eq!(bus.receive(0.0, &packet(1, instruction::PING, &[])), packet(1, 0, &[]));
    }
}
