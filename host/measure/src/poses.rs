//! Poses of the tool read from a table: one visit of a word a row.

use std::str::FromStr;

use darm_core::real::Vec3;
use darm_core::se::{Pose, Pose2};
use darm_core::units::Word;
use darm_robot::files::FileRef;

use super::column::Column;
use super::condition::{UnreadCondition, unread};
use super::error::{ReadError, SelectError};
use super::hold_out::{HeldOut, HoldOut};
use super::select::Selection;
use super::table::{Names, Table};
use super::{Choice, Finding, FindingKind, Run, Sample};

/// Servos that never turn by more than as many degrees are taken to be in radians.
const HALF_TURN: f64 = 3.2;
/// Rows from which on that is no chance.
const SOME_ROWS: usize = 10;

const PLANAR: [(&str, &str); 3] = [("x", "m"), ("y", "m"), ("angle", "rad")];
const SPATIAL: [(&str, &str); 6] = [("x", "m"), ("y", "m"), ("z", "m"), ("rx", "rad"), ("ry", "rad"), ("rz", "rad")];

/// Which rows of a file count, and which of them no fit may see.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Which {
    /// Rows that count; `None`: all. The others only say what came before.
    pub keep: Option<Selection>,
    /// Rows that no fit may see.
    pub hold_out: HoldOut,
}

/// Reads a file of measurements; says what its owner should know about it. `names` say what columns hold whose own names
/// do not.
///
/// Rows in which the pose is not a number, or a cell that is needed is empty, are left out and reported.
///
/// # Errors
///
/// The file cannot be read, is not a table or has no rows; or as [`of_table`].
pub fn read<'a>(file: impl Into<FileRef<'a>>, names: &Names, which: &Which) -> Result<(Run, Vec<Finding>), ReadError> {
    let (table, mut about_file) = Table::read(file, names)?;
    // That a row repeats the one before is reported where poses are checked, with what the arm knows.
    about_file.retain(|finding| finding.line.is_none());
    let (run, findings) = of_table(&table, which)?;
    about_file.extend(findings);
    Ok((run, about_file))
}

/// The same of a table.
///
/// # Errors
///
/// The column of time, word or pose is missing, a cell cannot be read as what its column holds, or `which` names a
/// column that the table does not have.
pub fn of_table(table: &Table, which: &Which) -> Result<(Run, Vec<Finding>), ReadError> {
    let columns = Columns::find(table)?;
    let in_degrees = columns.pose.last().is_some_and(|column| column.in_degrees());
    let run = Run { angles_in_degrees: Some(in_degrees), ..Run::default() };
    let (mut run, mut findings) = (run, columns.findings());
    let empty = |row: &usize| columns.needed().find(|column| column.words[*row].is_empty());
    let missing: Vec<(usize, &Column)> = (0..table.lines.len()).filter_map(|row| Some((row, empty(&row)?))).collect();
    findings.extend(missing_values(table, &missing));
    for row in (0..table.lines.len()).filter(|row| empty(row).is_none()) {
        match (Row { row, columns: &columns }).sample(run.samples.last(), run.samples.len())? {
            Ok(sample) => {
                run.samples.push(sample);
                run.lines.push(table.lines[row]);
            }
            Err(finding) => findings.push(finding),
        }
    }
    let wrong = |error| ReadError::Select { path: table.path.clone(), error };
    findings.extend(choose(&mut run, table, which).map_err(wrong)?);
    Ok((run, findings))
}

/// That rows are left out in which a cell is empty that is needed.
fn missing_values(table: &Table, missing: &[(usize, &Column)]) -> Option<Finding> {
    let (row, column) = missing.first()?;
    let text = format!(
        "{} of {} rows are left out because a cell is empty, the first in line {}, column {}",
        missing.len(),
        table.lines.len(),
        table.lines[*row],
        column.name
    );
    Some(Finding::note(FindingKind::MissingValue, text))
}

