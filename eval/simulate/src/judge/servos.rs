//! Judge 1, the servo bus: goals within the range, speeds, no motion that nobody requested, silence that is noticed.
//!
//! Packets: `FF FF id n code parameters… sum`. Registers from 40 on: torque, acceleration, goal position (42, 43), time,
//! speed (46, 47), torque limit (48, 49); from 56 on: present position. Source: Feetech, STS3215 memory table.

use super::{Ceilings, ServoCeiling, Verdict};

const JUDGE: &str = "pins";
const WRITE: u8 = 3;
const READ: u8 = 2;
const TORQUE: u8 = 40;
const GOAL: u8 = 42;
const SPEED: u8 = 46;
const PRESENT: u8 = 56;
/// A goal this near to a position that was seen lately holds it and moves nothing, steps: 1.4°.
const HOLD_STEPS: u16 = 16;
/// A servo is on its way beyond this distance from its goal, steps: 0.1 rad, more than any that holds gives way.
const UNDER_WAY_STEPS: u16 = 65;
/// A goal is the requested one when it is this near, steps.
const GOAL_STEPS: u16 = 2;
/// A silent servo is noticed within this time after its time-out, in board time: two ticks.
const NOTICE_MS: u64 = 3;

/// What the bus has shown of one servo.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    answered_ns: Option<u64>,
    present: Option<i16>,
    /// Since when it is driven.
    driven_ns: Option<u64>,
    goal: Option<i16>,
}

/// The judge's memory.
pub struct Servos {
    ceilings: Ceilings,
    seen: [Seen; 256],
    /// Joint angles that were requested, by any command or table, rad.
    asked_rad: Vec<f32>,
    /// Zero offsets that somebody has set, rad: what is added to a joint angle.
    offsets_rad: Vec<f32>,
    to_servos: Vec<u8>,
    to_board: Vec<u8>,
    /// The register that was last read from each servo.
    reads: [u8; 256],
    verdict: Verdict,
}

/// A packet.
struct Packet {
    id: u8,
    code: u8,
    parameters: Vec<u8>,
}

impl Servos {
    /// A bus on which nothing was said.
    pub fn new(ceilings: Ceilings) -> Self {
        Self {
            ceilings,
            seen: [Seen::default(); 256],
            asked_rad: Vec::new(),
            offsets_rad: vec![0.0],
            to_servos: Vec::new(),
            to_board: Vec::new(),
            reads: [0; 256],
            verdict: Verdict::default(),
        }
    }

    /// This joint angle is requested: a motion to it has a cause, whatever becomes of it.
    pub fn on_asked(&mut self, angle_rad: f32) {
        if !self.asked_rad.contains(&angle_rad) {
            self.asked_rad.push(angle_rad);
        }
    }

    /// Somebody sets this zero offset, for whichever servo.
    pub fn on_offset(&mut self, offset_rad: f32) {
        if !self.offsets_rad.contains(&offset_rad) {
            self.offsets_rad.push(offset_rad);
        }
    }

    /// Whether a goal is a requested joint angle, with an offset that was set.
    fn is_asked(&self, goal: i16) -> bool {
        let step = |shaft_rad: f32| (shaft_rad * (4096.0 / std::f32::consts::TAU) + 2048.5).clamp(0.0, 4095.0) as i16;
        let near = |shaft_rad: f32| step(shaft_rad).abs_diff(goal) <= GOAL_STEPS;
        self.asked_rad.iter().any(|angle| self.offsets_rad.iter().any(|offset| near(angle + offset)))
    }

    /// The firmware starts again and knows no position.
    pub fn on_start(&mut self) {
        for seen in &mut self.seen {
            *seen = Seen { goal: seen.goal, ..Seen::default() };
        }
        self.to_servos.clear();
        self.to_board.clear();
    }

    /// Whether a driven servo is on its way to a goal: its address and how far it has to go, steps.
    pub fn moving(&self) -> Option<(u8, u16)> {
        self.ceilings.servos.iter().find_map(|servo| {
            let seen = &self.seen[usize::from(servo.id)];
            let away = seen.goal?.abs_diff(seen.present?);
            (seen.driven_ns.is_some() && away > HOLD_STEPS).then_some((servo.id, away))
        })
    }

