//! Visit files: at which words a program rests, and when. `darm table` writes one per table, `darm record` reads it.
//!
//! Comma-separated text after three comment lines. Times are after the start of the program.
//!
//! | comment line            | meaning                                                   |
//! |-------------------------|-----------------------------------------------------------|
//! | `# model HASH`          | hash of the model that the table was made for             |
//! | `# table SHA-256`       | digest of the table that the visits belong to             |
//! | `# geometry HASH`       | hash of that model without its effects                    |
//!
//! | column                  | meaning                                                   |
//! |-------------------------|-----------------------------------------------------------|
//! | `visit`, `label`        | number from 0, name                                       |
//! | `from_s`, `to_s`        | when the arm rests there                                  |
//! | `row`                   | the row of the table that completes the word              |
//! | `word`, `previous`      | digits, and those of the visit before                     |
//! | `servo0_deg`, …         | positions of the servo joints                             |
//! | `held_out`              | 1 if the visit is held out                                |

use std::path::{Path, PathBuf};

use darm_core::units::{Digest, ModelHash, Word};
use darm_robot::csv_table::{CsvError, CsvRow, CsvTable};

use crate::csv_text::csv_text;
use darm_arm::table_file::digest;

/// One rest of a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// Its name.
    pub label: String,
    /// From when, s after the start.
    pub from_s: f64,
    /// To when, s.
    pub to_s: f64,
    /// The row that completes the word.
    pub row: u16,
    /// The word.
    pub word: Word,
    /// The word of the visit before.
    pub previous: Word,
    /// Positions of the servo joints, rad.
    pub servos_rad: Vec<f64>,
    /// Whether it is held out.
    pub held_out: bool,
}

/// A visit file.
#[derive(Clone, Debug, PartialEq)]
pub struct Visits {
    /// The model that the table was made for.
    pub model: ModelHash,
    /// The same model without its effects.
    pub geometry: ModelHash,
    /// The table.
    pub table: Digest,
    /// In order of time.
    pub rests: Vec<Rest>,
}

