//! From visits to a table: timed rows that the board accepts.
//!
//! Every visit takes the arm to a word and servo angles, lets it settle and dwells there. Where a change would feed more
//! coils at once than the supply can, it goes in several rows: what switches off goes first, then the actuators from
//! the base on, as many in a window as the limit allows. Rows wait for actuators that still travel and for servos that
//! could not turn so fast. Every record passes the checker that the board itself runs.

mod rests;
mod timeline;

use std::fmt;

use darm_core::output::{CoilLimit, Drive, Wiring};
use darm_core::table::{Board, Checker, MAX_ROWS, Record, Row, RowError, TableError, head};
use darm_core::units::{Micros, Word};

use self::rests::Rests;
use self::timeline::Timeline;

use crate::arm::frames::check_word;
use crate::arm::{Arm, FrameFault, WiringFault, wiring};
use crate::image::UploadImage;

/// Time that the arm is given to come to rest after the last actuator can have reached its stop.
pub const SETTLE: Micros = Micros::from_millis(20);

/// Rows are at least so far apart: the board runs at most one row a tick.
const ROW_SPACING: Micros = Micros::from_millis(2);

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

impl Visit {
    /// How long the board rests there: no shorter than rows are apart.
    fn dwell(&self) -> Micros {
        Micros((self.dwell_s * 1e6).round() as u64).max(ROW_SPACING)
    }
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
    /// Whether the arm rests with every coil off before each visit, so that limits of outputs are kept.
    pub rested: Vec<bool>,
    /// Time that those rests take.
    pub rests: Micros,
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
        /// The rule of the profile that it breaks.
        rule: Option<Rule>,
    },
    /// The board would refuse the table.
    Table(TableError),
}

/// A rule of a profile on the current of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Longest time on.
    LongestOn(CoilLimit),
    /// Share of the time on.
    Share(CoilLimit),
    /// Least time between the beginnings of two peaks.
    PeakPause {
        /// Length of a peak, ms.
        peak_ms: u16,
        /// Time between two.
        pause: Micros,
    },
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let off = "put words between in which the output is off";
        match self {
            Self::LongestOn(CoilLimit { max_on_ms, .. }) => {
                write!(f, "(max_on_ms = {max_on_ms} in the profile); dwell for a shorter time, or {off}")
            }
            Self::Share(CoilLimit { duty_percent, window_ms, .. }) => {
                write!(f, "(duty_percent = {duty_percent}, window_ms = {window_ms} in the profile); {off} for longer")
            }
            Self::PeakPause { peak_ms, pause } => {
                let pause_ms = pause.0.div_ceil(1000);
                write!(
                    f,
                    "(peak_ms = {peak_ms} in the profile: from one peak to the next it takes at least ten, {pause_ms} ms); \
                     dwell for at least {} s, or leave the output on between these words",
                    pause_ms as f64 / 1e3
                )
            }
        }
    }
}

impl PlanError {
    /// The label of the visit that it is about, where there is one.
    pub fn visit(&self) -> Option<&str> {
        match self {
            Self::Visit { visit, .. } | Self::Dwell { visit, .. } | Self::Row { visit, .. } => Some(visit),
            Self::Wiring(_) | Self::Empty | Self::TooManyRows { .. } | Self::Table(_) => None,
        }
    }
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
            Self::Row { visit, error: RowError::Duty { output }, rule: Some(rule @ Rule::PeakPause { .. }) } => {
                write!(f, "{visit}: output {output} would have a peak before its pause is over {rule}")
            }
            Self::Row { visit, error, rule: Some(rule) } => write!(f, "{visit}: {error} {rule}"),
            Self::Row { visit, error, rule: None } => write!(f, "{visit}: {error}; dwell for longer"),
            Self::Table(error) => write!(f, "{error}"),
        }
    }
}

impl std::error::Error for PlanError {}

/// Plans the rows that take `arm` through `visits`, for this board; drives and limits are those of its profile. `modules` are
/// records of modules and frames ([`crate::reach::board`]) that the table brings along, or none.
///
/// # Errors
///
/// There is no visit; the word, servo positions or dwell of a visit do not fit the arm; the arm does not fit the
/// profile; there are more rows than the board holds; or the board would refuse a row or the table.
pub fn plan(arm: &Arm, visits: &[Visit], board: &Board<'_>, modules: &[Record]) -> Result<Plan, PlanError> {
    let wiring = wiring(arm, board.profile).map_err(PlanError::Wiring)?;
    planned(arm, visits, &Program { board, modules, wiring: &wiring, rests: None })
}