    /// Address, goal and position of each driven servo.
    pub fn goals(&self) -> Vec<(u8, i16, i16)> {
        let of = |servo: &ServoCeiling| {
            let Seen { goal, present, driven_ns, .. } = self.seen[usize::from(servo.id)];
            Some((servo.id, driven_ns.and(goal)?, present?))
        };
        self.ceilings.servos.iter().filter_map(of).collect()
    }

    /// Nothing but a calibration came since the servos had these goals: each keeps its goal or holds where it was.
    pub fn on_calibrated(&mut self, now_ns: u64, before: &[(u8, i16, i16)]) {
        for (id, goal, _) in self.goals() {
            let Some(&(_, old_goal, present)) = before.iter().find(|before| before.0 == id) else { continue };
            if goal != old_goal && goal.abs_diff(present) > HOLD_STEPS {
                self.verdict.note(JUDGE, "calibration-moves", now_ns, || {
                    format!("a calibration sent servo {id} from step {present} to step {goal}")
                });
            }
        }
    }

    /// Bytes on the bus.
    pub fn on_bytes(&mut self, now_ns: u64, to_servos: bool, bytes: &[u8]) {
        let pending = if to_servos { &mut self.to_servos } else { &mut self.to_board };
        pending.extend(bytes);
        while let Some(packet) = next_packet(if to_servos { &mut self.to_servos } else { &mut self.to_board }) {
            match packet.code {
                WRITE if to_servos => self.on_write(now_ns, &packet),
                READ if to_servos => {
                    self.reads[usize::from(packet.id)] = packet.parameters.first().copied().unwrap_or(0)
                }
                _ if to_servos => {}
                _ => self.on_answer(now_ns, &packet),
            }
        }
    }

    /// For this time the flash lets nothing run, so that no servo is asked: it does not count as silence, and nobody would see
    /// what a servo does that is on its way.
    pub fn on_pause(&mut self, now_ns: u64, span_ns: u64) {
        if let Some((id, steps)) = self.moving().filter(|(_, steps)| *steps > UNDER_WAY_STEPS) {
            self.verdict.note(JUDGE, "flash-under-motion", now_ns, || {
                format!("servo {id} is {steps} steps from its goal while the flash lets no control tick run")
            });
        }
        for seen in &mut self.seen {
            seen.answered_ns = seen.answered_ns.map(|at_ns| at_ns + span_ns);
        }
    }

    /// The end of a tick in which any line was on: a driven servo that has fallen silent must have been noticed.
    pub fn on_lines_on(&mut self, now_ns: u64) {
        for index in 0..self.ceilings.servos.len() {
            let ServoCeiling { id, timeout_ms, .. } = self.ceilings.servos[index];
            let Seen { answered_ns: Some(answered_ns), driven_ns: Some(driven_ns), .. } = self.seen[usize::from(id)]
            else {
                continue;
            };
            let silent_ns = now_ns - answered_ns.max(driven_ns);
            if silent_ns > self.ceilings.true_ns(u64::from(timeout_ms) + NOTICE_MS) {
                self.verdict.note(JUDGE, "servo-silence", now_ns, || {
                    format!("servo {id} is driven and silent for {} ms and lines are on", silent_ns / 1_000_000)
                });
            }
        }
    }

    /// The end of the run.
    pub fn finish(self) -> Verdict {
        self.verdict
    }

    fn on_answer(&mut self, now_ns: u64, packet: &Packet) {
        let seen = &mut self.seen[usize::from(packet.id)];
        seen.answered_ns = Some(now_ns);
        if let (PRESENT, [low, high, ..]) = (self.reads[usize::from(packet.id)], packet.parameters.as_slice()) {
            seen.present = Some(position([*low, *high]));
        }
    }

