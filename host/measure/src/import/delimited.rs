//! Tables as text: the separator, the decimal sign, the header and comment lines are found by looking at the file.
//!
//! | what | how it is found |
//! | --- | --- |
//! | separator | tab, semicolon, comma or spaces: with which the lines have as many cells as each other, and the most numbers |
//! | decimal comma | where the separator is none, and numbers have a comma and none a point |
//! | preamble | lines before the first that has as many cells as most lines |
//! | comments | lines that begin with `#`, `%` or `//`; the last one before the table is its header where it has as many names |
//! | header | first rows with a text where the rows below have numbers; one of them may have the units |
//! | missing values | empty cells, `nan`, `NA`, `N/A`, `null`, `none`, `?`, dashes |
//!
//! Byte order marks, `\r\n`, quotes, a separator after the last cell, and Latin-1 are read as well.

use crate::import::clock;
use crate::import::error::{Fault, Where};
use crate::import::header::{Names, names};
use crate::import::proposal;
use crate::import::recording::{Column, Part, Row, is_missing, number};
use crate::import::time_stamp::{self, Dates};
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
    /// Lines before the table, which are not read.
    pub skip_lines: Option<usize>,
    /// Which of day and month is first in dates.
    pub dates: Option<Dates>,
}

/// Lines that are looked at to find the separator, and bytes: a line may be the entire file.
const LINES_TO_LOOK_AT: usize = 64;
const BYTES_TO_LOOK_AT: usize = 1 << 20;
const DELIMITERS: [char; 4] = ['\t', ';', ',', ' '];

/// The table of a text file, and what its owner should know.
pub(crate) fn read(bytes: &[u8], dialect: Dialect, limits: &Limits) -> Result<(Part, Vec<String>), Fault> {
    let mut notes = Vec::new();
    let text = decoded(bytes, &mut notes)?;
    let text = without_lines(&text, dialect.skip_lines.unwrap_or(0));
    let (body, comment) = without_comments(&text);
    let delimiter = dialect.delimiter.unwrap_or_else(|| delimiter(&body));
    let ends_early = !text.ends_with(['\n', '\r']);
    let mut rows = rows(&body, delimiter, limits)?;
    if rows.is_empty() {
        return Err(Fault::of_file("no rows: the file is empty, or holds comments alone"));
    }
    let preamble = preamble(&mut rows, delimiter, dialect.skip_lines.is_none(), &mut notes);
    even(&mut rows, delimiter, ends_early, &mut notes)?;
    let has_decimal_comma = delimiter != ',' && has_decimal_comma(&rows);
    if has_decimal_comma {
        rows.iter_mut().flat_map(|row| &mut row.cells).filter(|cell| is_comma_number(cell)).for_each(|cell| {
            *cell = cell.replace(',', ".");
        });
    }
    let comment = comment.map(|comment| {
        let by = DELIMITERS.into_iter().chain([delimiter]).map(|delimiter| cells(comment, delimiter));
        by.filter(|names| names.iter().all(|name| number(name).is_none())).collect()
    });
    let Names { names, n_rows } = names(&rows, dialect.has_header, comment.unwrap_or_default());
    rows.drain(..n_rows);
    if rows.is_empty() {
        return Err(Fault::of_file("there is a header and no rows"));
    }
    let mut columns = Vec::with_capacity(names.len());
    let mut epochs_ns = Vec::with_capacity(names.len());
    for (k, (name, unit)) in names.into_iter().enumerate() {
        let unit = unit.or_else(|| unit_of(&name, &preamble));
        let (column, epoch_ns) = column(name, unit, k, &rows, dialect, &mut notes);
        columns.push(column);
        epochs_ns.push(epoch_ns);
    }
    let lines = rows.iter().map(|row| row.line).collect();
    let kind = format!("table, {}{}", described(delimiter), if has_decimal_comma { ", decimal comma" } else { "" });
    let mut part = Part { kind, shape: vec![rows.len()], columns, lines, ..Part::default() };
    if let Some((k, unit)) = proposal::time_column(&part) {
        if proposal::is_guessed(&part.columns[k]) && unit.name != "s" {
            let name = &part.columns[k].name;
            notes.push(format!(
                "column {name}: its unit is not in the file; by the size of its numbers they are taken as {0}; if they are \
                 not, give it with --unit '{name}=s'",
                unit.name
            ));
        }
        part.epoch_ns = epochs_ns[k].or_else(|| clock::from_first(&mut part, k, unit, &mut notes));
    }
    Ok((part, notes))
}

