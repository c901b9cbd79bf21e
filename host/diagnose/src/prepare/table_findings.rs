//! What is wrong or suspicious in a table, before any of it is used.

use serde::Serialize;

use crate::prepare::error::PrepareError;
use darm_arm::arm::ZERO_CELSIUS;
use darm_measure::column::Column;
use darm_measure::table::Table;
use darm_measure::{Finding, FindingKind, median};

/// A joint or tool that turns farther, rad, is taken for one in degrees; joints that never turn so far, deg, for ones in radians;
/// a position, m, farther away for one in millimetres (of a tool whose words were logged, which arms of 10 m reach, much
/// farther); a pressure that stays below, Pa, for one in bar.
const LARGEST_ANGLE: f64 = 4.0 * std::f64::consts::PI;
const HALF_TURN: f64 = 3.2;
const LARGEST_LENGTH: f64 = 10.0;
const LARGEST_REACH: f64 = 100.0;
const MIN_PRESSURE: f64 = 1e3;
/// A pressure above it, Pa, which no hydraulics has, for one in pascal.
const MAX_PRESSURE: f64 = 2e8;
/// The median of temperatures in °C that is taken for kelvin above, and of those in K that is taken for °C below.
const MAX_CELSIUS: f64 = 200.0;
const MIN_KELVIN: f64 = 150.0;
/// Rows from which on small joint positions are no chance.
const SOME_ROWS: usize = 10;
/// Share of the rows in which time may run back: new recordings begin there.
const MAX_BACKWARD: f64 = 0.1;

/// That time has numbers where other columns of the table have some, and increases, except for a few rows.
pub(super) fn check_times(table: &Table, time_s: &[f64]) -> Result<(), PrepareError> {
    let steps = time_s.len().saturating_sub(1);
    let count = |of: fn(f64) -> bool| time_s.windows(2).filter(|pair| of(pair[1] - pair[0])).count();
    let (backward, forward) = (count(|step_s| step_s < 0.0), count(|step_s| step_s > 0.0));
    let cure = "is this the column of time? give rows without it a rate with --rate";
    // Where no column has any, the first that is needed is the better answer.
    let has_numbers = table.columns.iter().any(|column| column.numbers.iter().any(|number| number.is_finite()));
    if has_numbers && time_s.iter().all(|time_s| time_s.is_nan()) {
        let (file, converted) = (table.path.display(), table.path.with_extension("table.csv"));
        let text = format!(
            "the column of time has no numbers; convert dates and times of day with `darm import {file} -o {}`",
            converted.display()
        );
        return Err(PrepareError::Nothing(text));
    }
    if steps > 0 && forward == 0 && time_s.iter().all(|time_s| time_s.is_finite()) {
        return Err(PrepareError::Nothing(format!("time never increases; {cure}")));
    }
    if backward as f64 > MAX_BACKWARD * steps as f64 {
        let text = format!("time runs back in {backward} of {} rows; sort the rows by time; {cure}", time_s.len());
        return Err(PrepareError::Nothing(text));
    }
    Ok(())
}

/// Leaves out rows in which a column of numbers has none; says which.
pub(super) fn leave_out_gaps(table: &mut Table, findings: &mut Vec<Finding>) {
    let mut keep = vec![true; table.lines.len()];
    for column in &table.columns {
        let numbers = column.numbers.iter().filter(|number| number.is_finite()).count();
        if 2 * numbers <= column.numbers.len() {
            continue;
        }
        for (row, number) in column.numbers.iter().enumerate().filter(|(_, number)| !number.is_finite()) {
            let text =
                format!("{} is `{}`, not a number ({number}): the row is left out", column.name, column.words[row]);
            let finding = Finding::note(FindingKind::NotANumber, text).at_line(table.lines[row]);
            findings.push(finding.in_column(&column.name));
            keep[row] = false;
        }
    }
    if keep.contains(&false) {
        table.retain(&keep);
    }
}

/// Why the first row in which a quantity is not a number below `largest` cannot be used; `None` where there is none.
pub(super) fn first_not_a_number(table: &Table, quantity: &str, largest: f64) -> Option<PrepareError> {
    let column = table.quantity(quantity)?;
    let is_none = |number: &f64| number.is_nan() || number.abs() >= largest;
    let row = column.numbers.iter().position(is_none)?;
    let (name, cell, n_rows) = (&column.name, &column.words[row], column.numbers.len());
    let n_none = column.numbers.iter().filter(|number| is_none(number)).count();
    let cure = match cell.replace(',', ".").parse::<f64>() {
        Ok(number) if number.abs() < largest => {
            "write numbers with a decimal point, or convert the file with darm import"
        }
        _ => "correct the column, or leave rows out with --where",
    };
    let what = format!("{name} is `{cell}`, not a number, as in {n_none} of {n_rows} rows; {cure}");
    Some(PrepareError::Row { line: table.lines[row], what })
}