/// Why a visit file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum VisitsError {
    /// The file cannot be read.
    #[error("{path}: cannot be read: {source}; `darm table` writes it together with the table")]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A row is invalid.
    #[error(transparent)]
    Csv(#[from] CsvError),
    /// A comment line is invalid.
    #[error("{path}:{line}:1: {what}; remake the file with `darm table`")]
    Line {
        /// The file.
        path: PathBuf,
        /// Line, the first being 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
}

/// Beginning of the header.
pub const HEADER: &str = "visit,label,from_s,to_s,";
const MODEL: &str = "# model ";
const TABLE: &str = "# table ";
const GEOMETRY: &str = "# geometry ";

impl Rest {
    /// The cells of its line.
    fn cells(&self, visit: usize) -> Vec<String> {
        let mut cells = vec![
            visit.to_string(),
            self.label.replace([',', '"', '\n', '#'], " "),
            format!("{:.6}", self.from_s),
            format!("{:.6}", self.to_s),
            self.row.to_string(),
            self.word.to_string(),
            self.previous.to_string(),
        ];
        cells.extend(self.servos_rad.iter().map(|angle| format!("{:.4}", angle.to_degrees())));
        cells.push(u8::from(self.held_out).to_string());
        cells
    }
}

impl Visits {
    /// The text of the file.
    pub fn to_text(&self) -> String {
        let n_servos = self.rests.first().map_or(0, |rest| rest.servos_rad.len());
        let columns = HEADER.split_terminator(',').chain(["row", "word", "previous"]).map(str::to_owned);
        let servos = (0..n_servos).map(|number| format!("servo{number}_deg"));
        let header: Vec<String> = columns.chain(servos).chain(["held_out".to_owned()]).collect();
        let rows = self.rests.iter().enumerate().map(|(visit, rest)| rest.cells(visit));
        let Self { model, table, geometry, .. } = self;
        let comments = format!("{MODEL}{model}\n{TABLE}{table}\n{GEOMETRY}{geometry}\n");
        comments + &csv_text(std::iter::once(header).chain(rows))
    }

    /// Reads the file.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or a line of it is none of a visit file.
    pub fn read(path: &Path) -> Result<Self, VisitsError> {
        let text = std::fs::read_to_string(path).map_err(|source| VisitsError::Read { path: path.into(), source })?;
        Self::parse(path, &text)
    }

    /// The same of a text; `path` only serves messages.
    ///
    /// # Errors
    ///
    /// A line is none of a visit file.
    pub fn parse(path: &Path, text: &str) -> Result<Self, VisitsError> {
        let wrong = |(line, what)| VisitsError::Line { path: path.into(), line, what };
        let hash = |value: &str| u64::from_str_radix(value, 16).ok().map(ModelHash);
        let model = comment(text, 1, MODEL, hash).map_err(wrong)?;
        let digest = comment(text, 2, TABLE, digest).map_err(wrong)?;
        let geometry = comment(text, 3, GEOMETRY, hash).map_err(wrong)?;
        let table = CsvTable::of_text(path, text)?;
        let rests = table.rows().map(|row| rest(&table, row)).collect::<Result<_, _>>()?;
        Ok(Self { model, geometry, table: digest, rests })
    }
}

/// The value of a comment line; the first line is 1.
fn comment<T>(text: &str, line: usize, key: &str, read: impl Fn(&str) -> Option<T>) -> Result<T, (usize, String)> {
    let value = text.lines().nth(line - 1).and_then(|line| line.strip_prefix(key));
    let missing = || (line, format!("expected `{}` and a hash", key.trim_end()));
    value.and_then(|value| read(value.trim())).ok_or_else(missing)
}

/// The visit of a row.
fn rest(table: &CsvTable, row: CsvRow<'_>) -> Result<Rest, CsvError> {
    let at = |name: &str| table.column(name).ok_or_else(|| table.no_column(name));
    let servos = table.header().enumerate().filter(|(_, name)| name.starts_with("servo"));
    Ok(Rest {
        label: row.cell(at("label")?).to_owned(),
        from_s: row.number(at("from_s")?)?,
        to_s: row.number(at("to_s")?)?,
        row: row.value(at("row")?, "the number of a row")?,
        word: row.value(at("word")?, "digits 0 to 3")?,
        previous: row.value(at("previous")?, "digits 0 to 3")?,
        servos_rad: servos.map(|(column, _)| row.number(column).map(f64::to_radians)).collect::<Result<_, _>>()?,
        held_out: row.value::<u8>(at("held_out")?, "0 or 1")? != 0,
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{Rest, TABLE, Visits};
    use darm_core::units::{Digest, ModelHash};

    fn visits() -> Visits {
        let rest = Rest {
            label: "A".into(),
            from_s: 0.15,
            to_s: 0.45,
            row: 1,
            word: "0101".parse().unwrap(),
            previous: "0000".parse().unwrap(),
            servos_rad: vec![0.5f64.to_radians()],
            held_out: true,
        };
        Visits {
            model: ModelHash(0x0123_4567_89ab_cdef),
            geometry: ModelHash(7),
            table: Digest([0xa5; 32]),
            rests: vec![rest.clone(), Rest { held_out: false, ..rest }],
        }
    }

    fn parse(text: &str) -> Result<Visits, String> {
        Visits::parse(Path::new("a.visits.csv"), text).map_err(|error| error.to_string())
    }

    #[test]
    fn visits_survive_writing_and_parsing() {
        assert_eq!(parse(&visits().to_text()), Ok(visits()));
    }

    #[test]
    fn an_invalid_cell_is_reported_by_line_and_column() {
        let text = visits().to_text().replace("0.450000", "soon");
        let said = "a.visits.csv:5:14: column to_s holds `soon`, expected a number; correct the cell";
        assert_eq!(parse(&text), Err(said.into()));
        assert!(parse("visit\n").unwrap_err().starts_with("a.visits.csv:1:1: expected `# model`"));
        let old = visits().to_text().replace(TABLE, "# ");
        assert!(parse(&old).unwrap_err().starts_with("a.visits.csv:2:1: expected `# table`"));
    }
}