    fn on_write(&mut self, now_ns: u64, packet: &Packet) {
        let register = |at: u8| {
            let (first, values) = packet.parameters.split_first()?;
            values.get(usize::from(at.checked_sub(*first)?)).copied()
        };
        let pair = |at: u8| Some([register(at)?, register(at + 1)?]);
        let seen = &mut self.seen[usize::from(packet.id)];
        match register(TORQUE) {
            Some(0) => seen.driven_ns = None,
            Some(_) => seen.driven_ns = Some(seen.driven_ns.unwrap_or(now_ns)),
            None => {}
        }
        seen.goal = pair(GOAL).map(position).or(seen.goal);
        let seen = *seen;
        let id = packet.id;
        if register(TORQUE).is_some_and(|torque| torque != 0) && seen.present.is_none() {
            self.verdict.note(JUDGE, "torque-unseen", now_ns, || {
                format!("servo {id} gets torque and its position was never read")
            });
        }
        if let Some(goal) = pair(GOAL).map(position) {
            self.check_goal(now_ns, id, goal, &seen);
        }
        if let Some(speed) = pair(SPEED).map(u16::from_le_bytes) {
            self.check_speed(now_ns, id, speed);
        }
    }

    fn ceiling(&self, id: u8) -> Option<ServoCeiling> {
        self.ceilings.servos.iter().copied().find(|servo| servo.id == id)
    }

    fn check_goal(&mut self, now_ns: u64, id: u8, goal: i16, seen: &Seen) {
        match self.ceiling(id) {
            None => {
                self.verdict.note(JUDGE, "servo-wiring", now_ns, || format!("servo {id} is driven and does not exist"))
            }
            Some(servo) if !(servo.min_step..=servo.max_step).contains(&goal) => {
                let (min, max) = (servo.min_step, servo.max_step);
                self.verdict.note(JUDGE, "servo-range", now_ns, || {
                    format!("servo {id} is sent to step {goal}, allowed are {min} to {max}")
                });
            }
            Some(_) => {}
        }
        let holds = seen.present.is_some_and(|present| present.abs_diff(goal) <= HOLD_STEPS);
        if !holds && !self.is_asked(goal) {
            self.verdict.note(JUDGE, "unasked-goal", now_ns, || {
                format!("servo {id} is sent to step {goal}, which nobody requested; it was seen at {:?}", seen.present)
            });
        }
    }

    fn check_speed(&mut self, now_ns: u64, id: u8, speed: u16) {
        let Some(servo) = self.ceiling(id) else { return };
        // 0 means the servo's own largest speed.
        if speed == 0 || speed > servo.max_steps_s {
            let max = servo.max_steps_s;
            self.verdict.note(JUDGE, "servo-speed", now_ns, || {
                format!("servo {id} is sent at {speed} steps/s, allowed are 1 to {max}")
            });
        }
    }
}

/// Takes the first valid packet out; bytes that begin none are dropped.
fn next_packet(bytes: &mut Vec<u8>) -> Option<Packet> {
    loop {
        let start = bytes.windows(2).position(|pair| pair == [0xff, 0xff]);
        bytes.drain(..start.unwrap_or(bytes.len().saturating_sub(1)));
        let (&id, &n) = (bytes.get(2)?, bytes.get(3)?);
        let end = 4 + usize::from(n);
        let plausible = id != 0xff && (2..=30).contains(&n);
        if plausible && bytes.len() < end {
            return None;
        }
        let sum = plausible.then(|| bytes[2..end - 1].iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte)));
        if sum.is_none_or(|sum| !sum != bytes[end - 1]) {
            bytes.drain(..1);
            continue;
        }
        let packet = Packet { id, code: bytes[4], parameters: bytes[5..end - 1].to_vec() };
        bytes.drain(..end);
        return Some(packet);
    }
}

/// A position register: its sign is the highest bit.
fn position(register: [u8; 2]) -> i16 {
    let register = u16::from_le_bytes(register);
    let steps = (register & 0x7fff) as i16;
    if register >> 15 == 1 { -steps } else { steps }
}

#[cfg(test)]
mod tests {
    use super::super::{Ceilings, ServoCeiling};
    use super::Servos;

    fn packet(id: u8, code: u8, parameters: &[u8]) -> Vec<u8> {
        let body: Vec<u8> = [&[id, parameters.len() as u8 + 2, code], parameters].concat();
        let sum = !body.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
        [&[0xff, 0xff], body.as_slice(), &[sum]].concat()
    }

    fn goal(step: u16, speed: u16) -> Vec<u8> {
        let ([p0, p1], [s0, s1]) = (step.to_le_bytes(), speed.to_le_bytes());
        packet(1, 3, &[40, 1, 0, p0, p1, 0, 0, s0, s1, 100, 0])
    }

