//! What is wrong or suspicious in a table, before any of it is used.

use crate::measurement::table::Table;
use crate::measurement::{Finding, FindingKind};
use crate::prepare::error::PrepareError;

/// A joint that turns farther, rad, is taken for one in degrees; a position, m, for one in millimetres; a pressure that
/// stays below, Pa, for one in bar.
const LARGEST_ANGLE: f64 = 4.0 * std::f64::consts::PI;
const LARGEST_LENGTH: f64 = 10.0;
const MIN_PRESSURE: f64 = 1e3;
/// Share of the rows in which time may run back: new recordings begin there.
const MAX_BACKWARD: f64 = 0.1;

/// That time increases, except for a few rows.
pub(super) fn check_times(time_s: &[f64]) -> Result<(), PrepareError> {
    let steps = time_s.len().saturating_sub(1);
    let count = |of: fn(f64) -> bool| time_s.windows(2).filter(|pair| of(pair[1] - pair[0])).count();
    let (backward, forward) = (count(|step_s| step_s < 0.0), count(|step_s| step_s > 0.0));
    let cure = "is this the column of time? give rows without it a rate with --rate";
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

/// Columns that never change.
pub(super) fn constant(table: &Table, findings: &mut Vec<Finding>) {
    for column in table.columns.iter().filter(|column| column.numbers.len() > 10) {
        if column.numbers.windows(2).all(|pair| pair[0] == pair[1]) {
            let finding = Finding::note(FindingKind::ConstantColumn, format!("{} never changes", column.name));
            findings.push(finding.in_column(&column.name));
        }
    }
}

/// Numbers that look like another unit than the one they are read in.
pub(super) fn units(table: &Table, findings: &mut Vec<Finding>) {
    for column in &table.columns {
        let largest = column.numbers.iter().filter(|number| number.is_finite()).fold(0.0f64, |max, n| max.max(n.abs()));
        let joint = column.quantity.strip_prefix('q').is_some_and(|number| number.parse::<u8>().is_ok());
        let doubt = match (column.meaning(), column.unit) {
            (_, "" | "rad") if joint && largest > LARGEST_ANGLE => ("rad", "degrees", "_deg"),
            ("position", "" | "m") if largest > LARGEST_LENGTH => ("m", "millimetres", "_mm"),
            ("pressure", _) if largest > 0.0 && largest < MIN_PRESSURE => ("Pa", "bar", "_bar"),
            _ => continue,
        };
        let (read, meant, end) = doubt;
        let text = format!(
            "{} goes up to {largest} {read}: are these {meant}? a column whose name ends in {end} is read so",
            column.name
        );
        findings.push(Finding::note(FindingKind::SuspectedUnit, text).in_column(&column.name));
    }
}
