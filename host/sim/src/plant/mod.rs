//! The plant: what hangs on the board's pins. Output lines in, limit switches and servo answers out.
//!
//! ```text
//!  pin edges ─► chain ─► lines ─► coils ─► actuators ─► limit switches ─► input pins
//!  bytes of the bus ─► servo_bus ─► angles, answers
//!                                    └─► state ─► camera
//! ```
//!
//! [`Plant`] knows nothing of the emulator: [`crate::follow`] drives it by the pins of the real image in real time, and
//! [`crate::in_process`] by the firmware library in virtual time. Time comes in as an argument.

mod actuator;
pub mod camera;
pub mod chain;
mod coil;
pub mod servo_bus;

use darm_core::output::Wiring;
use darm_core::units::Word;

use actuator::Actuator;
use coil::Coil;
use servo_bus::{ServoBus, ServoFaults, ServoState};

/// An actuator reaches its stop within this share of the longest travel that the board waits for, where no other is set.
const TRAVEL_SHARE: f64 = 0.25;

/// A loose contact is closed for this time, then open for as long.
const LOOSE_CONTACT_S: f64 = 0.03;

/// What is broken in the plant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Broken {
    /// Output lines that are always high.
    pub lines_high: u64,
    /// Output lines that are always low.
    pub lines_low: u64,
    /// Limit switches that are always closed.
    pub switches_closed: u32,
    /// Limit switches that are always open.
    pub switches_open: u32,
    /// Output lines whose drivers are inverted: the coil carries current while the line is low.
    pub lines_inverted: u64,
    /// Output lines that are joined: one that is high makes all of them high.
    pub lines_joined: u64,
    /// Inputs that are joined: one switch that is closed closes all of them.
    pub switches_joined: u32,
    /// Inputs with a loose contact: a closed switch opens again and again.
    pub switches_loose: u32,
    /// Servos that give no answer: bit `i` is servo joint `i`.
    pub servos_silent: u8,
    /// Servos that cannot turn.
    pub servos_blocked: u8,
    /// Further faults of the servos; a servo is silent or blocked where either field says so.
    pub servos: ServoFaults,
}

impl Broken {
    /// Levels at the coils for these levels of the output lines.
    fn lines(&self, lines: u64) -> u64 {
        let joined = if lines & self.lines_joined == 0 { lines } else { lines | self.lines_joined };
        (joined ^ self.lines_inverted) & !self.lines_low | self.lines_high
    }

    /// Levels of the inputs while these switches are closed.
    fn switches(&self, now_s: f64, closed: u32) -> u32 {
        let joined = if closed & self.switches_joined == 0 { closed } else { closed | self.switches_joined };
        let loose = if ((now_s / LOOSE_CONTACT_S) as u64).is_multiple_of(2) { 0 } else { self.switches_loose };
        (joined & !loose | self.switches_closed) & !self.switches_open
    }
}

/// Where the arm's actuators are.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantState {
    /// The stops where the actuators rest, or rested last while they travel.
    pub reached: Word,
    /// The stops where they rested before the last motion began.
    pub previous: Word,
    /// Joint angles of the servos.
    pub servos_rad: Vec<f32>,
    /// Whether an actuator is between two stops or a servo turns.
    pub moving: bool,
    /// When all came to rest; the time of the question while something moves.
    pub settled_s: f64,
}

/// Everything that hangs on the board.
#[derive(Clone, Debug)]
pub struct Plant {
    coils: Vec<Coil>,
    actuators: Vec<Actuator>,
    /// Number of coils of each actuator, along the chain.
    coils_each: Vec<usize>,
    bus: ServoBus,
    lines: u64,
    broken: Broken,
    previous: Word,
    was_moving: bool,
    settled_s: f64,
    now_s: f64,
}