    /// The judge of one servo.
    fn judge() -> Servos {
        let servos = vec![ServoCeiling { id: 1, min_step: 1000, max_step: 3000, max_steps_s: 500, timeout_ms: 100 }];
        Servos::new(Ceilings { lines: [None; 64], servos, new_loads: 1, budget_ms: 10, refresh_ms: 100, clock_ppm: 0 })
    }

    /// A servo that was seen at a register of position and is sent somewhere.
    fn rules(seen: Option<u16>, asked_rad: f32, step: u16, speed: u16) -> Vec<&'static str> {
        let mut judge = judge();
        judge.on_asked(asked_rad);
        judge.on_bytes(0, true, &packet(1, 2, &[56, 6]));
        if let Some([low, high]) = seen.map(u16::to_le_bytes) {
            judge.on_bytes(1, false, &packet(1, 0, &[low, high, 0, 0, 0, 0]));
        }
        judge.on_bytes(2, true, &goal(step, speed));
        judge.finish().firsts().iter().map(|(first, _)| first.rule).collect()
    }

    #[test]
    fn each_rule_is_seen_and_only_where_it_is_broken() {
        const MIDDLE: Option<u16> = Some(2048);
        assert!(rules(MIDDLE, 0.0, 2050, 500).is_empty());
        assert!(rules(MIDDLE, 1.0, 2048 + 652, 1).is_empty());
        assert_eq!(rules(None, 0.0, 2048, 500), ["torque-unseen"]);
        assert_eq!(rules(MIDDLE, 2.0, 2048 + 1304, 500), ["servo-range"]);
        assert_eq!(rules(MIDDLE, 0.0, 2500, 500), ["unasked-goal"]);
        assert_eq!(rules(Some(2500), 0.0, 2500, 500), [] as [&str; 0], "it holds");
        assert_eq!(rules(Some(2500 | 1 << 15), 0.0, 2500, 500), ["unasked-goal"], "seen at -2500");
        assert_eq!(rules(MIDDLE, 0.0, 2048, 0), ["servo-speed"]);
        assert_eq!(rules(MIDDLE, 0.0, 2048, 501), ["servo-speed"]);
    }

    #[test]
    fn a_goal_that_a_calibration_changes_is_seen() {
        for (after, broken) in [(2100, false), (2050, false), (2140, true)] {
            let mut judge = judge();
            judge.on_bytes(0, true, &packet(1, 2, &[56, 6]));
            judge.on_bytes(0, false, &packet(1, 0, &[0, 8, 0, 0, 0, 0]));
            judge.on_bytes(1, true, &goal(2100, 9));
            let before = judge.goals();
            judge.on_bytes(2, true, &goal(after, 9));
            judge.on_calibrated(3, &before);
            assert_eq!(judge.verdict.has("calibration-moves"), broken, "goal {after}");
        }
    }

    #[test]
    fn silence_of_a_driven_servo_is_seen() {
        let mut judge = judge();
        judge.on_bytes(0, true, &packet(1, 2, &[56, 6]));
        judge.on_bytes(0, false, &packet(1, 0, &[0, 8, 0, 0, 0, 0]));
        judge.on_bytes(0, true, &goal(2048, 9));
        judge.on_pause(0, 45_000_000);
        judge.on_lines_on(148_000_000);
        assert!(!judge.verdict.has("servo-silence"), "a pause does not count");
        judge.on_lines_on(148_000_001);
        assert!(judge.verdict.has("servo-silence"));
    }

    #[test]
    fn a_servo_on_its_way_while_the_flash_lets_nothing_run_is_seen() {
        for (steps, broken) in [(60, false), (70, true)] {
            let mut judge = judge();
            judge.on_bytes(0, true, &packet(1, 2, &[56, 6]));
            judge.on_bytes(0, false, &packet(1, 0, &[0, 8, 0, 0, 0, 0]));
            judge.on_bytes(1, true, &goal(2048 + steps, 9));
            judge.on_pause(2, 1_000_000);
            assert_eq!(judge.verdict.has("flash-under-motion"), broken, "{steps} steps");
        }
    }
}