/// The text with its first lines made empty, so that the others keep their numbers.
fn without_lines(text: &str, n: usize) -> String {
    let end = if text.contains('\n') { '\n' } else { '\r' };
    let skipped = text.split_inclusive(end).take(n).map(str::len).sum();
    "\n".repeat(n) + text.get(skipped..).unwrap_or_default()
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
    if bytes.contains(&0) {
        return Err(Fault::of_file(
            "no text and no format that is known: CSV, .npy, .npz, .mat, MCAP and ROS 2 bags are read; save it as one of these",
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
    let looked_at = body.floor_char_boundary(BYTES_TO_LOOK_AT);
    let lines: Vec<&str> =
        body[..looked_at].split(['\n', '\r']).filter(|line| !line.trim().is_empty()).take(LINES_TO_LOOK_AT).collect();
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

/// Whether a cell is a number with a decimal comma.
fn is_comma_number(cell: &str) -> bool {
    let Some((before, behind)) = cell.split_once(',') else { return false };
    let digits = before.trim_start_matches(['+', '-']);
    !digits.is_empty()
        && digits.bytes().all(|byte| byte.is_ascii_digit())
        && behind.starts_with(|c: char| c.is_ascii_digit())
        && number(&format!("{before}.{behind}")).is_some()
}

/// Whether more numbers have a comma than a point: a text may have some of either.
fn has_decimal_comma(rows: &[Row]) -> bool {
    let cells = || rows.iter().flat_map(|row| &row.cells);
    let with_comma = cells().filter(|cell| is_comma_number(cell)).count();
    with_comma > cells().filter(|cell| cell.contains('.') && number(cell).is_some()).count()
}

/// The rows of a text; they need not be as long as each other.
fn rows(body: &str, delimiter: char, limits: &Limits) -> Result<Vec<Row>, Fault> {
    let mut rows = Vec::new();
    let mut n_cells = 0;
    // Before the cells are taken apart: each takes 24 bytes and an allocation more than in the text.
    let mut has_room = |n: usize| {
        n_cells += n.max(1);
        let fits = n <= limits.columns && n_cells <= limits.cells;
        if fits { Ok(()) } else { Err(Fault::of_file(limits.too_many_cells())) }
    };
    if delimiter == ' ' {
        let lines = (1..).zip(body.lines()).filter(|(_, line)| !line.trim().is_empty());
        for (line, text) in lines {
            has_room(text.split_whitespace().count())?;
            rows.push(Row { line, cells: cells(text, delimiter) });
        }
    } else {
        for record in reader(body, delimiter).records() {
            let record = record.map_err(|error| Fault::of_file(format!("no table: {error}")))?;
            has_room(record.len())?;
            let line = place_of(body.as_bytes(), record.position(), 0).map_or(0, |place| place.line);
            rows.push(Row { line, cells: record.iter().map(str::to_owned).collect() });
        }
    }
    Ok(rows)
}

/// Takes the lines off that are before the table: those before the first one that has as many cells as most lines. A line with
/// one cell more or less is no preamble but a damaged row.
fn preamble(rows: &mut Vec<Row>, delimiter: char, is_sought: bool, notes: &mut Vec<String>) -> Vec<Row> {
    let mut counts = std::collections::BTreeMap::new();
    rows.iter().for_each(|row| *counts.entry(row.cells.len()).or_insert(0) += 1);
    let width = counts.iter().max_by_key(|(width, n)| (**n, **width)).map_or(0, |(width, _)| *width);
    let n = rows.iter().position(|row| row.cells.len() == width).unwrap_or(0);
    let is_other = |row: &Row| row.cells.len() == 1 || row.cells.len().abs_diff(width) > 1;
    if !is_sought || n == 0 || width < 2 || !rows[..n].iter().all(is_other) {
        return Vec::new();
    }
    let preamble: Vec<Row> = rows.drain(..n).collect();
    let first = preamble[0].cells.join(&delimiter.to_string());
    let shown: String = first.chars().take(60).collect();
    let dots = if shown.len() < first.len() { "…" } else { "" };
    notes.push(match n {
        1 => format!("the line before the table, `{shown}{dots}`, is not read"),
        _ => format!("{n} lines before the table, from `{shown}{dots}` on, are not read"),
    });
    preamble
}

/// Makes rows as long as each other. A last row that is short and has no end was cut off and is left out.
fn even(rows: &mut Vec<Row>, delimiter: char, ends_early: bool, notes: &mut Vec<String>) -> Result<(), Fault> {
    let Some(width) = rows.first().map(|row| row.cells.len()) else { return Ok(()) };
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
                "{} cells, the first row has {width} ({}); repair the row, name the separator with --delimiter, or leave out \
                 the lines before the table with --skip-lines {}",
                row.cells.len(),
                described(delimiter),
                row.line - 1
            );
            Err(Fault::at(Where::Line(row.line), text))
        }
        None => Ok(()),
    }
}

/// The unit that a preamble gives a column: Motive writes that of its positions as `Length Units,Millimeters`.
fn unit_of(name: &str, preamble: &[Row]) -> Option<String> {
    if !name.to_lowercase().contains("position") {
        return None;
    }
    let pairs = preamble.iter().flat_map(|row| row.cells.windows(2));
    let unit = pairs.filter(|pair| pair[0].eq_ignore_ascii_case("length units")).map(|pair| pair[1].clone()).next();
    unit.filter(|unit| Unit::named(unit).is_some())
}

/// A column, and what it counts from where its cells are calendar time, ns since 1970.
fn column(
    name: String,
    unit: Option<String>,
    k: usize,
    rows: &[Row],
    dialect: Dialect,
    notes: &mut Vec<String>,
) -> (Column, Option<i64>) {
    let texts: Vec<String> = rows.iter().map(|row| row.cells[k].clone()).collect();
    let numbers: Vec<f64> = texts.iter().map(|text| number(text).unwrap_or(f64::NAN)).collect();
    let unit = unit.or_else(|| unit::text(&name).map(str::to_owned));
    let column = Column { name, unit, numbers, texts };
    let cells = column.texts.iter().map(|text| Some(text.as_str()).filter(|text| !is_missing(text)));
    match time_stamp::column(cells, dialect.dates) {
        None => (column, None),
        Some(Err(asked)) => {
            notes.push(format!("column {}: {asked}", column.name));
            (column, None)
        }
        Some(Ok(stamps)) => {
            notes.extend(stamps.note.map(|note| format!("column {}: {note}", column.name)));
            let first = stamps.ns.iter().flatten().next().copied().unwrap_or(0);
            // From the first, so that nanoseconds are kept; a time of day from midnight.
            let zero = if stamps.has_date { first } else { 0 };
            let seconds = |ns: &Option<i64>| ns.map_or(f64::NAN, |ns| (ns - zero) as f64 / 1e9);
            let numbers = stamps.ns.iter().map(seconds).collect();
            let column = Column { numbers, texts: Vec::new(), unit: Some("s".into()), ..column };
            (column, stamps.is_since_1970.then_some(first))
        }
    }
}