impl Plant {
    /// A plant wired like this, every actuator at rest in state 0 and every servo at `servo_offsets_rad` of its joint:
    /// joint angle = servo angle − offset. Missing offsets are 0.
    pub fn new(wiring: &Wiring, servo_offsets_rad: &[f32]) -> Self {
        let travel_s = |travel_ms: u16| TRAVEL_SHARE * 1e-3 * f64::from(travel_ms);
        let actuators = wiring.actuators.iter();
        let mut plant = Self {
            coils: wiring.coils.iter().map(|coil| Coil::new(coil.drive)).collect(),
            actuators: actuators.clone().map(|wired| Actuator::new(travel_s(wired.travel_ms), wired.switch)).collect(),
            coils_each: actuators.map(|wired| wired.coils()).collect(),
            bus: ServoBus::new(wiring.servos.iter().map(|servo| servo.id), servo_offsets_rad),
            lines: 0,
            broken: Broken::default(),
            previous: Word::default(),
            was_moving: false,
            settled_s: 0.0,
            now_s: 0.0,
        };
        plant.previous = plant.word();
        plant
    }

    /// Breaks or repairs something, from now on.
    pub fn set_broken(&mut self, now_s: f64, broken: Broken) {
        self.advance(now_s);
        self.broken = broken;
        let ServoFaults { silent, blocked, .. } = broken.servos;
        let (silent, blocked) = (silent | broken.servos_silent, blocked | broken.servos_blocked);
        self.bus.set_broken(ServoFaults { silent, blocked, ..broken.servos });
        self.drive();
    }

    /// Puts a servo on the bus that the wiring does not have.
    pub fn add_servo(&mut self, id: u8) {
        self.bus.add(id);
    }

    /// The actuators need this share of the longest travel that the board waits for.
    pub fn set_travel_share(&mut self, share: f64) {
        self.actuators.iter_mut().for_each(|actuator| actuator.scale_travel(share / TRAVEL_SHARE));
    }

    /// This servo lowers its torque limit by itself.
    pub fn weaken_servo(&mut self, index: usize) {
        self.bus.weaken(index);
    }

    /// Lets loads bend the servos: where each rests beside its goal, steps.
    pub fn bend_servos(&mut self, steps: &[f32]) {
        self.bus.bend(steps);
    }

    /// Somebody turns this servo by this number of steps; where it is then, steps. `None` where it has torque.
    pub fn turn_by_hand(&mut self, index: usize, steps: f32) -> Option<f32> {
        self.bus.turn_by_hand(index, steps)
    }

    /// What each servo of the bus does, apart from what it reports.
    pub fn servos(&self) -> impl Iterator<Item = ServoState> + '_ {
        self.bus.states()
    }

    /// What is broken.
    pub fn broken(&self) -> Broken {
        self.broken
    }

    /// The output lines of the chain have these levels from `now_s` on.
    pub fn set_lines(&mut self, now_s: f64, lines: u64) {
        self.advance(now_s);
        self.lines = lines;
        self.drive();
    }

    /// Levels of the output lines; none is high while the outputs are disabled.
    pub fn lines(&self) -> u64 {
        self.lines
    }

    /// Bytes came on the servo bus; the bytes that the servos answer.
    pub fn servo_bytes(&mut self, now_s: f64, bytes: &[u8]) -> Vec<u8> {
        self.advance(now_s);
        self.bus.receive(now_s, bytes)
    }

    /// Lets time pass, event by event. Time never runs backwards: an earlier time counts as the latest one seen.
    pub fn advance(&mut self, now_s: f64) {
        while let Some(event_s) = self.next_event_s().filter(|&event_s| event_s <= now_s) {
            self.step(event_s);
        }
        self.step(now_s);
    }

    /// When something happens next if nothing comes in.
    pub fn next_event_s(&self) -> Option<f64> {
        let coils = self.coils.iter().filter_map(Coil::next_event_s);
        coils.chain(self.actuators.iter().filter_map(Actuator::next_event_s)).reduce(f64::min)
    }

    /// Limit switches: bit `i` is input `i`, set when closed.
    pub fn switches(&self) -> u32 {
        let closed = self.actuators.iter().fold(0, |bits, actuator| bits | actuator.switch_bit());
        self.broken.switches(self.now_s, closed)
    }

    /// Where everything is now.
    pub fn state(&self) -> PlantState {
        let moving = self.is_moving();
        PlantState {
            reached: self.word(),
            previous: self.previous,
            servos_rad: self.bus.angles_rad(),
            moving,
            settled_s: if moving { self.now_s } else { self.settled_s },
        }
    }

    fn step(&mut self, now_s: f64) {
        self.now_s = now_s.max(self.now_s);
        self.coils.iter_mut().for_each(|coil| coil.advance(now_s));
        self.actuators.iter_mut().for_each(|actuator| actuator.advance(now_s));
        self.bus.advance(self.now_s);
        self.drive();
        let moving = self.is_moving();
        if self.was_moving && !moving {
            self.settled_s = self.now_s;
        }
        self.was_moving = moving;
    }

    /// Lets the lines act on the coils and the coils on the actuators.
    fn drive(&mut self) {
        let lines = self.broken.lines(self.lines);
        let (now_s, resting) = (self.now_s, !self.actuators.iter().any(Actuator::is_moving));
        let before = self.word();
        let mut coils = self.coils.iter_mut();
        for (actuator, &count) in self.actuators.iter_mut().zip(&self.coils_each) {
            let mut digit = 0;
            for (bit, coil) in coils.by_ref().take(count).enumerate() {
                coil.set_lines(now_s, lines);
                digit |= u8::from(coil.pulled()) << bit;
            }
            actuator.drive(now_s, digit);
        }
        if resting && self.actuators.iter().any(Actuator::is_moving) {
            self.previous = before;
        }
    }

    fn is_moving(&self) -> bool {
        self.actuators.iter().any(Actuator::is_moving) || self.bus.is_moving()
    }

    fn word(&self) -> Word {
        let digits: Vec<u8> = self.actuators.iter().map(Actuator::digit).collect();
        Word::new(&digits).expect("at most 48 actuators of at most four states are wired")
    }
}

