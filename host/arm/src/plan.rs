//! From visits to a table: timed rows that the board accepts.
//!
//! Every visit takes the arm to a word and servo angles, lets it settle and dwells there. Where a change would feed more
//! coils at once than the supply can, it goes in several rows: what switches off goes first, then the actuators from
//! the base on, as many in a window as the limit allows. Rows wait for actuators that still travel and for servos that
//! could not turn so fast. Every record passes the checker that the board itself runs.

use std::fmt;

use darm_core::output::{Drive, Wiring};
use darm_core::table::{Board, Checker, MAX_ROWS, Record, Row, RowError, ServoAngles, TableError};
use darm_core::units::{Micros, Word};

use crate::arm::frames::check_word;
use crate::arm::{Arm, FrameFault, WiringFault, wiring};
use crate::image::UploadImage;

/// Time that the arm is given to come to rest after the last actuator can have reached its stop.
pub const SETTLE: Micros = Micros::from_millis(20);

/// Rows are at least so far apart: the board runs at most one row a tick.
const ROW_SPACING: Micros = Micros::from_millis(2);

/// Servos are planned with this share of their greatest speed.
const SERVO_SPEED_SHARE: f64 = 0.8;

/// One place to go to.
#[derive(Clone, Debug, PartialEq)]
pub struct Visit {
    /// The word.
    pub word: Word,
    /// Angles of the servo joints, rad.
    pub servos_rad: Vec<f64>,
    /// How long the arm rests there, after it has settled.
    pub dwell_s: f64,
    /// What it is called.
    pub label: String,
}

/// A program that the board accepts.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The rows in order of time.
    pub rows: Vec<Row>,
    /// When the program ends and every coil goes off.
    pub end: Micros,
    /// From when to when the arm rests at each visit.
    pub windows: Vec<(Micros, Micros)>,
    /// The table as it is uploaded.
    pub image: UploadImage,
}

/// Why visits make no program.
#[derive(Clone, Debug, PartialEq)]
pub enum PlanError {
    /// The word of a visit does not fit the arm, or a servo angle is missing.
    Visit {
        /// The visit.
        visit: String,
        /// What is wrong.
        fault: FrameFault,
    },
    /// The dwell of a visit is below zero or not finite.
    Dwell {
        /// The visit.
        visit: String,
        /// The dwell, s.
        dwell_s: f64,
    },
    /// The arm does not fit the profile of the board.
    Wiring(WiringFault),
    /// There is no visit.
    Empty,
    /// The program has more rows than the board holds.
    TooManyRows {
        /// How many it has.
        rows: usize,
    },
    /// The board would refuse a row: a limit of a coil or servo.
    Row {
        /// The visit that the row serves.
        visit: String,
        /// What is wrong.
        error: RowError,
    },
    /// The board would refuse the table.
    Table(TableError),
}

impl fmt::Display for PlanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Visit { visit, fault } => write!(f, "{visit}: {fault}"),
            Self::Dwell { visit, dwell_s } => write!(f, "{visit}: a dwell of {dwell_s} s cannot be kept"),
            Self::Wiring(fault) => write!(f, "{fault}"),
            Self::Empty => write!(f, "there is nothing to visit"),
            Self::TooManyRows { rows } => {
                write!(f, "the program has {rows} rows, the board holds {MAX_ROWS}; visit fewer places")
            }
            Self::Row { visit, error } => {
                write!(f, "{visit}: {error}; dwell for a shorter time, or put a rest between")
            }
            Self::Table(error) => write!(f, "{error}"),
        }
    }
}

impl std::error::Error for PlanError {}

/// Plans the rows that take `arm` through `visits`, for this board; drives and limits are those of its profile. `modules` are records of
/// modules and frames ([`crate::reach::board`]) that the table brings along, or none.
pub fn plan(arm: &Arm, visits: &[Visit], board: &Board<'_>, modules: &[Record]) -> Result<Plan, PlanError> {
    let wiring = wiring(arm, board.profile).map_err(PlanError::Wiring)?;
    let (rest, moved) = (arm.rest(), vec![None; arm.n_actuators()]);
    let mut timeline = Timeline { wiring: &wiring, rest, rows: Vec::new(), served: Vec::new(), moved };
    let mut windows = Vec::new();
    let mut free = Micros(0);
    for visit in visits {
        check_visit(arm, visit)?;
        let settled = timeline.go_to(visit, windows.len(), free);
        free = settled + Micros((visit.dwell_s * 1e6).round() as u64).max(ROW_SPACING);
        windows.push((settled, free));
    }
    if visits.is_empty() {
        return Err(PlanError::Empty);
    }
    let Timeline { rows, served, .. } = timeline;
    if rows.len() > MAX_ROWS {
        return Err(PlanError::TooManyRows { rows: rows.len() });
    }
    let image = encode(arm, board, &Contents { wiring: &wiring, modules, rows: &rows, end: free }).map_err(
        |error| match error {
            TableError::Row { row, error } => {
                let visit = served.get(usize::from(row)).or(served.last()).and_then(|&visit| visits.get(visit));
                PlanError::Row { visit: visit.map_or_else(String::new, |visit| visit.label.clone()), error }
            }
            error => PlanError::Table(error),
        },
    )?;
    Ok(Plan { rows, end: free, windows, image })
}

