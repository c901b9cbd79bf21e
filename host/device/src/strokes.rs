//! Times of strokes: from the row that switched an actuator to the change of its limit switch.
//!
//! Both are times of control ticks. A row is switched at the end of its tick, a tenth of a millisecond after the time that it
//! carries; a switch is seen at the begin of the first tick after it changed. So the true time is the one given here, less at
//! most 1.1 ms and the lateness of a tick, which `darm status` prints.
//!
//! A switch that closes shows that the actuator has arrived, one that opens that it has left.

use darm_core::output::{ActuatorWiring, LimitSwitch};
use darm_core::units::{Micros, Word};
use darm_core::wire::inputs::InputChanges;

/// A row as it was switched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SentRow {
    /// Its index.
    pub row: u16,
    /// When.
    pub at: Micros,
    /// Its word.
    pub word: Word,
}

/// The changes of the inputs that a host has fetched.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InputHistory {
    changes: Vec<(Micros, u32)>,
    /// Times of the first changes behind lost ones.
    gaps: Vec<Micros>,
    next: u32,
}

/// One stroke.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StrokeTime {
    /// The row that began it.
    pub row: u16,
    /// The actuator.
    pub actuator: usize,
    /// Its state before.
    pub from: u8,
    /// Its state after.
    pub to: u8,
    /// From the row to the change of the switch.
    pub time: Micros,
}

impl InputHistory {
    /// Number of the change to ask for next.
    pub fn next(&self) -> u32 {
        self.next
    }

    /// Takes in an answer to that; whether there was something new.
    pub fn take(&mut self, answer: &InputChanges) -> bool {
        let Some((at, _)) = answer.list.first() else {
            self.next = answer.first;
            return false;
        };
        if answer.first != self.next {
            self.gaps.push(*at);
        }
        self.changes.extend(&answer.list);
        self.next = answer.first.wrapping_add(answer.list.len() as u32);
        true
    }

    /// When an input first was at this level, between two times; after a change if it was there already. `None` where it was
    /// not, or changes before it are lost.
    fn first_at(&self, switch: &LimitSwitch, closed: bool, between: [Micros; 2]) -> Option<Micros> {
        let [from, to] = between;
        let level = |inputs: u32| inputs >> switch.input & 1 == 1;
        let begin = self.changes.partition_point(|(at, _)| *at <= from);
        let mut was = begin.checked_sub(1).is_some_and(|before| level(self.changes[before].1));
        let within = self.changes[begin..].iter().take_while(|(at, _)| *at <= to);
        let mut found = None;
        for (at, inputs) in within {
            if level(*inputs) != was && level(*inputs) == closed {
                found = Some(*at);
                break;
            }
            was = level(*inputs);
        }
        found.filter(|at| !self.gaps.iter().any(|gap| from < *gap && gap <= at))
    }
}

/// The strokes of a program, as far as switches show them. `rows` are in order; the state before the first is not known.
pub fn stroke_times(actuators: &[ActuatorWiring], rows: &[SentRow], inputs: &InputHistory) -> Vec<StrokeTime> {
    let mut strokes = Vec::new();
    for (index, pair) in rows.windows(2).enumerate() {
        for (actuator, wiring) in actuators.iter().enumerate() {
            let [from, to] = [&pair[0], &pair[1]].map(|row| row.word.digit(actuator));
            let Some(switch) = wiring.switch.filter(|_| from != to) else { continue };
            let next = rows[index + 2..].iter().find(|row| row.word.digit(actuator) != to);
            let between = [pair[1].at, next.map_or(Micros(u64::MAX), |row| row.at)];
            let row = pair[1].row;
            let seen = inputs.first_at(&switch, switch.closed(to), between);
            strokes.extend(seen.map(|at| StrokeTime { row, actuator, from, to, time: at - pair[1].at }));
        }
    }
    strokes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn actuator(input: u8, closed_in: u8) -> ActuatorWiring {
        ActuatorWiring { states: 2, switch: Some(LimitSwitch { input, closed_in }), travel_ms: 100 }
    }

    fn row(row: u16, at_ms: u32, word: &str) -> SentRow {
        SentRow { row, at: Micros::from_millis(at_ms), word: word.parse().unwrap() }
    }

    fn history(answers: &[(u32, &[(u32, u32)])]) -> InputHistory {
        let mut history = InputHistory::default();
        for (first, list) in answers {
            let list = list.iter().map(|(ms, inputs)| (Micros::from_millis(*ms), *inputs)).collect();
            history.take(&InputChanges { first: *first, list });
        }
        history
    }

    fn times(strokes: &[StrokeTime]) -> Vec<(u16, usize, u8, u64)> {
        strokes.iter().map(|stroke| (stroke.row, stroke.actuator, stroke.to, stroke.time.0 / 1000)).collect()
    }

    #[test]
    fn each_direction_of_each_actuator_has_its_time() {
        // Actuator 0 closes its switch in state 1, actuator 1 in both states.
        let actuators = [actuator(0, 0b10), actuator(1, 0b11)];
        let rows = [row(0, 100, "00"), row(1, 200, "11"), row(2, 300, "00")];
        let inputs = history(&[
            (0, &[(50, 0b10), (201, 0b00), (230, 0b01), (240, 0b11), (302, 0b10)]),
            (5, &[(304, 0b00), (333, 0b10)]),
        ]);
        assert_eq!(inputs.next(), 7);
        let strokes = stroke_times(&actuators, &rows, &inputs);
        assert_eq!(times(&strokes), [(1, 0, 1, 30), (1, 1, 1, 40), (2, 0, 0, 2), (2, 1, 0, 33)]);
    }

    /// It opens in the state that it is in: leaving and arriving have a time each, as of a switch that closes there.
    #[test]
    fn both_directions_of_a_normally_closed_switch_have_a_time() {
        let actuators = [actuator(0, 0b01), actuator(1, 0b10)];
        let rows = [row(0, 100, "00"), row(1, 200, "11"), row(2, 300, "00"), row(3, 400, "11")];
        // The first tick of the board sees input 0 closed.
        let inputs =
            history(&[(0, &[(0, 0b01), (203, 0b00), (240, 0b10), (304, 0b00), (335, 0b01), (402, 0b00), (441, 0b10)])]);
        let expected = [(1, 0, 1, 3), (1, 1, 1, 40), (2, 0, 0, 35), (2, 1, 0, 4), (3, 0, 1, 2), (3, 1, 1, 41)];
        assert_eq!(times(&stroke_times(&actuators, &rows, &inputs)), expected);
    }

    #[test]
    fn a_stroke_over_lost_changes_or_into_the_next_one_has_no_time() {
        let actuators = [actuator(0, 0b10)];
        let rows = [row(0, 100, "0"), row(1, 200, "1"), row(2, 300, "0"), row(3, 400, "1")];
        let inputs = history(&[(0, &[(50, 0)]), (7, &[(230, 1), (301, 0)])]);
        assert_eq!(times(&stroke_times(&actuators, &rows, &inputs)), [(2, 0, 0, 1)]);
        let late = history(&[(0, &[(350, 1)])]);
        assert_eq!(stroke_times(&actuators, &rows, &late), []);
    }
}
