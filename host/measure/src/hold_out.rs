//! Which rows no fit may see.

use super::error::SelectError;
use super::select::Selection;
use super::table::Table;
use super::{Finding, FindingKind};

/// Values of a column up to which each of them is a group.
const FEW: usize = 24;
/// Blocks of time that are held out where nothing is said: every fourth of these.
const BLOCKS: usize = 16;

/// Which rows no fit may see.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum HoldOut {
    /// Where the column `held_out` is not 0. Without that column: of channels every fourth block of rows, of poses every
    /// word in turn.
    #[default]
    Own,
    /// Where this holds.
    Where(Selection),
    /// The last share of the rows.
    Last(f64),
    /// Each value of this column in turn.
    Each(String),
    /// Where this column is not 0.
    Column(String),
}

/// The rows that a [`HoldOut`] means in one table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeldOut {
    /// Whether each row is held out.
    pub rows: Vec<bool>,
    /// How they were chosen, in words.
    pub description: String,
    /// The number of each row's value in the column that chose, where that has few.
    pub keys: Option<Vec<usize>>,
}

impl HoldOut {
    /// The rows of a table that are held out; of [`Each`](Self::Each) those of the value `each`.
    ///
    /// # Errors
    ///
    /// The table has no column that is named, or a cell of a column of flags is neither empty nor a number.
    pub fn rows(&self, table: &Table, each: Option<&str>) -> Result<HeldOut, SelectError> {
        let n = table.lines.len();
        let held_out = |rows: Vec<bool>, description: String| HeldOut { rows, description, keys: None };
        Ok(match self {
            Self::Own if table.quantity("held_out").is_some() => {
                held_out(table.flags("held_out")?, "the column held_out".into())
            }
            Self::Own => {
                let block = |row: usize| (row * BLOCKS / n.max(1)) % 4 == 3;
                held_out((0..n).map(block).collect(), "every fourth of 16 blocks of rows".into())
            }
            Self::Column(name) => held_out(table.flags(name)?, format!("the column {name}")),
            Self::Last(share) => {
                let first = ((1.0 - share) * n as f64).round() as usize;
                held_out((0..n).map(|row| row >= first).collect(), format!("the last {:.0} %", 100.0 * share))
            }
            Self::Where(selection) => {
                let keys = selection.columns().next().and_then(|name| keys(table, name));
                HeldOut { keys, ..held_out(selection.rows(table)?, "the rows that --hold-out names".into()) }
            }
            Self::Each(name) => {
                let words = &table.chosen(name)?.words;
                let rows = words.iter().map(|word| Some(word.as_str()) == each).collect();
                HeldOut { keys: keys(table, name), ..held_out(rows, format!("each {name} in turn")) }
            }
        })
    }
}

impl HeldOut {
    /// That no row is held out, where `how` was to choose some.
    pub fn nothing(&self, how: &HoldOut) -> Option<Finding> {
        let asked = matches!(how, HoldOut::Where(_) | HoldOut::Last(_) | HoldOut::Column(_));
        let text = format!("no row is held out by {}", self.description);
        (asked && !self.rows.contains(&true)).then(|| Finding::note(FindingKind::NothingHeldOut, text))
    }
}

/// Whether these numbers of values, counted from 0, are of so few that each of them is a group.
pub fn are_few(numbers: &[usize]) -> bool {
    numbers.iter().all(|number| *number < FEW)
}

/// The number of each row's value in a column that has few.
fn keys(table: &Table, name: &str) -> Option<Vec<usize>> {
    table.numbered(name).ok().filter(|numbers| are_few(numbers))
}
