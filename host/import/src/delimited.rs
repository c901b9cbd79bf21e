//! Tables as text: the separator, the decimal sign, the header and comment lines are found by looking at the file.
//!
//! | what | how it is found |
//! | --- | --- |
//! | separator | tab, semicolon, comma or spaces: with which the lines have as many cells as each other, and the most numbers |
//! | decimal comma | where the separator is none, and numbers have a comma and none a point |
//! | comments | lines that begin with `#`, `%` or `//`; the last one before the table is its header where it has as many names |
//! | header | a first row with a cell that is not a number; a second row of units is read as such |
//! | missing values | empty cells, `nan`, `NA`, `N/A`, `null`, `none`, `-` |
//!
//! Byte order marks, `\r\n`, quotes, a separator after the last cell, and Latin-1 are read as well.

use crate::error::{Fault, Where};
use crate::recording::{Column, Part, is_missing};
use crate::time_stamp;
use crate::unit::{self, Unit};
use darm_robot::csv_table::place_of;
use darm_robot::files::Limits;

/// What a user says about a text file; what is `None` is found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dialect {
    /// Separator of cells: tab, semicolon, comma, or a space for any number of blanks.
    pub delimiter: Option<char>,
    /// Whether the first row has names.
    pub has_header: Option<bool>,
}

/// Lines that are looked at to find the separator.
const LINES_TO_LOOK_AT: usize = 64;
const DELIMITERS: [char; 4] = ['\t', ';', ',', ' '];

/// A row of cells and its line.
struct Row {
    line: usize,
    cells: Vec<String>,
}

/// The table of a text file, and what its owner should know.
pub(crate) fn read(bytes: &[u8], dialect: Dialect, limits: &Limits) -> Result<(Part, Vec<String>), Fault> {
    let mut notes = Vec::new();
    let text = decoded(bytes, &mut notes)?;
    let (body, comment) = without_comments(&text);
    let delimiter = dialect.delimiter.unwrap_or_else(|| delimiter(&body));
    let ends_early = !text.ends_with(['\n', '\r']);
    let mut rows = rows(&body, delimiter, ends_early, limits, &mut notes)?;
    if rows.is_empty() {
        return Err(Fault::of_file("no rows: the file is empty, or holds comments alone"));
    }
    let has_decimal_comma = delimiter != ',' && has_decimal_comma(&rows);
    if has_decimal_comma {
        rows.iter_mut().flat_map(|row| &mut row.cells).filter(|cell| is_comma_number(cell)).for_each(|cell| {
            *cell = cell.replace(',', ".");
        });
    }
    let header = header(&mut rows, dialect.has_header, comment, delimiter);
    if rows.is_empty() {
        return Err(Fault::of_file("there is a header and no rows"));
    }
    let columns = header.into_iter().enumerate().map(|(k, (name, unit))| column(name, unit, k, &rows)).collect();
    let lines = rows.iter().map(|row| row.line).collect();
    let kind = format!("table, {}{}", described(delimiter), if has_decimal_comma { ", decimal comma" } else { "" });
    Ok((Part { kind, shape: vec![rows.len()], columns, lines, ..Part::default() }, notes))
}

fn described(delimiter: char) -> &'static str {
    match delimiter {
        '\t' => "separated by tabs",
        ';' => "separated by semicolons",
        ' ' => "separated by spaces",
        _ => "separated by commas",
    }
}

fn decoded(bytes: &[u8], notes: &mut Vec<String>) -> Result<String, Fault> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(Fault::of_file("the text is in UTF-16: save it in UTF-8"));
    }
    if bytes.contains(&0) {
        return Err(Fault::of_file(
            "no text and no format that is known: CSV, .npy, .npz, .mat, MCAP and ROS 2 bags are read",
        ));
    }
    let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(text.into()),
        Err(_) => {
            notes.push("the text is not in UTF-8 and is read as Latin-1".into());
            Ok(bytes.iter().map(|byte| char::from(*byte)).collect())
        }
    }
}