#[cfg(test)]
mod tests {
    use darm_core::output::{ActuatorWiring, Coil, Drive, LimitSwitch, Wiring};

    use super::{Broken, Plant};

    /// `count` binary valves on lines 0.., each with a switch that is closed in state 1.
    fn valves(count: u8) -> Wiring {
        let mut wiring = Wiring::default();
        for index in 0..count {
            let drive = Drive::Hold { line: index };
            let switch = Some(LimitSwitch { input: index, closed_in: 0b10 });
            wiring.coils.push(Coil { output: index, drive, limit: drive.default_limit() }).unwrap();
            wiring.actuators.push(ActuatorWiring { states: 2, switch, travel_ms: 100 }).unwrap();
        }
        wiring
    }

    #[test]
    fn lines_move_actuators_and_switches_after_the_travel() {
        let mut plant = Plant::new(&valves(3), &[]);
        plant.set_lines(1.0, 0b101);
        plant.advance(1.024);
        assert!(plant.state().moving && plant.switches() == 0);
        plant.advance(1.5);
        let state = plant.state();
        assert_eq!((state.reached.to_string(), state.previous.to_string()), ("101".into(), "000".into()));
        assert_eq!(plant.switches(), 0b101);
        assert!(!state.moving && (state.settled_s - 1.025).abs() < 1e-9, "{state:?}");
    }

    #[test]
    fn two_waves_of_one_motion_keep_the_word_before_it() {
        let mut plant = Plant::new(&valves(3), &[]);
        plant.set_lines(1.0, 0b001);
        plant.set_lines(2.0, 0b011);
        plant.set_lines(2.01, 0b111);
        plant.advance(3.0);
        assert_eq!(plant.state().previous.to_string(), "100");
    }

    #[test]
    fn a_stuck_line_and_a_stuck_switch_show() {
        let mut plant = Plant::new(&valves(2), &[]);
        plant.set_broken(0.0, Broken { lines_low: 1, switches_closed: 2, ..Broken::default() });
        plant.set_lines(0.0, 0b01);
        plant.advance(1.0);
        assert_eq!((plant.state().reached.to_string(), plant.switches()), ("00".into(), 0b10));
        plant.set_broken(1.0, Broken::default());
        plant.advance(2.0);
        assert_eq!((plant.state().reached.to_string(), plant.switches()), ("10".into(), 0b01));
    }

    #[test]
    fn four_states_have_two_coils() {
        let mut wiring = valves(2);
        wiring.actuators.pop();
        wiring.actuators[0].states = 4;
        let mut plant = Plant::new(&wiring, &[]);
        for (lines, digit) in [(0b11, 3), (0b10, 2), (0b01, 1), (0b00, 0)] {
            plant.set_lines(plant.now_s + 1.0, lines);
            plant.advance(plant.now_s + 1.0);
            assert_eq!(plant.state().reached.digit(0), digit);
        }
    }
}
