//! Tables as text: the separator, the decimal sign, the header and comment lines are found by looking at the file.
//!
//! | what | how it is found |
//! | --- | --- |
//! | separator | tab, semicolon, bar, comma or spaces: with which the lines have as many cells as each other, and the most numbers |
//! | decimal comma | where the separator is none, and numbers have a comma and none a point |
//! | preamble | lines before the first that has as many cells as most lines, and lines after the last |
//! | comments | lines that begin with `#`, `%` or `//`; the last one before the table that has as many names is its header |
//! | header | first rows with a text where the rows below have numbers; one of them may have the units |
//! | missing values | empty cells, `nan`, `NA`, `N/A`, `null`, `none`, `?`, dashes |
//!
//! Byte order marks, `\r\n`, quotes, a separator after the last cell, UTF-16 and Latin-1 are read as well.

use crate::foreign;
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
const DELIMITERS: [char; 5] = ['\t', ';', '|', ',', ' '];

/// The table of a text file, and what its owner should know.
pub(crate) fn read(bytes: &[u8], dialect: Dialect, limits: &Limits) -> Result<(Part, Vec<String>), Fault> {
    let mut notes = Vec::new();
    let text = decoded(bytes, &mut notes)?;
    let text = without_lines(&text, dialect.skip_lines.unwrap_or(0));
    let (body, comments) = without_comments(&text);
    let delimiter = dialect.delimiter.unwrap_or_else(|| delimiter(&body));
    let ends_early = !text.is_empty() && !text.ends_with(['\n', '\r']);
    let mut rows = rows(&body, delimiter, limits)?;
    if rows.is_empty() {
        return Err(Fault::of_file("no rows: the file is empty, or holds comments alone"));
    }
    let preamble = preamble(&mut rows, delimiter, dialect.skip_lines.is_none(), ends_early, &mut notes)?;
    even(&mut rows, delimiter, ends_early, &mut notes)?;
    let has_decimal_comma = has_decimal_comma(&rows, delimiter);
    if has_decimal_comma {
        without_thousands(&mut rows, &mut notes);
        rows.iter_mut().flat_map(|row| &mut row.cells).filter(|cell| is_comma_number(cell)).for_each(|cell| {
            *cell = cell.replace(',', ".");
        });
    }
    // With the separator of the table before others, and the last one first.
    let by = [delimiter].into_iter().chain(DELIMITERS);
    let in_comments = by.flat_map(|by| comments.iter().rev().map(move |comment| cells(comment, by)));
    let in_comments = in_comments.filter(|names| names.iter().all(|name| number(name).is_none())).collect();
    let Names { names, n_rows } = names(&rows, dialect.has_header, in_comments);
    rows.drain(..n_rows);
    if rows.is_empty() {
        return Err(Fault::of_file("there is a header and no rows"));
    }
    with_dates(&mut rows, &names, dialect, &mut notes);
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
        let Column { name, numbers, .. } = &part.columns[k];
        // Integers may be of any unit.
        let are_complete = numbers.len() > 2 && numbers.iter().all(|number| number.fract() == 0.0 || number.is_nan());
        if epochs_ns[k].is_none() && proposal::is_guessed(&part.columns[k]) && (unit.name != "s" || are_complete) {
            let other = if unit.name == "s" { "ms" } else { "s" };
            notes.push(format!(
                "column {name}: its unit is not in the file; by the size of its numbers they are taken as {0}; if they are \
                 not, give it with --unit '{name}={other}'",
                unit.name
            ));
        }
        part.epoch_ns = epochs_ns[k].or_else(|| clock::from_first(&mut part, k, unit, &mut notes));
        notes.extend(proposal::time_column(&part).and_then(|(k, _)| steps_back(&part.columns[k])));
    } else if let Some(column) = part.columns.iter().find(|column| proposal::is_named_time(column)) {
        let cell = column.first_text().map_or("", |(_, text)| text);
        notes.push(format!(
            "column {}: `{cell}` is not a number or a date that is read; write times in s, or as 2024-05-31 12:30:00.25",
            column.name
        ));
    }
    Ok((part, notes))
}

/// That time runs back or does not increase.
fn steps_back(column: &Column) -> Option<String> {
    let count = |of: fn(f64) -> bool| column.numbers.windows(2).filter(|pair| of(pair[1] - pair[0])).count();
    let (back, same) = (count(|step| step < 0.0), count(|step| step == 0.0));
    let texts = [(back, "runs back"), (same, "is that of the row before")];
    let said: Vec<String> =
        texts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{what} in {n} rows")).collect();
    (!said.is_empty()).then(|| format!("column {}: time {}", column.name, said.join(", and ")))
}

