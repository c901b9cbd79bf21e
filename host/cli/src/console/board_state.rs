//! What the console knows of the board: for its prompt, for the values that it completes, and for what is allowed where the
//! board has refused a line.

use std::sync::{Arc, Mutex, PoisonError};

use darm_core::sequencer::Phase;
use darm_core::wire::message::{OutputState, Status};

/// What the board reported last.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BoardState {
    /// Its status.
    pub(crate) status: Status,
    /// The outputs that its profile has, with their limits.
    pub(crate) outputs: Vec<OutputState>,
}

/// It, shared by the thread that asks the board and by the line editor; `None` where the board does not answer frames.
#[derive(Clone, Default)]
pub(crate) struct Shared(Arc<Mutex<Option<BoardState>>>);

impl Shared {
    pub(crate) fn set(&self, state: Option<BoardState>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = state;
    }

    pub(crate) fn get(&self) -> Option<BoardState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The prompt: behind a line with the state where the board has one.
    pub(crate) fn prompt(&self) -> String {
        self.get().map_or_else(|| "> ".to_owned(), |board| format!("[{}]\n> ", board.line()))
    }
}

impl BoardState {
    /// What the board does, in a few words; the same as long as it does the same.
    pub(crate) fn phase(&self) -> String {
        match self.status.phase {
            Phase::Idle => "idle".to_owned(),
            Phase::Manual => "manual".to_owned(),
            Phase::Approaching { .. } => "approaching the first row".to_owned(),
            Phase::Playing { .. } => format!("playing {} rows", self.status.rows),
            Phase::Safe(fault) => format!("SAFE STATE: {fault}"),
        }
    }

    /// The status line: what it does, and its word where it does not move. It fits a terminal of 80 columns.
    pub(crate) fn line(&self) -> String {
        let word = self.status.word;
        let does = match self.status.phase {
            Phase::Approaching { .. } | Phase::Playing { .. } => return self.phase(),
            // The fault was printed when it came.
            Phase::Safe(_) => "SAFE STATE".to_owned(),
            Phase::Idle | Phase::Manual => self.phase(),
        };
        if word.is_empty() { format!("{does}, no table") } else { format!("{does}, word {word}") }
    }

    /// Values that may follow these words of a line.
    pub(crate) fn values(&self, words: &[&str]) -> Vec<String> {
        match words {
            ["coil"] => self.outputs.iter().map(|output| output.output.to_string()).collect(),
            ["coil", _] => vec!["off".to_owned(), "on".to_owned()],
            ["coil", number, "on"] => {
                self.output(number).map(|output| longest_ms(output).to_string()).into_iter().collect()
            }
            ["servo"] => (0..self.status.servos.len()).map(|servo| servo.to_string()).collect(),
            ["servo", number] => self.angle_deg(number).map(|angle| format!("{angle:.1}")).into_iter().collect(),
            ["word"] => self.words(),
            _ => Vec::new(),
        }
    }

    /// What the arguments of a command may be, now.
    pub(crate) fn allowed(&self, words: &[&str]) -> Option<String> {
        match words {
            ["coil", number, ..] if self.output(number).is_some() => self.output(number).map(|output| {
                let [left, max] = [longest_ms(output), output.limit.max_on_ms];
                format!("output {number}: MS is 1 to {left} now, at most {max} when it has recovered")
            }),
            ["coil", ..] => {
                Some(format!("N is one of the outputs {}", numbers(self.outputs.iter().map(|it| it.output))))
            }
            ["servo", ..] if self.status.servos.is_empty() => Some("the loaded table has no servo".to_owned()),
            ["servo", ..] => {
                Some(format!("N is 0 to {}; `limits` prints the range of each servo", self.status.servos.len() - 1))
            }
            ["word", ..] if self.status.word.is_empty() => {
                Some("no table is loaded: `upload TABLE.darm` first".to_owned())
            }
            ["word", ..] => Some(format!("DIGITS are {} digits, one an actuator", self.status.word.len())),
            _ => None,
        }
    }

    fn output(&self, number: &str) -> Option<&OutputState> {
        let number: u8 = number.parse().ok()?;
        self.outputs.iter().find(|output| output.output == number)
    }

