//! The rows of a program as they are placed in time, one visit after the other.

use darm_core::output::{Drive, Wiring};
use darm_core::table::{Row, ServoAngles};
use darm_core::units::{Micros, Word};

use super::{ROW_SPACING, SETTLE, Visit};

/// Servos are planned with this share of their greatest speed.
const SERVO_SPEED_SHARE: f64 = 0.8;

/// The rows so far, and what still moves.
#[derive(Clone)]
pub(super) struct Timeline<'a> {
    pub(super) wiring: &'a Wiring,
    pub(super) rest: Word,
    pub(super) rows: Vec<Row>,
    /// The visit that each row serves.
    pub(super) served: Vec<usize>,
    /// When each actuator switched last.
    pub(super) moved: Vec<Option<Micros>>,
}

impl Timeline<'_> {
    /// Adds the rows of a change that may begin at `free`, and says when the arm rests.
    pub(super) fn go_to(&mut self, visit: &Visit, index: usize, free: Micros) -> Micros {
        let servos: ServoAngles = visit.servos_rad.iter().map(|angle| *angle as f32).collect();
        let mut at = free.max(self.servos_may_turn(&servos));
        let turning = self.turning_time(&servos);
        let started = at;
        for word in self.steps(&visit.word) {
            at = at.max(self.may_switch(&word));
            self.note_moved(&word, at);
            self.rows.push(Row { at, word, servos: servos.clone() });
            self.served.push(index);
            at = at + self.window();
        }
        let arrived = self.wiring.actuators.iter().zip(&self.moved);
        let arrived = arrived.filter_map(|(wiring, moved)| Some((*moved)? + travel(wiring.travel_ms)));
        arrived.max().unwrap_or(started).max(started + turning) + SETTLE
    }

    /// Adds the rows that switch every coil off, for the visit that comes, and says when the arm rests.
    pub(super) fn rest(&mut self, index: usize, free: Micros) -> Micros {
        let servos_rad = self.rows.last().map_or_else(Vec::new, |row| row.servos.iter().map(|&a| a.into()).collect());
        let rest = Visit { word: self.rest, servos_rad, dwell_s: 0.0, label: String::new() };
        self.go_to(&rest, index, free)
    }

    /// The words from the arm's present one to `goal`, each feeding no more new coils than the supply can at once.
    fn steps(&self, goal: &Word) -> Vec<Word> {
        let from = self.word();
        let limit = u32::from(self.wiring.switch_limit.new_coils);
        let fed = |from: &Word, to: &Word| (self.newly_fed(from, to)).count_ones();
        // Everything that feeds nothing goes at once, in the first row.
        let mut word = from;
        for actuator in 0..goal.len() {
            let switched = from.with_digit(actuator, goal.digit(actuator));
            if fed(&from, &switched) == 0 {
                word = word.with_digit(actuator, goal.digit(actuator));
            }
        }
        let mut steps = Vec::new();
        let mut done = from;
        for actuator in 0..goal.len() {
            let next = word.with_digit(actuator, goal.digit(actuator));
            if fed(&done, &next) > limit && word != done {
                steps.push(word);
                done = word;
            }
            word = next;
        }
        steps.push(word);
        steps
    }

    /// Coils that begin to carry current, or pulse, between two words.
    fn newly_fed(&self, from: &Word, to: &Word) -> u64 {
        let wiring = self.wiring;
        let (was, is) = (wiring.coils_on(from), wiring.coils_on(to));
        let latches = wiring.coils.iter().enumerate().filter(|(_, coil)| matches!(coil.drive, Drive::Latch { .. }));
        let latches = latches.fold(0u64, |latches, (index, _)| latches | 1 << index);
        (is & !was) | ((is ^ was) & latches)
    }

    fn word(&self) -> Word {
        self.rows.last().map_or(self.rest, |row| row.word)
    }

    fn window(&self) -> Micros {
        travel(self.wiring.switch_limit.window_ms).max(ROW_SPACING)
    }

    /// The earliest time at which no actuator that changes for `word` is still on its way.
    fn may_switch(&self, word: &Word) -> Micros {
        let from = self.word();
        let changing = (0..word.len()).filter(|&actuator| word.digit(actuator) != from.digit(actuator));
        let arrivals = changing.filter_map(|actuator| {
            Some(self.moved[actuator]? + travel(self.wiring.actuators.get(actuator)?.travel_ms))
        });
        arrivals.max().unwrap_or_default()
    }

    fn note_moved(&mut self, word: &Word, at: Micros) {
        let from = self.word();
        for (actuator, moved) in self.moved.iter_mut().enumerate() {
            if word.digit(actuator) != from.digit(actuator) {
                *moved = Some(at);
            }
        }
    }

    /// The earliest time of the next row: a servo may not have to turn faster between two rows than it can.
    fn servos_may_turn(&self, angles_rad: &ServoAngles) -> Micros {
        self.rows.last().map_or(Micros(0), |last| last.at + self.turning_time(angles_rad).max(ROW_SPACING))
    }

    /// How long the servos turn after a row; before the first row the board takes them there itself.
    fn turning_time(&self, angles_rad: &ServoAngles) -> Micros {
        let Some(last) = self.rows.last() else { return Micros(0) };
        let times_s = self.wiring.servos.iter().zip(&last.servos).zip(angles_rad).map(|((servo, from), to)| {
            f64::from((to - from).abs()) / (SERVO_SPEED_SHARE * f64::from(servo.max_speed_rad_s))
        });
        Micros((times_s.fold(0.0, f64::max) * 1e6).ceil() as u64)
    }
}

fn travel(millis: u16) -> Micros {
    Micros::from_millis(u32::from(millis))
}
