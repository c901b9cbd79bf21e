//! Tables of comma-separated values, and errors that name file, line and column of a cell.
//!
//! ```
//! use darm_robot::csv_table::CsvTable;
//! use std::path::Path;
//!
//! let table = CsvTable::of_text(Path::new("a.csv"), "x_m, y_m\n1, 2\n3, far\n").unwrap();
//! let y = table.column("y_m").unwrap();
//! let error = table.rows().map(|row| row.number(y)).find_map(Result::err).unwrap();
//! assert_eq!(error.to_string(), "a.csv:3:4: column y_m holds `far`, expected a number; correct the cell");
//! ```

use std::collections::HashSet;
use std::io::{Chain, Read as _};
use std::path::Path;
use std::str::FromStr;

use csv::{ErrorKind, StringRecord, Trim};

use crate::files::Files;
use crate::source::{Fault, FileError, Place, Source};

/// The largest number that a cell may hold: no square of smaller ones overflows.
pub const LARGEST: f64 = 1e12;

/// Why a file gives no table: with its place.
pub type CsvError = FileError<CsvFault>;

/// What is wrong with a table, and what to do about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CsvFault {
    /// A row is longer or shorter than the header.
    #[error("the row has {found} cells, the header has {expected}; correct the row")]
    Width {
        /// Cells of the row.
        found: u64,
        /// Cells of the header.
        expected: u64,
    },
    /// The text is not UTF-8.
    #[error("the text is not UTF-8; save the table as comma-separated text in UTF-8")]
    Encoding,
    /// A cell is not what its column holds.
    #[error("column {column} holds `{text}`, expected {expected}; correct the cell")]
    Cell {
        /// Name of the column.
        column: String,
        /// What is there.
        text: String,
        /// What should be.
        expected: String,
    },
    /// A row contradicts another one, or itself.
    #[error("{0}")]
    Row(String),
    /// Columns are missing; `missing` names them.
    #[error("no column {missing}; the file has {present}; add or rename a column")]
    NoColumn {
        /// What is missing.
        missing: String,
        /// Names of the columns of the file.
        present: String,
    },
    /// Two columns have one name.
    #[error("two columns are named {0}; remove one")]
    Doubled(String),
    /// The file has no header.
    #[error("the file is empty; give a table with a header")]
    NoHeader,
    /// The file has no rows.
    #[error("the file has no rows; add one per {what}")]
    Empty {
        /// What a row describes.
        what: &'static str,
    },
}

/// A table in memory.
pub struct CsvTable {
    source: Source,
    header: StringRecord,
    rows: Vec<StringRecord>,
}

/// A row of a table.
#[derive(Clone, Copy)]
pub struct CsvRow<'a> {
    table: &'a CsvTable,
    record: &'a StringRecord,
}

/// The header and rows of a table as `darm` writes them: commas between cells, spaces around them left out, comments behind `#`.
pub fn csv_reader(text: &[u8]) -> csv::Reader<Chain<&[u8], &[u8]>> {
    // Without a line end behind it the `csv` crate takes a comment in the last line for a row.
    let text = text.chain(&b"\n"[..]);
    csv::ReaderBuilder::new().trim(Trim::All).comment(Some(b'#')).from_reader(text)
}

