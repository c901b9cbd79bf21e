//! Tables of channels as comma-separated text: whatever was measured, one quantity a column.
//!
//! # Columns
//!
//! The header names quantity and unit, as `pressure_bar`: what follows the last `_` is the unit where it is one of those
//! below, or what follows in brackets, as in `pressure [bar]`, and numbers become SI units and radians when they are read. Upper and lower case are the same in a quantity.
//!
//! | unit | meaning | unit | meaning |
//! | --- | --- | --- | --- |
//! | `s`, `sec`, `ms`, `us`, `ns` | time | `n`, `nm` | force, torque |
//! | `m`, `mm`, `um` | length | `bar`, `pa`, `kpa` | pressure over the surroundings' |
//! | `rad`, `deg` | angle | `a`, `v` | current, voltage |
//! | `c`, `k` | temperature | `count` | steps of an encoder |
//! | `rad_s`, `deg_s`, `m_s`, `mm_s` | velocity | `rad_s2`, `deg_s2`, `m_s2`, `mm_s2` | acceleration |
//!
//! | quantity | names |
//! | --- | --- |
//! | time | `time`, `t`, `timestamp`, `stamp`, `elapsed`; without a unit by the size of its numbers |
//! | position, target | `position`, `pos`, `x`; `target` |
//! | pressure, force, load | `pressure`, `p`; `force`, `f`; `load` |
//! | temperature, supply | `temperature`, `temp`; `supply` |
//! | joint position, velocity, acceleration, torque | `q1`…, `v1`…, `a1`…, `tau1`… or `JOINT`, `v_JOINT`, `a_JOINT`, `tau_JOINT` |
//! | motor position, torque | `qm1`…, `taum1`… |
//! | wrench on the base's surroundings | `Fx`, `Fy`, `Fz`, `Mx`, `My`, `Mz` |
//! | pose of a floating base | `px`, `py`, `pz`, `qx`, `qy`, `qz`, `qw` |
//! | rows whose posture is new | `fresh` |
//! | held out | `held_out`, `heldout` |
//!
//! Cells that are no numbers are words: any column may group, select or hold out rows.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use darm_robot::csv_table::{CsvError, CsvFault, csv_error, csv_reader, place_of};
use darm_robot::files::{FileRef, Limits};
use darm_robot::source::Fault;

use super::column::Column;
use super::csv::content;
use super::error::{ReadError, SelectError};
use super::foreign;
use super::import::header::is_units;
use super::import::proposal::increasing_time;
use super::unit::{self, Unit, split_ours};
use super::{Finding, FindingKind};

/// A table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// The file.
    pub path: PathBuf,
    /// The columns, in the order of the file.
    pub columns: Vec<Column>,
    /// The line of each row, the header being 1.
    pub lines: Vec<usize>,
    /// The text that it was read from, for the places of cells, and where in it each row is.
    text: Arc<[u8]>,
    positions: Vec<csv::Position>,
}

/// Names given to columns: quantity (with its unit, if any) to the column's name in the file.
pub type Names = BTreeMap<String, String>;

/// The text with lines that end in `\n` alone, as the count of lines expects it.
fn with_plain_ends(text: &[u8]) -> Vec<u8> {
    let at = |k: &usize| !(text[*k] == b'\r' && text.get(k + 1) == Some(&b'\n'));
    (0..text.len()).filter(at).map(|k| text[k]).collect()
}

/// A column of time whose name has no unit, and whose numbers are not seconds by their size, is brought to seconds; says so.
fn time_without_unit(column: &mut Column) -> Option<Finding> {
    let is_time = column.meaning() == "time" && column.unit.is_empty();
    let unit = Some(unit::of_times(&column.numbers)).filter(|unit| is_time && unit.name != "s")?;
    column.numbers.iter_mut().for_each(|number| *number = unit.to_si(*number));
    column.unit = "s";
    let name = &column.name;
    let text = format!("{name} has no unit; by the size of its numbers it is time in {}", unit.name);
    Some(Finding::note(FindingKind::SuspectedUnit, text).in_column(name))
}

/// That rows repeat the ones before them, of which these are the lines: said once, for a log may have millions.
fn repeated_rows(lines: &[usize]) -> Option<Finding> {
    let (first, last) = (lines.first()?, lines.last()?);
    let text = match lines.len() - 1 {
        0 => "the row repeats the one before".to_owned(),
        1 => format!("the row repeats the one before, and so does line {last}"),
        n => format!("the row repeats the one before, and so do {n} others, the last in line {last}"),
    };
    Some(Finding::note(FindingKind::RepeatedRow, text).at_line(*first))
}