/// Puts the dates of one column before the times of day of another.
fn with_dates(rows: &mut [Row], names: &[(String, Option<String>)], dialect: Dialect, notes: &mut Vec<String>) {
    let all = |k: usize, is_meant: &dyn Fn(&str) -> bool| {
        let mut cells = rows.iter().map(|row| row.cells[k].as_str()).filter(|cell| !is_missing(cell)).peekable();
        cells.peek().is_some() && cells.all(is_meant)
    };
    let is_date = |cell: &str| {
        [Dates::DayFirst, Dates::MonthFirst].iter().any(|order| time_stamp::date_of(cell, *order).is_some())
    };
    let Some(dates) = (0..names.len()).find(|k| all(*k, &is_date)) else { return };
    let is_of_day = |k: &usize| {
        let cells = rows.iter().map(|row| Some(row.cells[*k].as_str()).filter(|cell| !is_missing(cell)));
        *k != dates && matches!(time_stamp::column(cells, dialect.dates), Some(Ok(stamps)) if !stamps.has_date)
    };
    let Some(times) = (0..names.len()).find(is_of_day) else { return };
    for row in rows.iter_mut().filter(|row| !is_missing(&row.cells[times]) && !is_missing(&row.cells[dates])) {
        row.cells[times] = format!("{} {}", row.cells[dates], row.cells[times]);
    }
    notes.push(format!("{} and {} are one time", names[dates].0, names[times].0));
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
        '|' => "separated by bars",
        _ => "separated by commas",
    }
}