impl CsvTable {
    /// Reads a table with a header; lines that begin with `#` are comments.
    ///
    /// # Errors
    ///
    /// The file cannot be read; or as [`of_text`](Self::of_text).
    pub fn read(path: &Path) -> Result<Self, CsvError> {
        let bytes = Files::on_disk().read(path).map_err(|error| FileError::unreadable(path, error))?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let at = error.utf8_error().valid_up_to();
            Source::of_text(path, &String::from_utf8_lossy(error.as_bytes())).wrong(at..at, CsvFault::Encoding)
        })?;
        Self::of_text(path, &text)
    }

    /// The same of a text; `path` only serves messages.
    ///
    /// # Errors
    ///
    /// There is no header, it names a column twice, or a row is longer or shorter than it.
    pub fn of_text(path: &Path, text: &str) -> Result<Self, CsvError> {
        let wrong = |error: csv::Error| csv_error(path, text.as_bytes(), &error);
        let mut reader = csv_reader(text.as_bytes());
        let header = reader.headers().map_err(wrong)?.clone();
        if header.is_empty() {
            return Err(Source::of_text(path, text).error(None, Fault::Content(Box::new(CsvFault::NoHeader))));
        }
        let named = |k: usize| header.get(k).filter(|name| !name.is_empty());
        let mut seen = HashSet::new();
        if let Some(doubled) = (0..header.len()).find(|&k| named(k).is_some_and(|name| !seen.insert(name))) {
            let fault = Fault::Content(CsvFault::Doubled(header[doubled].into()).into());
            return Err(FileError {
                path: path.into(),
                place: place_of(text.as_bytes(), header.position(), doubled),
                fault,
            });
        }
        let rows = reader.records().collect::<Result<Vec<_>, _>>().map_err(wrong)?;
        Ok(Self { source: Source::of_text(path, text), header, rows })
    }

    /// Names of the columns.
    pub fn header(&self) -> impl Iterator<Item = &str> {
        self.header.iter()
    }

    /// Number of the column with this name, from 0.
    pub fn column(&self, name: &str) -> Option<usize> {
        self.header().position(|column| column == name)
    }

    /// The rows, the first one first.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = CsvRow<'_>> {
        self.rows.iter().map(|record| CsvRow { table: self, record })
    }

    /// The error that a column is missing; `missing` names it.
    pub fn no_column(&self, missing: impl Into<String>) -> CsvError {
        let present = self.header().collect::<Vec<_>>().join(", ");
        self.wrong(CsvFault::NoColumn { missing: missing.into(), present })
    }

    /// The error that the complete table is wrong.
    pub fn wrong(&self, fault: CsvFault) -> CsvError {
        self.source.error(None, Fault::Content(Box::new(fault)))
    }
}

impl<'a> CsvRow<'a> {
    /// The line of the row.
    pub fn line(self) -> usize {
        let text = self.table.source.text().as_bytes();
        place_of(text, self.record.position(), 0).map_or(0, |place| place.line)
    }

    /// The cell of a column; empty where the table has no such column.
    pub fn cell(self, column: usize) -> &'a str {
        self.record.get(column).unwrap_or_default()
    }

    /// The cell of a column as a value; `expected` says what it has to be.
    ///
    /// # Errors
    ///
    /// [`CsvFault::Cell`]: the cell is not such a value.
    pub fn value<T: FromStr>(self, column: usize, expected: &str) -> Result<T, CsvError> {
        self.cell(column).parse().map_err(|_| self.wrong_cell(column, expected))
    }

    /// The number in a column.
    ///
    /// # Errors
    ///
    /// [`CsvFault::Cell`]: the cell is not a number, or beyond ±[`LARGEST`].
    pub fn number(self, column: usize) -> Result<f64, CsvError> {
        let number: f64 = self.value(column, "a number")?;
        if number.abs() <= LARGEST { Ok(number) } else { Err(self.wrong_cell(column, "a number from -1e12 to 1e12")) }
    }

    /// The error that the cell of a column is not what is expected.
    pub fn wrong_cell(self, column: usize, expected: &str) -> CsvError {
        let (name, text) = (self.table.header.get(column).unwrap_or_default().into(), self.cell(column).into());
        self.wrong(column, CsvFault::Cell { column: name, text, expected: expected.into() })
    }

    /// The error of `fault` at the cell of a column.
    pub fn wrong(self, column: usize, fault: CsvFault) -> CsvError {
        let source = &self.table.source;
        let place = place_of(source.text().as_bytes(), self.record.position(), column);
        FileError { place, ..source.error(None, Fault::Content(Box::new(fault))) }
    }
}

/// The error of a reader of `text`, with file, line and column.
pub fn csv_error(path: &Path, text: &[u8], error: &csv::Error) -> CsvError {
    let (column, fault) = match error.kind() {
        ErrorKind::UnequalLengths { expected_len, len, .. } => {
            let first_extra = usize::try_from(*expected_len.min(len)).unwrap_or(0);
            (first_extra, Fault::Content(CsvFault::Width { found: *len, expected: *expected_len }.into()))
        }
        ErrorKind::Utf8 { err, .. } => (err.field(), Fault::Content(CsvFault::Encoding.into())),
        _ => (0, Fault::Syntax(format!("{error}; save the table as comma-separated text"))),
    };
    FileError { path: path.into(), place: place_of(text, error.position(), column), fault }
}