/// Which samples count, and how unseen ones are distinguished; that none is, where some should be.
fn choose(run: &mut Run, table: &Table, which: &Which) -> Result<Option<Finding>, SelectError> {
    let mut kept = table.clone();
    if let Some(keep) = &which.keep {
        kept.retain(&keep.rows(table)?);
    }
    let held_out = match &which.hold_out {
        HoldOut::Own if kept.quantity("held_out").is_none() => HeldOut::default(),
        how => how.rows(&kept, None)?,
    };
    let parts = match &which.hold_out {
        HoldOut::Each(name) => Some(kept.numbered(name)?),
        _ => None,
    };
    // The lines of a table rise.
    let at: Vec<Option<usize>> = run.lines.iter().map(|line| kept.lines.binary_search(line).ok()).collect();
    let samples = run.samples.iter_mut().zip(&at);
    samples.for_each(|(sample, row)| sample.held_out = row.is_some_and(|row| held_out.rows.get(row) == Some(&true)));
    let nothing = held_out.nothing(&which.hold_out);
    run.choice = Choice {
        unused: at.iter().map(Option::is_none).collect(),
        parts: parts.map(|parts| at.iter().map(|row| row.map_or(0, |row| parts[row])).collect()),
        description: held_out.description,
    };
    Ok(nothing)
}

/// The columns of a table that hold each quantity.
struct Columns<'a> {
    table: &'a Table,
    time: &'a Column,
    word: &'a Column,
    previous: Option<&'a Column>,
    servos: Vec<&'a Column>,
    pose: Vec<&'a Column>,
    supply: Option<&'a Column>,
    temperature: Option<&'a Column>,
    load: Option<&'a Column>,
    strokes: Vec<&'a Column>,
    run: Option<&'a Column>,
    visit: Option<&'a Column>,
}

impl<'a> Columns<'a> {
    fn find(table: &'a Table) -> Result<Self, ReadError> {
        let planar = table.quantity("z").is_none();
        let pose = if planar { &PLANAR[..] } else { &SPATIAL };
        let in_unit = |quantity: &str, unit: &str| table.quantity(quantity).filter(|column| column.unit == unit);
        let needed = |quantity: &str, unit: &str| {
            let end = if unit == "rad" { "deg" } else { unit };
            let column = if end.is_empty() { quantity.into() } else { format!("{quantity}_{end}") };
            let none = ReadError::NoQuantity { path: table.path.clone(), column, present: table.present() };
            in_unit(quantity, unit).ok_or(none)
        };
        let servo = |k: usize| in_unit(&format!("servo{k}"), "rad");
        Ok(Self {
            table,
            time: needed("time", "s")?,
            word: needed("word", "")?,
            previous: table.quantity("previous"),
            servos: (0..).map_while(servo).collect(),
            pose: pose.iter().map(|(quantity, unit)| needed(quantity, unit)).collect::<Result<_, _>>()?,
            supply: in_unit("supply", "Pa"),
            temperature: in_unit("temperature", "°C"),
            load: in_unit("load", "kg"),
            strokes: (0..).map_while(|k| in_unit(&format!("stroke{k}"), "s")).collect(),
            run: table.quantity("run"),
            visit: table.quantity("visit"),
        })
    }

    /// Columns without which a row is no sample.
    fn needed(&self) -> impl Iterator<Item = &'a Column> {
        let conditions = [self.time, self.word].into_iter().chain(self.load);
        conditions.chain(self.servos.iter().copied()).chain(self.pose.iter().copied())
    }

    /// Columns that hold nothing which is known here, and angles that look like another unit.
    fn findings(&self) -> Vec<Finding> {
        let optional = [self.previous, self.supply, self.temperature, self.run, self.visit];
        let optional = optional.into_iter().flatten().chain(self.strokes.iter().copied());
        let known: Vec<&str> = self.needed().chain(optional).map(|column| &column.name[..]).collect();
        let conditions = unread(self.table);
        let is_condition = |name: &str| conditions.iter().any(|condition| condition.column == name);
        let mut findings: Vec<Finding> = conditions.iter().map(unread_condition).collect();
        let columns = self.table.columns.iter().filter(|column| column.meaning() != "held_out");
        let names = columns.map(|column| &column.name[..]);
        let others: Vec<&str> = names.filter(|name| !known.contains(name) && !is_condition(name)).collect();
        if !others.is_empty() {
            let text = format!("columns not read: {}", others.join(", "));
            findings.push(Finding::note(FindingKind::UnreadColumns, text));
        }
        let in_degrees = self.servos.iter().filter(|column| column.in_degrees());
        let max_deg = in_degrees.flat_map(|column| &column.numbers).fold(0f64, |max, q| max.max(q.to_degrees().abs()));
        if max_deg > 0.0 && max_deg < HALF_TURN && self.table.lines.len() > SOME_ROWS {
            let text = format!(
                "no servo turns by more than {HALF_TURN}: are the positions in rad? the columns are read as degrees"
            );
            findings.push(Finding::note(FindingKind::SuspectedUnit, text));
        }
        findings
    }
}