    fn angle_deg(&self, number: &str) -> Option<f32> {
        let number: usize = number.parse().ok()?;
        self.status.servos.get(number).map(|servo| servo.angle_rad.to_degrees())
    }

    /// The present word, all zeros, all ones.
    fn words(&self) -> Vec<String> {
        let word = self.status.word;
        let mut words = vec![word.to_string(), "0".repeat(word.len()), "1".repeat(word.len())];
        words.retain(|word| !word.is_empty());
        words.sort();
        words.dedup();
        words
    }
}

/// How long an output may be on now.
fn longest_ms(output: &OutputState) -> u32 {
    output.limit.max_on_ms.min(output.left_ms)
}

/// Numbers in ascending order, with runs as `0 to 3`.
fn numbers(numbers: impl Iterator<Item = u8>) -> String {
    let mut runs: Vec<(u8, u8)> = Vec::new();
    for number in numbers {
        match runs.last_mut() {
            Some((_, last)) if last.checked_add(1) == Some(number) => *last = number,
            _ => runs.push((number, number)),
        }
    }
    let texts = runs.iter().map(|&(first, last)| match first == last {
        true => first.to_string(),
        false => format!("{first} to {last}"),
    });
    texts.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
pub(super) mod tests {
    use darm_core::output::CoilLimit;
    use darm_core::sequencer::{Phase, ServoSeen};
    use darm_core::wire::message::{OutputState, Status};

    use super::{BoardState, Shared, numbers};

    pub(crate) fn idle() -> BoardState {
        let limit = CoilLimit { max_on_ms: 500, duty_percent: 50, window_ms: 1000 };
        let output = |output, left_ms| OutputState { output, limit, left_ms, recovery_ms: 0 };
        let servos = std::iter::once(ServoSeen { angle_rad: 0.5, ..ServoSeen::default() }).collect();
        let status = Status {
            phase: Phase::Idle,
            word: "0110".parse().unwrap(),
            rows: 3,
            model: None,
            switches: 0,
            servos,
            bad_frames: 0,
            worst_lateness_us: 0,
        };
        BoardState { status, outputs: vec![output(0, 500), output(1, 120), output(4, 500)] }
    }

    #[test]
    fn values_are_those_that_the_board_accepts_now() {
        let board = idle();
        assert_eq!(board.values(&["coil"]), ["0", "1", "4"]);
        assert_eq!(board.values(&["coil", "1", "on"]), ["120"]);
        assert_eq!(board.values(&["servo"]), ["0"]);
        assert_eq!(board.values(&["servo", "0"]), ["28.6"]);
        assert_eq!(board.values(&["word"]), ["0000", "0110", "1111"]);
        assert_eq!(board.values(&["status"]), [""; 0]);
    }

    #[test]
    fn the_allowed_range_is_named() {
        let allowed = |words: &[&str]| idle().allowed(words).unwrap();
        assert_eq!(allowed(&["coil", "9", "on", "5"]), "N is one of the outputs 0 to 1, 4");
        assert_eq!(
            allowed(&["coil", "1", "on", "900"]),
            "output 1: MS is 1 to 120 now, at most 500 when it has recovered"
        );
        assert_eq!(allowed(&["word", "01"]), "DIGITS are 4 digits, one an actuator");
        assert_eq!(idle().allowed(&["play"]), None);
    }

    #[test]
    fn the_prompt_says_what_the_board_does() {
        let shared = Shared::default();
        assert_eq!(shared.prompt(), "> ");
        let mut board = idle();
        shared.set(Some(board.clone()));
        assert_eq!(shared.prompt(), "[idle, word 0110]\n> ");
        board.status.phase = Phase::Playing { started: darm_core::units::Micros(0), next: 2 };
        shared.set(Some(board));
        assert_eq!(shared.prompt(), "[playing 3 rows]\n> ");
    }

    #[test]
    fn runs_of_numbers_are_short() {
        assert_eq!(numbers([0, 1, 2, 5, 7, 8].into_iter()), "0 to 2, 5, 7 to 8");
        assert_eq!(numbers([].into_iter()), "");
    }
}