fn decoded(bytes: &[u8], notes: &mut Vec<String>) -> Result<String, Fault> {
    if let Some(text) = foreign::utf_16(bytes) {
        return Ok(text);
    }
    let end = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    if end < bytes.len() && !bytes[..end].contains(&0) {
        notes.push(format!("the file ends in {} zero bytes, as after a loss of power", bytes.len() - end));
    }
    let bytes = &bytes[..end];
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

/// The text with comment lines made empty, and those before the table.
fn without_comments(text: &str) -> (String, Vec<&str>) {
    let (mut body, mut comments) = (String::with_capacity(text.len()), Vec::new());
    let mut is_before = true;
    // A file of an old Mac has lines that end in a carriage return alone.
    let end = if text.contains('\n') { '\n' } else { '\r' };
    for line in text.split_inclusive(end) {
        let start = line.trim_start();
        let mark = ["#", "%", "//"].into_iter().find(|mark| start.starts_with(mark));
        match mark {
            Some(mark) => {
                comments.extend(is_before.then(|| start.trim_start_matches(mark).trim()));
                body.push('\n');
            }
            None => {
                is_before &= start.is_empty();
                body.push_str(line);
            }
        }
    }
    (body, comments)
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

/// Whether more numbers have a comma than a point: a text may have some of either. Between commas the cells are in quotes, and all with
/// three digits behind the comma may have it between thousands.
fn has_decimal_comma(rows: &[Row], delimiter: char) -> bool {
    let cells = || rows.iter().flat_map(|row| &row.cells);
    let is_decimal = |cell: &String| cell.split_once(',').is_some_and(|(_, digits)| digits.len() != 3);
    if delimiter == ',' && !cells().any(|cell| is_comma_number(cell) && is_decimal(cell)) {
        return false;
    }
    let with_comma = cells().filter(|cell| is_comma_number(cell)).count();
    with_comma > cells().filter(|cell| cell.contains('.') && number(cell).is_some()).count()
}

/// Takes out the points that separate thousands beside decimal commas: `1.234,5`, and `1.234` where all numbers with a point in its column are grouped so
/// by three digits.
fn without_thousands(rows: &mut [Row], notes: &mut Vec<String>) {
    let is_grouped = |cell: &str| {
        let mut groups = cell.split(',').next().unwrap_or_default().trim_start_matches(['+', '-']).split('.');
        let digits = |group: &str| group.bytes().all(|byte| byte.is_ascii_digit());
        let is_first = |group: &str| (1..=3).contains(&group.len()) && !group.starts_with('0') && digits(group);
        let is_other = |group: &str| group.len() == 3 && digits(group);
        cell.contains('.') && groups.next().is_some_and(is_first) && groups.all(is_other)
    };
    for k in 0..rows.first().map_or(0, |row| row.cells.len()) {
        let mut with_point = rows
            .iter()
            .map(|row| &row.cells[k])
            .filter(|cell| cell.contains('.') && (number(cell).is_some() || is_grouped(cell)));
        if let Some(first) = with_point.next().cloned()
            && is_grouped(&first)
            && with_point.all(|cell| is_grouped(cell))
        {
            rows.iter_mut().map(|row| &mut row.cells[k]).filter(|cell| is_grouped(cell)).for_each(|cell| {
                *cell = cell.replace('.', "");
            });
            notes.push(format!("column {}: points separate thousands, `{first}`", k + 1));
        }
    }
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
    } else if !limits.has_room_for_lines(body.as_bytes(), delimiter as u8) {
        return Err(Fault::of_file(limits.too_many_cells()));
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

/// Takes the lines off that are before the table: those before the first one that has as many cells as most lines; and those
/// after the last one, which are no rows either. A line with one cell more or less is a damaged row.
fn preamble(
    rows: &mut Vec<Row>,
    delimiter: char,
    is_sought: bool,
    ends_early: bool,
    notes: &mut Vec<String>,
) -> Result<Vec<Row>, Fault> {
    let mut counts = std::collections::BTreeMap::new();
    rows.iter().for_each(|row| *counts.entry(row.cells.len()).or_insert(0) += 1);
    let width = counts.iter().max_by_key(|(width, n)| (**n, **width)).map_or(0, |(width, _)| *width);
    let is_other = |row: &Row| row.cells.len() == 1 || row.cells.len().abs_diff(width) > 1;
    let n = rows.iter().position(|row| row.cells.len() == width).unwrap_or(0);
    let end = rows.iter().rposition(|row| row.cells.len() == width).map_or(0, |last| last + 1);
    let is_taken = |rows: &[Row]| width > 1 && !rows.is_empty() && rows.iter().all(is_other);
    // A last row that was cut off is reported as that.
    if is_taken(&rows[end..]) && (!ends_early || rows.len() - end > 1) {
        notes.push(not_read(&rows[end..], "after", delimiter));
        rows.truncate(end);
    }
    if !is_sought || !is_taken(&rows[..n]) {
        return Ok(Vec::new());
    }
    // Each number is two cells, or the last name is the first of several: the columns of the names are not known.
    let are_names = |row: &&Row| {
        let is_name = |cell: &String| number(cell).is_none() && !cell.is_empty();
        (2..width).contains(&row.cells.len()) && 2 * row.cells.len() >= width && row.cells.iter().all(is_name)
    };
    let has_names = rows[n].cells.iter().all(|cell| number(cell).is_none());
    if let Some(above) = rows[..n].iter().rfind(are_names).filter(|_| delimiter == ',' && !has_names) {
        let text = format!(
            "{} names above rows of {width} cells: if its numbers have decimal commas, save it with semicolons between the \
             cells; if the line is not of the table, leave it out with --skip-lines {}",
            above.cells.len(),
            above.line
        );
        return Err(Fault::at(Where::Line(above.line), text));
    }
    notes.push(not_read(&rows[..n], "before", delimiter));
    Ok(rows.drain(..n).collect())
}

/// That lines are not of the table.
fn not_read(rows: &[Row], place: &str, delimiter: char) -> String {
    let first = rows[0].cells.join(&delimiter.to_string());
    let shown: String = first.chars().take(60).collect();
    let dots = if shown.len() < first.len() { "…" } else { "" };
    match rows.len() {
        1 => format!("the line {place} the table, `{shown}{dots}`, is not read"),
        n => format!("{n} lines {place} the table, from `{shown}{dots}` on, are not read"),
    }
}

/// Lines that a table may have before it without a line that says so.
const MAX_LINES_BEFORE: usize = 8;

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
            let skip = match rows.iter().position(|other| other.line == row.line) {
                Some(at) if at < MAX_LINES_BEFORE => {
                    format!(", or leave out the lines before the table with --skip-lines {}", row.line - 1)
                }
                _ => String::new(),
            };
            let text = format!(
                "{} cells, the first row has {width} ({}); repair the row, name the separator with --delimiter{skip}",
                row.cells.len(),
                described(delimiter),
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

/// Cells without the unit that each of them has after its number, `0.25 sec`, and the unit.
fn without_units(texts: Vec<String>) -> (Vec<String>, Option<String>) {
    let parted = |text: &String| {
        let (value, unit) = text.rsplit_once(' ')?;
        number(value).and(Unit::named(unit)).map(|_| (value.to_owned(), unit.to_owned()))
    };
    let Some((_, unit)) = texts.iter().find(|text| !is_missing(text)).and_then(parted) else { return (texts, None) };
    let own = |text: &String| {
        if is_missing(text) { Some(text.clone()) } else { parted(text).filter(|own| own.1 == unit).map(|own| own.0) }
    };
    let numbers: Option<Vec<String>> = texts.iter().map(own).collect();
    numbers.map_or((texts, None), |numbers| (numbers, Some(unit)))
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
    let (texts, of_cells) = without_units(rows.iter().map(|row| row.cells[k].clone()).collect());
    let unit = unit.or(of_cells);
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