/// That a condition is not read.
fn unread_condition(UnreadCondition { column, quantity, fault, units }: &UnreadCondition) -> Finding {
    let names: Vec<String> = units.iter().map(|unit| format!("{quantity}_{unit}")).collect();
    let text = format!("column {column} is not read: {quantity}, {fault}; name it {}", names.join(" or "));
    Finding::note(FindingKind::UnreadCondition, text).in_column(column)
}

/// One row with what is needed to say what is wrong with it.
struct Row<'a> {
    row: usize,
    columns: &'a Columns<'a>,
}

impl Row<'_> {
    /// The sample of this row, or why it is left out.
    fn sample(&self, before: Option<&Sample>, index: usize) -> Result<Result<Sample, Finding>, ReadError> {
        let columns = self.columns;
        let mut numbers = [0.0f64; 6];
        for (number, column) in numbers.iter_mut().zip(&columns.pose) {
            *number = self.number(column)?;
            if !number.is_finite() {
                return Ok(Err(self.finding(format!("{} is not a number, the row is left out", column.name))));
            }
        }
        let time_s = self.number(columns.time)?;
        let word: Word = self.required(columns.word, "digits 0 to 3")?;
        let run = self.optional(columns.run, "an integer")?.unwrap_or(0);
        let previous = match columns.previous {
            Some(column) => self.optional(Some(column), "digits 0 to 3")?,
            None => before.filter(|before| before.run == run).map(|before| before.word),
        };
        let servos_rad = columns.servos.iter().map(|column| self.number(column)).collect::<Result<Vec<f64>, _>>()?;
        if !time_s.is_finite() || servos_rad.iter().any(|angle| !angle.is_finite()) {
            return Ok(Err(self.finding("time or servo position is not a number, the row is left out".into())));
        }
        Ok(Ok(Sample {
            time_s,
            word,
            previous,
            servos_rad,
            pose: pose(&numbers[..columns.pose.len()]),
            supply: self.measured(columns.supply)?,
            temperature_c: self.measured(columns.temperature)?,
            load_kg: self.measured(columns.load)?,
            strokes_s: columns.strokes.iter().map(|&column| self.measured(Some(column))).collect::<Result<_, _>>()?,
            run,
            visit: self.optional(columns.visit, "an integer")?.unwrap_or(index as u32),
            held_out: false,
        }))
    }

    fn finding(&self, text: String) -> Finding {
        Finding::note(FindingKind::NotANumber, text).at_line(self.columns.table.lines[self.row])
    }

    /// The number of a cell in SI units, which may be NaN.
    fn number(&self, column: &Column) -> Result<f64, ReadError> {
        self.required::<f64>(column, "a number").map(|_| column.numbers[self.row])
    }

    /// The same of a cell that may be empty or missing; `None` of what is not finite.
    fn measured(&self, column: Option<&Column>) -> Result<Option<f64>, ReadError> {
        let Some(column) = column.filter(|column| !column.words[self.row].is_empty()) else { return Ok(None) };
        self.number(column).map(|number| Some(number).filter(|number| number.is_finite()))
    }

    fn required<T: FromStr>(&self, column: &Column, expected: &'static str) -> Result<T, ReadError> {
        let wrong = |_| self.columns.table.wrong_cell(self.row, column, expected).into();
        column.words[self.row].parse().map_err(wrong)
    }

    /// `None` of an empty cell or a missing column.
    fn optional<T: FromStr>(&self, column: Option<&Column>, expected: &'static str) -> Result<Option<T>, ReadError> {
        match column.filter(|column| !column.words[self.row].is_empty()) {
            Some(column) => self.required(column, expected).map(Some),
            None => Ok(None),
        }
    }
}

/// Three numbers of a planar pose or six of one in space: lengths and a rotation vector, in m and rad.
fn pose(numbers: &[f64]) -> Pose<f64> {
    match *numbers {
        [x, y, z, rx, ry, rz] => Pose::new(&Vec3::new(rx, ry, rz), Vec3::new(x, y, z)),
        _ => Pose2::new(numbers[0], numbers[1], numbers[2]).into(),
    }
}

#[cfg(test)]
mod tests;
