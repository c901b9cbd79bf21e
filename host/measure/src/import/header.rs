//! The header of a text table: names and units of its columns, in one row or in several.

use std::collections::{HashMap, HashSet};

use crate::import::recording::{Row, is_missing, number};
use crate::import::time_stamp;
use crate::unit::{self, Unit};

/// Most rows that a header has.
const MAX_ROWS: usize = 8;
/// Rows that show whether a column has numbers.
const ROWS_TO_LOOK_AT: usize = 256;

/// Names and units of the columns, and the rows that have them.
pub(crate) struct Names {
    pub(crate) names: Vec<(String, Option<String>)>,
    pub(crate) n_rows: usize,
}

/// Finds the header; `comments` are ways to read the comment before the table.
///
/// A row is of the header where it has a text in a column whose other cells are numbers. Where no column has numbers, the
/// first row is one.
pub(crate) fn names(rows: &[Row], has_header: Option<bool>, comments: Vec<Vec<String>>) -> Names {
    let width = rows[0].cells.len();
    let is_value = |cell: &str| number(cell).is_some() || time_stamp::is_stamp(cell);
    let numeric: Vec<bool> = (0..width)
        .map(|k| {
            // Without the rows that may be names; of a short table all of them but the first.
            let behind = if rows.len() > 2 * MAX_ROWS { MAX_ROWS } else { 1.min(rows.len() - 1) };
            let cells = rows[behind..]
                .iter()
                .take(ROWS_TO_LOOK_AT)
                .map(|row| row.cells[k].as_str())
                .filter(|cell| !is_missing(cell));
            let (values, n) = cells.fold((0, 0), |(values, n), cell| (values + usize::from(is_value(cell)), n + 1));
            2 * values > n
        })
        .collect();
    let has_text_for_number =
        |row: &Row| (0..width).any(|k| numeric[k] && !is_missing(&row.cells[k]) && !is_value(&row.cells[k]));
    let has_number = |row: &Row| (0..width).any(|k| numeric[k] && is_value(&row.cells[k]));
    let has_no_number = |row: &Row| row.cells.iter().all(|cell| !is_value(cell));
    let in_comment = comments.into_iter().find(|names| names.len() == width);
    // The first row may have numbers for names; a later one that has some is of the table, and a cell of it has no value.
    let is_header = |(k, row): &(usize, &Row)| has_text_for_number(row) && (*k == 0 || !has_number(row));
    let found = rows.iter().take(MAX_ROWS.min(rows.len() - 1)).enumerate().take_while(is_header).count();
    let n_rows = match (has_header, found) {
        (Some(false), _) => 0,
        (Some(true), found) => found.max(1),
        (None, 0) if in_comment.is_none() && !numeric.contains(&true) && has_no_number(&rows[0]) => 1,
        (None, found) => found,
    };
    if n_rows == 0 {
        let named = in_comment.filter(|_| has_header.is_none());
        let names = distinct(named.unwrap_or_else(|| (0..width).map(numbered).collect()));
        return Names { names: names.into_iter().map(|name| (name, None)).collect(), n_rows };
    }
    let (units, rows): (Vec<&Row>, Vec<&Row>) = rows[..n_rows]
        .iter()
        .enumerate()
        .map(|(k, row)| (k > 0 && is_units(row.cells.iter().map(String::as_str)), row))
        .fold((Vec::new(), Vec::new()), |(mut units, mut names), (is_units, row)| {
            if is_units {
                units.push(row)
            } else {
                names.push(row)
            }
            (units, names)
        });
    let unit =
        |k: usize| units.first().map(|row| plain_unit(&row.cells[k]).to_owned()).filter(|unit| !is_missing(unit));
    let names = distinct(joined(&rows, width));
    Names { names: names.into_iter().enumerate().map(|(k, name)| (name, unit(k))).collect(), n_rows }
}

/// Names that differ, so that each column can be mapped: equal ones get numbers.
fn distinct(names: Vec<String>) -> Vec<String> {
    let mut known: HashMap<&String, usize> = HashMap::new();
    names.iter().for_each(|name| *known.entry(name).or_default() += 1);
    let (mut counts, mut distinct) = (HashMap::new(), Vec::with_capacity(names.len()));
    for name in &names {
        let base = unit::split(name).0;
        let mut free = name.clone();
        while known[name] > 1 && known.contains_key(&free) {
            let count: &mut usize = counts.entry(name).or_default();
            *count += 1;
            free = format!("{base}_{count}{}", &name[base.len()..]);
        }
        distinct.push(free);
    }
    distinct
}

/// The name of a column without one: its number from 1.
fn numbered(k: usize) -> String {
    (k + 1).to_string()
}

fn plain_unit(cell: &str) -> &str {
    cell.trim_matches(['[', ']', '(', ')'])
}

/// Whether most cells with a value are units: some may be of no quantity that is converted, such as `%`.
pub(crate) fn is_units<'a>(cells: impl Iterator<Item = &'a str>) -> bool {
    let count = |(units, n), cell| (units + usize::from(Unit::named(plain_unit(cell)).is_some()), n + 1);
    let (units, n) = cells.filter(|cell| !is_missing(cell)).fold((0, 0), count);
    2 * units > n
}

/// Names of columns from several rows: that of the lowest row, after those of other rows where columns have the same one.
fn joined(rows: &[&Row], width: usize) -> Vec<String> {
    let cell = |row: usize, k: usize| rows[row].cells[k].as_str();
    let lowest = rows.len() - 1;
    let own = |k: usize| (0..rows.len()).rev().map(|row| cell(row, k)).find(|cell| !cell.is_empty());
    let mut names: Vec<String> = (0..width).map(|k| own(k).map_or_else(|| numbered(k), str::to_owned)).collect();
    // The row above says most; of the others the upper ones have names, the lower ones may have numbers of the same things.
    for row in (0..lowest).rev().take(1).chain(0..lowest.saturating_sub(1)) {
        let mut by_name: HashMap<&str, HashSet<&str>> = HashMap::new();
        for (k, name) in names.iter().enumerate() {
            by_name.entry(name).or_default().insert(cell(row, k));
        }
        // With a column all those get the word that are under the same one: `Rotation W` beside `Rotation X`.
        let words = by_name.into_values().filter(|words| words.len() > 1).flatten();
        let words: HashSet<&str> = words.filter(|word| !word.is_empty()).collect();
        let with_word = |(k, name): (usize, &String)| match cell(row, k) {
            word if words.contains(word) && word != name => format!("{word} {name}"),
            _ => name.clone(),
        };
        names = names.iter().enumerate().map(with_word).collect();
    }
    names
}
