//! What a log has, before there is a model: columns and what they are taken for, sampling, repeats, held-out rows, and which
//! kinds of measurement can be diagnosed from it.

mod kinds;
mod meaning;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde::Serialize;

use crate::error::DiagnoseError;
use crate::prepare::repeatability;
use crate::prepare::sampling::{Clock, Sampling, usual_step_s};
use crate::prepare::signals::{MAX_STEP, Preparation, Prepared};
pub use crate::prepare::table_findings::UnitDoubt;
use crate::prepare::table_findings::units;
use darm_measure::column::Column;
pub use darm_measure::condition::UnreadCondition;
use darm_measure::condition::unread;
use darm_measure::poses::{self, Which};
use darm_measure::table::{Names, Table};
use darm_measure::{Finding, FindingKind};
use darm_robot::files::FileRef;
pub use kinds::Possible;
pub use meaning::quantities;

/// A log in brief.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Overview {
    /// Number of rows.
    pub rows: usize,
    /// Its columns, in the order of the file.
    pub columns: Vec<ColumnOverview>,
    /// When the rows were measured; `None` without a column of time.
    pub sampling: Option<SamplingOverview>,
    /// Rows under the same conditions.
    pub repeats: Repeats,
    /// Rows that no fit would use.
    pub held_out: HeldOutOverview,
    /// Units that look wrong, as questions.
    pub questions: Vec<Finding>,
    /// The questions, by column and unit.
    #[serde(skip)]
    pub doubts: Vec<UnitDoubt>,
    /// Conditions that are not read; empty of a log without words.
    #[serde(skip)]
    pub unread: Vec<UnreadCondition>,
    /// What else its owner should know.
    pub findings: Vec<Finding>,
    /// What can be diagnosed from it; empty where no kind of measurement has its columns.
    pub possible: Vec<Possible>,
}

/// A column.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColumnOverview {
    /// Its name in the file.
    pub name: String,
    /// What it is taken for; empty where that is unknown.
    pub meaning: String,
    /// The unit of its numbers once they are read; empty where its name has none.
    pub unit: &'static str,
    /// Number of cells that are numbers.
    pub numbers: usize,
    /// Number of empty cells.
    pub empty: usize,
    /// Number of different values.
    pub different: usize,
    /// Whether all cells are the same.
    pub is_constant: bool,
    /// Smallest number, in the unit; `None` of words and of text.
    pub min: Option<f64>,
    /// Largest number, in the unit.
    pub max: Option<f64>,
}

/// When rows were measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SamplingOverview {
    /// From the first row to the last, s.
    pub duration_s: f64,
    /// Rows a second; `None` of visits, and where no rate can be found.
    pub rate_hz: Option<f64>,
    /// Root mean square of the stamps less those of an even clock, s; `None` as above.
    pub jitter_s: Option<f64>,
    /// Whether an even clock is used in place of the stamps.
    pub is_even: bool,
    /// Rows that are missing between others.
    pub missing_rows: usize,
    /// Steps of time longer than five usual ones.
    pub gaps: usize,
    /// Rows with the time of the row before.
    pub same_time: usize,
    /// Rows with a time before that of the row before.
    pub time_runs_back: usize,
}

/// Rows under the same conditions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Repeats {
    /// What is repeated: `words` or `rows`.
    pub of: &'static str,
    /// Conditions that were measured several times.
    pub conditions: usize,
    /// Degrees of freedom of a repeatability from them.
    pub dof: usize,
}

/// Rows that no fit would use.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct HeldOutOverview {
    /// How many.
    pub rows: usize,
    /// How they are chosen.
    pub how: String,
}

/// What is known of the rows besides their columns.
struct Rows {
    held_out: HeldOutOverview,
    repeats: Repeats,
    findings: Vec<Finding>,
    /// How rows were sampled, where there is a clock.
    clock: Option<Sampling>,
}

/// A log in brief; `names` say what columns hold whose own names do not, `how` which rows count.
///
/// # Errors
///
/// The file is not a table of measurements, or `how` names a column that it does not have.
pub fn overview<'a>(file: impl Into<FileRef<'a>>, names: &Names, how: &Preparation) -> Result<Overview, DiagnoseError> {
    let (table, mut findings) = Table::read(file, names)?;
    let unread = if table.quantity("word").is_some() { unread(&table) } else { Vec::new() };
    let mut columns: Vec<ColumnOverview> = table.columns.iter().map(|column| self::column(&table, column)).collect();
    for column in &mut columns {
        let condition = unread.iter().find(|condition| condition.column == column.name);
        column.meaning.extend(condition.map(|condition| format!(", {}: not read", condition.fault)));
    }
    let Rows { held_out, repeats, findings: of_rows, clock } = match table.quantity("word") {
        Some(_) => visits(&table, how)?,
        None => signals(&table, how)?,
    };
    findings.extend(of_rows);
    let is_asked = |finding: &Finding| finding.kind == FindingKind::SuspectedUnit && finding.column.is_some();
    // A constant column is in the list of columns.
    findings.retain(|finding| !is_asked(finding) && finding.kind != FindingKind::ConstantColumn);
    let questions = questions_of(&table);
    let doubts = table.columns.iter().filter_map(|column| UnitDoubt::of(&table, column)).collect();
    let sampling = table.quantity("time").map(|column| sampling(&column.numbers, clock));
    let possible = kinds::possible(&table, &repeats);
    Ok(Overview {
        rows: table.lines.len(),
        columns,
        sampling,
        repeats,
        held_out,
        questions,
        doubts,
        unread,
        findings,
        possible,
    })
}