fn check_visit(arm: &Arm, visit: &Visit) -> Result<(), PlanError> {
    let wrong = |fault| PlanError::Visit { visit: visit.label.clone(), fault };
    check_word(&visit.word, arm).map_err(wrong)?;
    if visit.servos_rad.len() != arm.n_servos() {
        return Err(wrong(FrameFault::ServoCount { servos: arm.n_servos(), found: visit.servos_rad.len() }));
    }
    if !(0.0..1e6).contains(&visit.dwell_s) {
        return Err(PlanError::Dwell { visit: visit.label.clone(), dwell_s: visit.dwell_s });
    }
    Ok(())
}

/// The rows so far, and what still moves.
struct Timeline<'a> {
    wiring: &'a Wiring,
    rest: Word,
    rows: Vec<Row>,
    /// The visit that each row serves.
    served: Vec<usize>,
    /// When each actuator switched last.
    moved: Vec<Option<Micros>>,
}

impl Timeline<'_> {
    /// Adds the rows of a change that may begin at `free`, and says when the arm rests.
    fn go_to(&mut self, visit: &Visit, index: usize, free: Micros) -> Micros {
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

    /// The words from where the arm stands to `goal`, each feeding no more new coils than the supply can at once.
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

/// What a table holds behind its first record.
struct Contents<'a> {
    wiring: &'a Wiring,
    modules: &'a [Record],
    rows: &'a [Row],
    end: Micros,
}

/// The table's bytes, every record passed by the board's own checker.
fn encode(arm: &Arm, board: &Board<'_>, contents: &Contents<'_>) -> Result<UploadImage, TableError> {
    let &Contents { wiring, modules, rows, end } = contents;
    let profile = board.profile.digest;
    let start = Record::Start { model: arm.hash(), device: board.device, profile, switch_limit: wiring.switch_limit };
    let records = std::iter::once(start)
        .chain(wiring.coils.iter().map(|coil| Record::Coil(*coil)))
        .chain(wiring.actuators.iter().map(|actuator| Record::Actuator(*actuator)))
        .chain(wiring.servos.iter().map(|servo| Record::Servo(*servo)))
        .chain(modules.iter().cloned())
        .chain(rows.iter().map(|row| Record::Row(row.clone())))
        .chain([Record::End { at: end }]);
    let records: Vec<Record> = records.collect();
    let mut checker = Checker::default();
    records.iter().try_for_each(|record| checker.admit(record, board))?;
    Ok(UploadImage::table(&records, arm.hash()))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    use super::*;
    use crate::board_profile::BoardProfile;
    use crate::wired_arm::profile_of;

    fn arm(name: &str) -> Arm {
        Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)).unwrap()
    }

    /// For a board with the profile that the arm names.
    fn planned(arm: &Arm, visits: &[Visit]) -> Result<Plan, PlanError> {
        plan(arm, visits, &profile_of(arm, None).unwrap().board(None), &[])
    }

    fn visit(word: &str, angle_rad: Option<f64>) -> Visit {
        Visit {
            word: word.parse().unwrap(),
            servos_rad: angle_rad.into_iter().collect(),
            dwell_s: 0.1,
            label: word.into(),
        }
    }

    fn seeded(cases: u32) -> ProptestConfig {
        ProptestConfig { cases, rng_seed: RngSeed::Fixed(0xda24), failure_persistence: None, ..Default::default() }
    }

    proptest! {
        #![proptest_config(seeded(64))]

        #[test]
        fn random_programs_pass_the_checker(
            stops in prop::collection::vec((0u16..4096, -1.0..1.0, 0.0..0.3), 1..60),
            new_coils in 1u8..7,
        ) {
            let arm = arm("planar4-hybrid.toml");
            let mut profile = profile_of(&arm, None).unwrap().profile;
            profile.supply.new_coils = new_coils;
            let profile = BoardProfile::new("less supply", profile);
            let visits: Vec<_> = stops
                .iter()
                .map(|&(bits, angle_rad, dwell_s)| {
                    Visit { dwell_s, ..visit(&format!("{bits:012b}"), Some(angle_rad)) }
                })
                .collect();
            let plan = plan(&arm, &visits, &profile.board(None), &[]).unwrap();
            prop_assert_eq!(plan.windows.len(), visits.len());
            for (visit, &(from, to)) in visits.iter().zip(&plan.windows) {
                let last = plan.rows.iter().rfind(|row| row.at < to).unwrap();
                prop_assert_eq!(last.word, visit.word);
                prop_assert!(last.at + Micros::from_millis(100) <= from || last.at == Micros(0));
            }
        }
    }

    #[test]
    fn eight_coils_at_once_go_in_two_rows() {
        let plan = planned(&arm("planar4.toml"), &[visit("111111110000", None)]).unwrap();
        let words: Vec<_> = plan.rows.iter().map(|row| (row.at, row.word.to_string())).collect();
        assert_eq!(
            words,
            [(Micros(0), "111111000000".into()), (Micros::from_millis(10), "111111110000".into())],
            "six coils may go on within 10 ms"
        );
        assert_eq!(plan.windows[0].0, Micros::from_millis(180), "150 ms to travel and 20 ms to settle");
    }

    #[test]
    fn a_coil_that_would_be_on_too_long_is_told_by_its_visit() {
        let visits = [Visit { dwell_s: 301.0, ..visit("000000000001", None) }];
        let error = planned(&arm("planar4.toml"), &visits).unwrap_err();
        assert_eq!(
            error.to_string(),
            "000000000001: output 11 would be on for longer than it may; dwell for a shorter time, or put a rest between"
        );
    }
}
