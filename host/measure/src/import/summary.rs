//! What is in a recording, as numbers: rows, ranges, rates, gaps.

use serde::Serialize;

use crate::import::join::{n_gaps, usual_step_ns};
use crate::import::proposal::time_column;
use crate::import::recording::{Column, Part, Recording};
use crate::unit::Unit;

/// A recording in brief.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// The file or folder.
    pub file: String,
    /// Its tables, arrays and topics.
    pub parts: Vec<PartSummary>,
    /// What its owner should know.
    pub notes: Vec<String>,
}

/// A table, an array or a topic.
#[derive(Clone, Debug, Serialize)]
pub struct PartSummary {
    /// Its name; `table` where it has none.
    pub name: String,
    /// Its type.
    pub kind: String,
    /// Its extent along each dimension.
    pub shape: Vec<usize>,
    /// Median rate of its rows; null without time stamps.
    pub rate_hz: Option<f64>,
    /// Number of steps of time longer than five usual ones; null without time stamps.
    pub gaps: Option<usize>,
    /// Its columns.
    pub columns: Vec<ColumnSummary>,
}

/// A column.
#[derive(Clone, Debug, Serialize)]
pub struct ColumnSummary {
    /// Its name.
    pub name: String,
    /// `number` or `text`.
    pub kind: &'static str,
    /// The unit that the file names.
    pub unit: Option<String>,
    /// Number of cells with a value.
    pub count: usize,
    /// Number of cells without one.
    pub missing: usize,
    /// Smallest finite number, in the unit of the file.
    pub min: Option<f64>,
    /// Largest finite number.
    pub max: Option<f64>,
}

/// A recording in brief.
pub fn summary(recording: &Recording) -> Summary {
    let parts = recording.parts.iter().map(part).collect();
    Summary { file: recording.path.display().to_string(), parts, notes: recording.notes.clone() }
}

fn part(part: &Part) -> PartSummary {
    let stamps_ns = stamps_ns(part);
    PartSummary {
        name: part.shown().into(),
        kind: part.kind.clone(),
        shape: part.shape.clone(),
        rate_hz: stamps_ns.as_deref().and_then(usual_step_ns).map(|step_ns| 1e9 / step_ns),
        gaps: stamps_ns.as_deref().map(n_gaps),
        columns: part.columns.iter().map(column).collect(),
    }
}

/// Time stamps of the rows, or a column that has them.
fn stamps_ns(part: &Part) -> Option<Vec<i64>> {
    if !part.stamps_ns.is_empty() {
        return Some(part.stamps_ns.clone());
    }
    let (column, unit) = time_column(part).filter(|_| part.n_rows() > 1)?;
    let (factor, _) = unit.conversion(Unit::named("ns")?)?;
    Some(part.columns[column].numbers.iter().filter(|x| x.is_finite()).map(|x| (x * factor).round() as i64).collect())
}

fn column(column: &Column) -> ColumnSummary {
    let is_numeric = column.is_numeric();
    let range = column.range().filter(|_| is_numeric);
    let count = column.n_values();
    ColumnSummary {
        name: column.name.clone(),
        kind: if is_numeric { "number" } else { "text" },
        unit: column.unit.clone(),
        count,
        missing: column.numbers.len() - count,
        min: range.map(|[low, _]| low),
        max: range.map(|[_, high]| high),
    }
}