/// The columns of a log whose numbers look like another unit, as questions.
///
/// # Errors
///
/// The file is not a table of measurements.
pub fn questions(path: &Path, names: &Names) -> Result<Vec<Finding>, DiagnoseError> {
    Ok(questions_of(&Table::read(path, names)?.0))
}

fn questions_of(table: &Table) -> Vec<Finding> {
    let mut questions = Vec::new();
    units(table, &mut questions);
    questions
}

fn column(table: &Table, column: &Column) -> ColumnOverview {
    let finite = || column.numbers.iter().copied().filter(|number| number.is_finite());
    let (numbers, n) = (finite().count(), column.words.len());
    let different: BTreeSet<&str> = column.words.iter().map(String::as_str).collect();
    let is_number = 2 * numbers > n && !["word", "previous"].contains(&column.meaning());
    ColumnOverview {
        name: column.name.clone(),
        meaning: meaning::of(table, column),
        unit: column.unit,
        numbers,
        empty: column.words.iter().filter(|word| word.is_empty()).count(),
        different: different.len(),
        is_constant: different.len() == 1 && n > 1,
        min: finite().reduce(f64::min).filter(|_| is_number),
        max: finite().reduce(f64::max).filter(|_| is_number),
    }
}

/// Visits of words.
fn visits(table: &Table, how: &Preparation) -> Result<Rows, DiagnoseError> {
    let which = Which { keep: how.keep.clone(), hold_out: how.hold_out.clone() };
    let (run, findings) = match poses::of_table(table, &which) {
        Ok(read) => read,
        Err(error) => {
            let finding = Finding::note(FindingKind::RowDoesNotFitArm, format!("not read as visits of words: {error}"));
            return Ok(Rows { findings: vec![finding], ..signals(table, how)? });
        }
    };
    let rows = run.samples.iter().filter(|sample| sample.held_out).count();
    let how = match (rows, run.choice.description.is_empty()) {
        (0, true) => "each word in turn".into(),
        (_, true) => "the column held_out".into(),
        _ => run.choice.description.clone(),
    };
    let groups = repeatability::groups(&run.training().map(|(_, sample)| sample).collect::<Vec<_>>());
    let dof = groups.iter().map(|group| group.len() - 1).sum();
    let repeats = Repeats { of: "words", conditions: groups.len(), dof };
    Ok(Rows { held_out: HeldOutOverview { rows, how }, repeats, findings, clock: None })
}

/// Rows of signals.
fn signals(table: &Table, how: &Preparation) -> Result<Rows, DiagnoseError> {
    let data = Prepared::new(table.clone(), how, None)?;
    let rows = data.rows.iter().filter(|row| row.held_out).count();
    let clock = Some(data.sampling).filter(|sampling| sampling.period_s > 0.0);
    let held_out = HeldOutOverview { rows, how: data.held_out };
    Ok(Rows { held_out, repeats: repeated_rows(table), findings: data.findings, clock })
}

/// Rows in which all that a prediction may rest on is the very same.
fn repeated_rows(table: &Table) -> Repeats {
    let conditions = table.columns.iter().filter(|column| kinds::is_condition(table, column));
    let conditions: Vec<&Column> = conditions.collect();
    let mut alike: BTreeMap<Vec<&str>, usize> = BTreeMap::new();
    if !conditions.is_empty() {
        for row in 0..table.lines.len() {
            *alike.entry(conditions.iter().map(|column| &column.words[row][..]).collect()).or_default() += 1;
        }
    }
    let repeated = || alike.values().filter(|n| **n > 1);
    Repeats { of: "rows", conditions: repeated().count(), dof: repeated().map(|n| n - 1).sum() }
}

fn sampling(time_s: &[f64], clock: Option<Sampling>) -> SamplingOverview {
    let finite: Vec<f64> = time_s.iter().copied().filter(|time_s| time_s.is_finite()).collect();
    let steps_s: Vec<f64> = finite.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let longest_s = MAX_STEP * usual_step_s(&steps_s);
    let count = |is: &dyn Fn(f64) -> bool| steps_s.iter().filter(|step_s| is(**step_s)).count();
    SamplingOverview {
        duration_s: finite.last().zip(finite.first()).map_or(0.0, |(last, first)| last - first),
        rate_hz: clock.as_ref().map(Sampling::rate_hz),
        jitter_s: clock.as_ref().and_then(|clock| clock.jitter_s),
        is_even: clock.as_ref().is_some_and(|clock| clock.clock == Clock::Even),
        missing_rows: clock.map_or(0, |clock| clock.n_lost),
        gaps: count(&|step_s| longest_s > 0.0 && step_s > longest_s),
        same_time: count(&|step_s| step_s == 0.0),
        time_runs_back: count(&|step_s| step_s < 0.0),
    }
}

#[cfg(test)]
mod tests;
