//! A recording for people: its parts and columns.

use darm_measure::import::summary::{ColumnSummary, PartSummary, Summary};

use crate::ui::{columns, six_digits};

/// The parts of a recording as tables.
pub(super) fn text(summary: &Summary) -> String {
    let notes = summary.notes.iter().map(|note| format!("note: {note}\n"));
    let parts = summary.parts.iter().map(|part| format!("{}\n", self::part(part)));
    format!("{}\n{}{}", summary.file, parts.collect::<String>(), notes.collect::<String>())
}

fn part(part: &PartSummary) -> String {
    let shape: Vec<String> = part.shape.iter().map(usize::to_string).collect();
    let what = match shape.len() {
        0 => String::new(),
        1 => format!(", {} rows", shape[0]),
        _ => format!(", {}", shape.join(" x ")),
    };
    let rate = part.rate_hz.map_or(String::new(), |hz| format!(", median rate {} Hz", six_digits(hz)));
    let gaps = match part.gaps {
        Some(n) if n > 0 => format!(", {n} gaps"),
        _ => String::new(),
    };
    let title = format!("{}: {}{what}{rate}{gaps}", part.name, part.kind);
    if part.columns.is_empty() {
        return title;
    }
    let head = ["  column", "type", "unit", "count", "missing", "min", "max"].map(str::to_owned).to_vec();
    let rows: Vec<Vec<String>> = std::iter::once(head).chain(part.columns.iter().map(column)).collect();
    format!("{title}\n{}", columns(&rows))
}

fn column(column: &ColumnSummary) -> Vec<String> {
    let limit = |number: Option<f64>| number.map_or(String::new(), six_digits);
    vec![
        format!("  {}", column.name),
        column.kind.into(),
        column.unit.clone().unwrap_or_default(),
        column.count.to_string(),
        column.missing.to_string(),
        limit(column.min),
        limit(column.max),
    ]
}