/// Columns that never change.
pub(super) fn constant(table: &Table, findings: &mut Vec<Finding>) {
    for column in table.columns.iter().filter(|column| column.numbers.len() > 10) {
        if column.numbers.windows(2).all(|pair| pair[0] == pair[1]) {
            let finding = Finding::note(FindingKind::ConstantColumn, format!("{} never changes", column.name));
            findings.push(finding.in_column(&column.name));
        }
    }
}

/// Numbers that look like another unit than the one they are read in, with the option that reads them so.
pub(crate) fn units(table: &Table, findings: &mut Vec<Finding>) {
    for column in &table.columns {
        let Some(doubt) = UnitDoubt::of(table, column) else { continue };
        let option = format!("{}_{}={}", column.quantity, doubt.unit, column.name);
        let option = if option.contains(char::is_whitespace) { format!("'{option}'") } else { option };
        let text = format!("{}? --column {option} reads them so", doubt.question);
        findings.push(Finding::note(FindingKind::SuspectedUnit, text).in_column(&column.name));
    }
}

/// A column whose numbers look like another unit than the one they are read in.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct UnitDoubt {
    /// Name of the column in the file.
    pub column: String,
    /// Why its unit looks wrong, and which it may be: a question without its mark.
    pub question: String,
    /// How names of columns in that unit end.
    pub unit: &'static str,
}

impl UnitDoubt {
    /// `None` where the unit is plausible.
    pub(crate) fn of(table: &Table, column: &Column) -> Option<Self> {
        let Doubt { found, meant, end } = doubt(table, column)?;
        let question = format!("{} {found}: are these {meant}", column.name);
        Some(Self { column: column.name.clone(), question, unit: end })
    }
}

/// Why a unit looks wrong, which it may be, and how names of columns in it end.
struct Doubt {
    found: String,
    meant: &'static str,
    end: &'static str,
}

fn doubt(table: &Table, column: &Column) -> Option<Doubt> {
    let finite = || column.numbers.iter().copied().filter(|number| number.is_finite());
    let (largest, middle) = (finite().fold(0.0f64, |max, n| max.max(n.abs())), median(finite())?);
    let farthest = if table.quantity("word").is_some() { LARGEST_REACH } else { LARGEST_LENGTH };
    let up_to = |unit: &str, meant, end| Some(Doubt { found: format!("goes up to {largest} {unit}"), meant, end });
    let usually = |unit: &str, meant, end| Some(Doubt { found: format!("is usually {middle} {unit}"), meant, end });
    match (column.meaning(), column.unit) {
        (_, "" | "rad") if is_angle(column) && largest > LARGEST_ANGLE => up_to("rad", "degrees", "deg"),
        (_, "rad") if is_joint(column) && are_radians(table) && column.in_degrees() => Some(Doubt {
            found: format!("never exceeds {:.2} deg", largest.to_degrees()),
            meant: "radians",
            end: "rad",
        }),
        ("position" | "y" | "z" | "px" | "py" | "pz", "" | "m") if largest > farthest => {
            up_to("m", "millimetres", "mm")
        }
        ("pressure" | "supply", "" | "Pa") if largest > 0.0 && largest < MIN_PRESSURE => up_to("Pa", "bar", "bar"),
        ("pressure" | "supply", "Pa") if largest > MAX_PRESSURE => up_to("Pa", "pascal", "pa"),
        ("temperature", "" | "°C") if middle > MAX_CELSIUS => usually("°C", "kelvin", "k"),
        ("temperature", "°C") if column.file_unit().eq_ignore_ascii_case("k") && middle + ZERO_CELSIUS < MIN_KELVIN => {
            let kelvin = ((middle + ZERO_CELSIUS) * 1e6).round() / 1e6;
            Some(Doubt { found: format!("is usually {kelvin} K"), meant: "degrees Celsius", end: "c" })
        }
        _ => None,
    }
}

/// Whether all joints that are read in degrees stay within half a turn of radians, and one of them moves.
fn are_radians(table: &Table) -> bool {
    let joints = table.columns.iter().filter(|column| is_joint(column) && column.in_degrees());
    let numbers = joints.flat_map(|column| &column.numbers).filter(|number| number.is_finite());
    let largest_deg = numbers.fold(0.0f64, |max, number| max.max(number.to_degrees().abs()));
    largest_deg > 0.0 && largest_deg < HALF_TURN && table.lines.len() > SOME_ROWS
}

/// Whether a column is the position of a joint by its number.
fn is_joint(column: &Column) -> bool {
    column.quantity.strip_prefix('q').is_some_and(|number| number.parse::<u8>().is_ok())
}

fn is_angle(column: &Column) -> bool {
    is_joint(column) || ["angle", "rx", "ry", "rz"].contains(&column.meaning())
}