/// The text with comment lines made empty, and the last one before the table.
fn without_comments(text: &str) -> (String, Option<&str>) {
    let (mut body, mut comment) = (String::with_capacity(text.len()), None);
    let mut is_before = true;
    // A file of an old Mac has lines that end in a carriage return alone.
    let end = if text.contains('\n') { '\n' } else { '\r' };
    for line in text.split_inclusive(end) {
        let start = line.trim_start();
        let mark = ["#", "%", "//"].into_iter().find(|mark| start.starts_with(mark));
        match mark {
            Some(mark) => {
                comment = if is_before { Some(start.trim_start_matches(mark).trim()) } else { comment };
                body.push('\n');
            }
            None => {
                is_before &= start.is_empty();
                body.push_str(line);
            }
        }
    }
    (body, comment)
}

/// Cells of a line, without quotes in view.
fn cells(line: &str, delimiter: char) -> Vec<String> {
    if delimiter == ' ' && !line.contains('"') {
        return line.split_whitespace().map(str::to_owned).collect();
    }
    let mut reader = reader(line, delimiter);
    let record = reader.records().next().and_then(Result::ok).unwrap_or_default();
    record.iter().map(str::to_owned).filter(|cell| delimiter != ' ' || !cell.is_empty()).collect()
}

fn reader(text: &str, delimiter: char) -> csv::Reader<&[u8]> {
    let mut builder = csv::ReaderBuilder::new();
    builder.has_headers(false).flexible(true).trim(csv::Trim::All).delimiter(delimiter as u8);
    builder.from_reader(text.as_bytes())
}

/// The separator with which the first lines have as many cells as each other, and the most numbers.
fn delimiter(body: &str) -> char {
    let lines: Vec<&str> =
        body.split(['\n', '\r']).filter(|line| !line.trim().is_empty()).take(LINES_TO_LOOK_AT).collect();
    let score = |delimiter: &char| score(&lines, *delimiter);
    // Of equal ones the first: `max_by_key` gives the last.
    let best = DELIMITERS.into_iter().rev().max_by_key(score).filter(|best| score(best).0 > 0);
    best.unwrap_or(',')
}

/// Thousandths of the lines that have as many cells as each other, and of the cells that are numbers.
fn score(lines: &[&str], delimiter: char) -> (usize, usize) {
    let rows: Vec<Vec<String>> = lines.iter().map(|line| cells(line, delimiter)).collect();
    let width = rows.last().map_or(0, Vec::len).max(rows.get(1).map_or(0, Vec::len));
    if width < 2 {
        return (0, 0);
    }
    let alike = rows.iter().filter(|row| row.len() == width).count();
    let all: Vec<&String> = rows.iter().flatten().collect();
    let is_number = |cell: &&&String| is_missing(cell) || number(cell).is_some() || is_comma_number(cell);
    let numbers = all.iter().filter(is_number).count();
    (1000 * alike / lines.len(), 1000 * numbers / all.len().max(1))
}

/// A number as text; `inf` and `nan` are numbers, digits with other signs between are not.
fn number(cell: &str) -> Option<f64> {
    cell.trim().parse().ok()
}

/// Whether a cell is a number with a decimal comma.
fn is_comma_number(cell: &str) -> bool {
    let Some((before, behind)) = cell.split_once(',') else { return false };
    let digits = before.trim_start_matches(['+', '-']);
    !digits.is_empty()
        && digits.bytes().all(|byte| byte.is_ascii_digit())
        && behind.starts_with(|c: char| c.is_ascii_digit())
        && number(&format!("{before}.{behind}")).is_some()
}

fn has_decimal_comma(rows: &[Row]) -> bool {
    let cells = || rows.iter().flat_map(|row| &row.cells);
    cells().any(|cell| is_comma_number(cell)) && !cells().any(|cell| cell.contains('.') && number(cell).is_some())
}