/// Where no column is called time, the one that may be by its name, and whose numbers only increase; says so.
fn time_by_its_numbers(columns: &mut [Column]) -> Option<Finding> {
    if columns.iter().any(|column| column.meaning() == "time") {
        return None;
    }
    let unit = |column: &Column| {
        let unit = Unit::named(column.unit).filter(|_| !column.unit.is_empty());
        increasing_time(&column.quantity, unit, &column.numbers)
    };
    let (column, unit) = columns.iter_mut().find_map(|column| unit(column).map(|unit| (column, unit)))?;
    column.numbers.iter_mut().for_each(|number| *number = unit.to_si(*number));
    (column.quantity, column.unit) = ("time".into(), "s");
    let name = &column.name;
    let text = format!("no column is called time; {name}, which only increases, is taken as time in {}", unit.name);
    Some(Finding::note(FindingKind::SuspectedUnit, text).in_column(name))
}

impl Table {
    /// Reads a table; `names` say what columns hold whose own names do not.
    ///
    /// # Errors
    ///
    /// The file cannot be read or decompressed; or as [`read_text`](Self::read_text).
    pub fn read<'a>(file: impl Into<FileRef<'a>>, names: &Names) -> Result<(Self, Vec<Finding>), ReadError> {
        let file = file.into();
        let content = content(&file)?;
        let (table, mut findings) = Self::read_within(file.path, &content.text, names, &file.files.limits())?;
        if content.cut {
            let text = format!(
                "the file ends early, in the middle of a row; its {} complete rows are read",
                table.lines.len()
            );
            findings.push(Finding::note(FindingKind::TruncatedFile, text));
        }
        if !content.damaged.is_empty() {
            let (what, n) = (content.damaged.join(", "), table.lines.len());
            let text = format!("the log is damaged and parts are left out: {what}; its {n} other rows are read");
            findings.push(Finding::note(FindingKind::TruncatedFile, text));
        }
        Ok((table, findings))
    }

    /// The same of text that is in memory; `path` only serves messages.
    ///
    /// # Errors
    ///
    /// A row is longer or shorter than the header, a column that `names` gives a meaning is missing, or there are no
    /// rows.
    pub fn read_text(path: &Path, text: &[u8], names: &Names) -> Result<(Self, Vec<Finding>), ReadError> {
        Self::read_within(path, text, names, &Limits::COMMAND)
    }

    fn read_within(
        path: &Path,
        text: &[u8],
        names: &Names,
        limits: &Limits,
    ) -> Result<(Self, Vec<Finding>), ReadError> {
        let too_large = || ReadError::Io { path: path.into(), error: io::Error::other(limits.too_many_cells()) };
        let text: Arc<[u8]> = with_plain_ends(text).into();
        let wrong = |error| csv_error(path, &text, &error);
        let mut file = csv_reader(&text);
        let header = file.headers().map_err(wrong)?.clone();
        if header.len() > limits.columns {
            return Err(too_large());
        }
        if let Some(missing) = names.values().find(|column| !header.iter().any(|name| name == column.as_str())) {
            let present = header.iter().collect::<Vec<_>>().join(", ");
            return Err(ReadError::NoColumn { path: path.into(), column: missing.clone(), present });
        }
        let given =
            |name: &str| names.iter().find(|(_, column)| column.as_str() == name).map(|(key, _)| split_ours(key));
        let kinds: Vec<_> = header.iter().map(|name| given(name).unwrap_or_else(|| split_ours(name))).collect();
        let mut columns: Vec<Column> = header
            .iter()
            .zip(&kinds)
            .map(|(name, (quantity, unit))| Column {
                name: name.into(),
                quantity: quantity.clone(),
                unit: unit.map_or("", Unit::si),
                numbers: Vec::new(),
                words: Vec::new(),
            })
            .collect();
        let (mut lines, mut positions, mut repeated, mut before) = (Vec::new(), Vec::new(), Vec::new(), None);
        for record in file.records() {
            let record = record.map_err(wrong)?;
            if !limits.has_room_for(lines.len() + 1, header.len()) {
                return Err(too_large());
            }
            let position = record.position().cloned().unwrap_or_else(csv::Position::new);
            let line = place_of(&text, Some(&position), 0).map_or(0, |place| place.line);
            if before.as_ref() == Some(&record) {
                repeated.push(line);
            }
            if lines.is_empty() && is_units(record.iter()) {
                return Err(ReadError::Foreign { path: path.into(), fault: foreign::row_of_units(path, line) });
            }
            for (column, (cell, (_, unit))) in columns.iter_mut().zip(record.iter().zip(&kinds)) {
                column.numbers.push(
                    cell.parse::<f64>().map_or(f64::NAN, |number| unit.map_or(number, |unit| unit.to_si(number))),
                );
                column.words.push(cell.into());
            }
            lines.push(line);
            positions.push(position);
            before = Some(record);
        }
        if lines.is_empty() {
            return Err(ReadError::Empty { path: path.into() });
        }
        let mut findings: Vec<Finding> = repeated_rows(&repeated).into_iter().collect();
        findings.extend(columns.iter_mut().filter_map(time_without_unit));
        findings.extend(time_by_its_numbers(&mut columns));
        Ok((Self { path: path.into(), columns, lines, text, positions }, findings))
    }

    /// The error that a cell is not what its column holds.
    pub(super) fn wrong_cell(&self, row: usize, column: &Column, expected: &str) -> CsvError {
        let number = self.columns.iter().position(|own| own.name == column.name).unwrap_or(0);
        let fault =
            CsvFault::Cell { column: column.name.clone(), text: column.words[row].clone(), expected: expected.into() };
        CsvError {
            path: self.path.clone(),
            place: place_of(&self.text, self.positions.get(row), number),
            fault: Fault::Content(fault.into()),
        }
    }

    /// The column with this name in the file.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// The column that holds this quantity, by its own name or another.
    pub fn quantity(&self, quantity: &str) -> Option<&Column> {
        let small = quantity.to_lowercase();
        let by = |name: fn(&Column) -> &str| self.columns.iter().find(|column| name(column) == small);
        by(|column| &column.quantity).or_else(|| by(Column::meaning))
    }

    /// The same, or what is missing.
    ///
    /// # Errors
    ///
    /// [`ReadError::NoQuantity`]: no column holds this quantity.
    pub fn required(&self, quantity: &str) -> Result<&Column, ReadError> {
        self.quantity(quantity).ok_or_else(|| ReadError::NoQuantity {
            path: self.path.clone(),
            column: quantity.into(),
            present: self.present(),
        })
    }

    /// The column with this name in the file, or which there are.
    ///
    /// # Errors
    ///
    /// [`SelectError::NoColumn`]: no column has this name.
    pub fn chosen(&self, name: &str) -> Result<&Column, SelectError> {
        self.column(name).ok_or_else(|| SelectError::NoColumn { column: name.into(), present: self.present() })
    }

    /// Where a column is not 0; what is empty is 0.
    ///
    /// # Errors
    ///
    /// No column has this name or holds this quantity, or a cell of it is neither empty nor a number.
    pub fn flags(&self, name: &str) -> Result<Vec<bool>, SelectError> {
        let column = self.column(name).or_else(|| self.quantity(name)).map_or_else(|| self.chosen(name), Ok)?;
        let flag = |(row, number): (usize, &f64)| match &column.words[row][..] {
            "" => Ok(false),
            text if number.is_nan() => {
                Err(SelectError::NoFlag { column: name.into(), line: self.lines[row], text: text.into() })
            }
            _ => Ok(*number != 0.0),
        };
        column.numbers.iter().enumerate().map(flag).collect()
    }

    /// The different values of a column, in order.
    ///
    /// # Errors
    ///
    /// [`SelectError::NoColumn`]: no column has this name.
    pub fn values_of(&self, name: &str) -> Result<Vec<String>, SelectError> {
        let mut values = self.chosen(name)?.words.clone();
        values.sort();
        values.dedup();
        Ok(values)
    }

    /// The number of each row's value among the different ones of a column.
    ///
    /// # Errors
    ///
    /// [`SelectError::NoColumn`]: no column has this name.
    #[expect(clippy::missing_panics_doc, reason = "the values are those of the words")]
    pub fn numbered(&self, name: &str) -> Result<Vec<usize>, SelectError> {
        let (values, words) = (self.values_of(name)?, &self.chosen(name)?.words);
        let number = |word: &String| values.binary_search(word).expect("the values are those of the words");
        Ok(words.iter().map(number).collect())
    }

    /// The names of all columns.
    pub(super) fn present(&self) -> String {
        self.columns.iter().map(|column| column.name.as_str()).collect::<Vec<_>>().join(", ")
    }

    /// The rows that `keep` selects, the others are left out.
    pub fn retain(&mut self, keep: &[bool]) {
        let kept = |k: &usize| keep.get(*k).copied().unwrap_or(false);
        let rows: Vec<usize> = (0..self.lines.len()).filter(kept).collect();
        for column in &mut self.columns {
            column.numbers = rows.iter().map(|&row| column.numbers[row]).collect();
            column.words = rows.iter().map(|&row| std::mem::take(&mut column.words[row])).collect();
        }
        self.lines = rows.iter().map(|&row| self.lines[row]).collect();
        self.positions = rows.iter().map(|&row| self.positions[row].clone()).collect();
    }
}