/// Line and column where a cell of the row at `position` begins, or where the row ends that has fewer cells.
pub fn place_of(text: &[u8], position: Option<&csv::Position>, cell: usize) -> Option<Place> {
    let position = position?;
    let (row, skipped) = without_blank_lines(text.get(usize::try_from(position.byte()).ok()?..)?);
    let (mut start, mut commas, mut is_quoted) = (0, 0, false);
    // A quote counts at the start of a cell, and again where one has just ended: two stand for one.
    let mut may_open = true;
    let mut end = row.len();
    for (at, byte) in row.iter().enumerate() {
        match byte {
            b'"' if is_quoted || may_open => {
                is_quoted = !is_quoted;
                may_open = true;
                continue;
            }
            b'\r' | b'\n' if !is_quoted => {
                end = at;
                break;
            }
            b',' if !is_quoted && commas < cell => {
                commas += 1;
                start = at + 1;
            }
            _ => {}
        }
        may_open = *byte == b',' && !is_quoted;
    }
    let before = if commas < cell { end } else { start };
    let blanks = row[before..end].iter().take_while(|byte| matches!(byte, b' ' | b'\t')).count();
    let characters = String::from_utf8_lossy(&row[..before + blanks]).chars().count();
    Some(Place { line: usize::try_from(position.line()).ok()? + skipped, column: characters + 1 })
}

/// The text from the first row on, and how many line ends are before it: a position is before the empty lines and comments
/// that the reader skips.
fn without_blank_lines(mut text: &[u8]) -> (&[u8], usize) {
    let mut skipped = 0;
    loop {
        let is_comment = text.starts_with(b"#");
        let end = text.iter().position(|byte| *byte == b'\n');
        match (text.first(), end) {
            (Some(b'\r' | b'\n'), _) => {
                skipped += usize::from(text[0] == b'\n');
                text = &text[1..];
            }
            (_, Some(end)) if is_comment => {
                skipped += 1;
                text = &text[end + 1..];
            }
            _ => return (text, skipped),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        match CsvTable::of_text(Path::new("a.csv"), text) {
            Ok(table) => table.rows().find_map(|row| row.number(1).err()).map_or(String::new(), |e| e.to_string()),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn a_cell_is_found_behind_comments_quotes_blanks_and_empty_lines() {
        let wrong = "column b holds `x`, expected a number; correct the cell";
        for (text, place) in [
            ("a,b\n1,x\n", "2:3"),
            ("# c\na,b\n\n1,2\n\n# d\n1,  x\n", "7:5"),
            ("a,b\r\n1,2\r\n1,x\r\n", "3:3"),
            ("a,b\n\"1,1\",x\n", "2:7"),
            ("a,b\nä,x\n", "2:3"),
            ("a,b\n5\" y,x\n1,2\n", "2:6"),
            ("a,b\n\"5\"\" y\",x\n1,2\n", "2:9"),
        ] {
            assert_eq!(error(text), format!("a.csv:{place}: {wrong}"), "{text}");
        }
    }

    #[test]
    fn a_comment_without_a_line_end_is_no_row() {
        assert_eq!(error("a,b\n1,2\n# the end"), "");
        assert_eq!(error("a,b\n1,2"), "");
    }

    #[test]
    fn a_column_that_is_named_twice_is_found() {
        assert_eq!(error("# c\na,b,a\n1,2,3\n"), "a.csv:2:5: two columns are named a; remove one");
        assert_eq!(error("a,b,,\n1,2,3,4\n"), "");
    }

    #[test]
    fn an_empty_file_is_no_table() {
        assert_eq!(error("# comment\n"), "a.csv: the file is empty; give a table with a header");
    }

    #[test]
    fn a_row_of_another_width_is_found_where_it_ends_or_goes_too_far() {
        let wrong = |found: u64| format!("the row has {found} cells, the header has 2; correct the row");
        assert_eq!(error("a,b\n1,2\n1\n"), format!("a.csv:3:2: {}", wrong(1)));
        assert_eq!(error("a,b\n1,2\n1,2,3\n"), format!("a.csv:3:5: {}", wrong(3)));
    }

    #[test]
    fn a_file_that_is_not_text_and_one_that_is_missing_are_named() {
        let folder = std::env::temp_dir().join(format!("darm-csv-table-{}", std::process::id()));
        std::fs::write(&folder, b"a,b\n1,\xff\n").unwrap();
        let error = CsvTable::read(&folder).err().unwrap();
        assert_eq!(error.place, Some(Place { line: 2, column: 3 }), "{error}");
        std::fs::remove_file(&folder).unwrap();
        assert!(CsvTable::read(&folder).err().unwrap().to_string().ends_with("; check the path"));
    }
}