/// The rows with as many cells each. A last row that is short and has no end was cut off and is left out.
fn rows(
    body: &str,
    delimiter: char,
    ends_early: bool,
    limits: &Limits,
    notes: &mut Vec<String>,
) -> Result<Vec<Row>, Fault> {
    let mut rows = Vec::new();
    let mut n_cells = 0;
    // Rows need not be as long as each other yet.
    let mut add = |row: Row| {
        n_cells += row.cells.len().max(1);
        rows.push(row);
        if rows[rows.len() - 1].cells.len() > limits.columns || n_cells > limits.cells {
            return Err(Fault::of_file(limits.too_many_cells()));
        }
        Ok(())
    };
    if delimiter == ' ' {
        let lines = (1..).zip(body.lines()).filter(|(_, line)| !line.trim().is_empty());
        for (line, text) in lines {
            add(Row { line, cells: cells(text, delimiter) })?;
        }
    } else {
        for record in reader(body, delimiter).records() {
            let record = record.map_err(|error| Fault::of_file(format!("no table: {error}")))?;
            let line = place_of(body.as_bytes(), record.position(), 0).map_or(0, |place| place.line);
            add(Row { line, cells: record.iter().map(str::to_owned).collect() })?;
        }
    }
    let Some(width) = rows.first().map(|row: &Row| row.cells.len()) else { return Ok(rows) };
    // A separator after the last cell of each row.
    let is_open = |row: &Row| row.cells.len() == width + 1 && row.cells[width].is_empty();
    rows.iter_mut().filter(|row| is_open(row)).for_each(|row| row.cells.truncate(width));
    if ends_early && rows.len() > 1 && rows.last().is_some_and(|row| row.cells.len() < width) {
        rows.pop();
        notes.push("the file ends in the middle of a row, which is left out".into());
    }
    match rows.iter().find(|row| row.cells.len() != width) {
        Some(row) => {
            let text = format!(
                "{} cells, the first row has {width} ({}); repair the row, or name the separator with --delimiter",
                row.cells.len(),
                described(delimiter)
            );
            Err(Fault::at(Where::Line(row.line), text))
        }
        None => Ok(rows),
    }
}

/// Names and units of the columns, taken from the first rows or from a comment.
fn header(
    rows: &mut Vec<Row>,
    has_header: Option<bool>,
    comment: Option<&str>,
    delimiter: char,
) -> Vec<(String, Option<String>)> {
    let has_text = |row: &Row| {
        row.cells.iter().any(|cell| number(cell).is_none() && !is_missing(cell) && time_stamp::parse(cell).is_none())
    };
    let width = rows[0].cells.len();
    if has_header.unwrap_or_else(|| has_text(&rows[0])) {
        let names = rows.remove(0).cells;
        let is_units = |row: &Row| {
            let given: Vec<&String> = row.cells.iter().filter(|cell| !is_missing(cell)).collect();
            let unit = |cell: &String| cell.trim_matches(['[', ']', '(', ')']).to_owned();
            !given.is_empty() && given.iter().all(|cell| Unit::named(&unit(cell)).is_some())
        };
        let units = (rows.len() > 1 && is_units(&rows[0])).then(|| rows.remove(0).cells);
        let unit = |k: usize| units.as_ref().map(|units| units[k].trim_matches(['[', ']', '(', ')']).to_owned());
        let named = names.into_iter().enumerate().map(|(k, name)| if name.is_empty() { numbered(k) } else { name });
        return named.enumerate().map(|(k, name)| (name, unit(k).filter(|unit| !unit.is_empty()))).collect();
    }
    let from_comment = comment.filter(|_| has_header.is_none()).map(|comment| {
        let by = DELIMITERS.into_iter().chain([delimiter]).map(|delimiter| cells(comment, delimiter));
        by.filter(|names| names.len() == width).find(|names| names.iter().all(|name| number(name).is_none()))
    });
    match from_comment.flatten() {
        Some(names) => names.into_iter().map(|name| (name, None)).collect(),
        None => (0..width).map(|k| (numbered(k), None)).collect(),
    }
}

/// The name of a column without one: its number from 1.
fn numbered(k: usize) -> String {
    (k + 1).to_string()
}

fn column(name: String, unit: Option<String>, k: usize, rows: &[Row]) -> Column {
    let texts: Vec<String> = rows.iter().map(|row| row.cells[k].clone()).collect();
    let numbers: Vec<f64> = texts.iter().map(|text| number(text).unwrap_or(f64::NAN)).collect();
    let unit = unit.or_else(|| unit::text(&name).map(str::to_owned));
    let column = Column { name, unit, numbers, texts };
    // A column of calendar time is one of seconds since 1970.
    let stamps: Option<Vec<f64>> = column.texts.iter().map(|text| time_stamp::parse(text)).collect();
    match stamps {
        Some(numbers) => Column { numbers, texts: Vec::new(), unit: Some("s".into()), ..column },
        None => column,
    }
}
