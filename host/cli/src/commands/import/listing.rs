//! A recording for people: its parts and columns.

use darm_import::summary::{ColumnSummary, PartSummary, Summary};

use crate::ui::columns;

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
    let rate = part.rate_hz.map_or(String::new(), |hz| format!(", median rate {} Hz", short(hz)));
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
    let limit = |number: Option<f64>| number.map_or(String::new(), short);
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

/// A number with about six digits.
fn short(number: f64) -> String {
    let size = number.abs();
    if size != 0.0 && !(1e-3..1e7).contains(&size) {
        return format!("{number:.5e}");
    }
    let decimals = 5usize.saturating_sub(size.max(1.0).log10() as usize);
    let text = format!("{number:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn numbers_are_short() {
        assert_eq!(
            [0.0, 1.5, -123.456789, 1e-9, 1_000_000.0].map(short),
            ["0", "1.5", "-123.457", "1.00000e-9", "1000000"]
        );
    }
}
