//! Conditions of a measurement that are not read, because the unit of their column is missing or of another quantity.

use serde::Serialize;

use super::table::Table;

/// Conditions, the unit in which they are read, and how the names of columns in them end, the usual one first.
const CONDITIONS: [(&str, &str, &[&str]); 3] =
    [("supply", "Pa", &["bar", "kpa", "pa"]), ("temperature", "°C", &["c", "k"]), ("load", "kg", &["kg", "g"])];

/// A condition that is not read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct UnreadCondition {
    /// Name of the column in the file.
    pub column: String,
    /// What it would hold.
    pub quantity: &'static str,
    /// What is wrong with its unit.
    pub fault: &'static str,
    /// How names of columns end that are read, the usual unit first.
    pub units: &'static [&'static str],
}

/// The conditions that a table of visits has and that are not read.
pub fn unread(table: &Table) -> Vec<UnreadCondition> {
    let one = |&(quantity, read, units): &(&'static str, &str, &'static [&'static str])| {
        let column = table.quantity(quantity).filter(|column| column.unit != read)?;
        let fault = if column.unit.is_empty() { "unit missing" } else { "unit of another quantity" };
        Some(UnreadCondition { column: column.name.clone(), quantity, fault, units })
    };
    CONDITIONS.iter().filter_map(one).collect()
}