/// The same with rests before the visits where the limits of an output demand them: every coil is off there.
///
/// # Errors
///
/// As [`plan`]; of the limits of an output only those that no rest keeps.
pub fn plan_with_rests(arm: &Arm, visits: &[Visit], board: &Board<'_>, modules: &[Record]) -> Result<Plan, PlanError> {
    let wiring = wiring(arm, board.profile).map_err(PlanError::Wiring)?;
    let rests = Rests::new(head(&wiring, arm.hash(), board.device, board.profile.digest), board, &wiring);
    planned(arm, visits, &Program { board, modules, wiring: &wiring, rests: Some(rests) })
}

/// What a program is made for, and what it does besides its visits.
struct Program<'a> {
    board: &'a Board<'a>,
    modules: &'a [Record],
    wiring: &'a Wiring,
    /// Where rests are put; `None` in a program that goes from visit to visit.
    rests: Option<Rests<'a>>,
}

fn planned(arm: &Arm, visits: &[Visit], program: &Program<'_>) -> Result<Plan, PlanError> {
    let &Program { board, modules, wiring, .. } = program;
    let mut rests = program.rests.clone();
    let (rest, moved) = (arm.rest(), vec![None; arm.n_actuators()]);
    let mut timeline = Timeline { wiring, rest, rows: Vec::new(), served: Vec::new(), moved };
    let (mut windows, mut rested, mut added) = (Vec::new(), Vec::new(), Micros(0));
    let mut free = Micros(0);
    for visit in visits {
        check_visit(arm, visit)?;
        let before = rests.as_mut().and_then(|rests| rests.before(&mut timeline, visit, windows.len(), free));
        added = added + before.map_or(Micros(0), |until| Micros(until.0 - free.0));
        rested.push(before.is_some());
        let settled = timeline.go_to(visit, windows.len(), before.unwrap_or(free));
        free = settled + visit.dwell();
        windows.push((settled, free));
        if let Some(rests) = &mut rests {
            rests.admit(&timeline);
        }
    }
    if visits.is_empty() {
        return Err(PlanError::Empty);
    }
    let Timeline { rows, served, .. } = timeline;
    if rows.len() > MAX_ROWS {
        return Err(PlanError::TooManyRows { rows: rows.len() });
    }
    let contents = Contents { wiring, modules, rows: &rows, end: free };
    let image = encode(arm, board, &contents).map_err(|error| match error {
        TableError::Row { row, error } => {
            let visit = served.get(usize::from(row)).or(served.last()).and_then(|&visit| visits.get(visit));
            let rule = rule_of(arm, board, &contents, (row, error));
            PlanError::Row { visit: visit.map_or_else(String::new, |visit| visit.label.clone()), error, rule }
        }
        error => PlanError::Table(error),
    })?;
    Ok(Plan { rows, end: free, windows, rested, rests: added, image })
}

/// The rule that a row would break. The board has one fault for the share of the holding current and for that of the peaks:
/// where the same row is refused without a peak it is the holding current.
fn rule_of(arm: &Arm, board: &Board<'_>, contents: &Contents<'_>, (row, error): (u16, RowError)) -> Option<Rule> {
    let (RowError::OnTooLong { output } | RowError::Duty { output }) = error else { return None };
    let mut wiring = contents.wiring.clone();
    let coil = wiring.coils.iter_mut().find(|coil| coil.output == output)?;
    let (limit, pause) = (coil.limit, coil.drive.peak_pause());
    if error == (RowError::OnTooLong { output }) {
        return Some(Rule::LongestOn(limit));
    }
    let Drive::PeakHold { peak_ms, .. } = &mut coil.drive else { return Some(Rule::Share(limit)) };
    let peak_ms = std::mem::replace(peak_ms, 0);
    let without = encode(arm, board, &Contents { wiring: &wiring, ..*contents }).err();
    let is_share = without == Some(TableError::Row { row, error });
    Some(if is_share { Rule::Share(limit) } else { Rule::PeakPause { peak_ms, pause } })
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

/// What a table holds behind its first record.
#[derive(Clone, Copy)]
struct Contents<'a> {
    wiring: &'a Wiring,
    modules: &'a [Record],
    rows: &'a [Row],
    end: Micros,
}

/// The table's bytes, every record passed by the board's own checker.
fn encode(arm: &Arm, board: &Board<'_>, contents: &Contents<'_>) -> Result<UploadImage, TableError> {
    let &Contents { wiring, modules, rows, end } = contents;
    let records = head(wiring, arm.hash(), board.device, board.profile.digest)
        .chain(modules.iter().cloned())
        .chain(rows.iter().map(|row| Record::Row(row.clone())))
        .chain([Record::End { at: end }]);
    let records: Vec<Record> = records.collect();
    let mut checker = Checker::default();
    records.iter().try_for_each(|record| checker.admit(record, board))?;
    Ok(UploadImage::table(&records, arm.hash()))
}

#[cfg(test)]
mod tests;
