//! Measurements as comma-separated text.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use darm_core::real::Vec3;
use darm_core::se::{Pose, Pose2};
use darm_core::units::Word;
use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;

use super::log::{self, LogError};
use super::{Finding, Run, Sample};

/// Why a file gives no measurements.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be opened or read.
    #[error("{}: cannot be read: {error}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },
    /// The text is no table: a row is longer or shorter than the header, say.
    #[error("{}: not a table of comma-separated values: {error}", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: csv::Error,
    },
    /// A log gives no table.
    #[error("{}: {error}", path.display())]
    Log {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: LogError,
    },
    /// A column that cannot be done without is missing.
    #[error("{}: no column {column}; the file has {present}; rename a column so that it carries this quantity and unit", path.display())]
    NoColumn {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// The columns that there are.
        present: String,
    },
    /// A cell cannot be read as what its column says.
    #[error("{}: line {line}: column {column} holds `{text}`, expected {expected}", path.display())]
    Cell {
        /// The file.
        path: PathBuf,
        /// Line of the file, the header being 1.
        line: usize,
        /// The column.
        column: String,
        /// What stands there.
        text: String,
        /// What should.
        expected: &'static str,
    },
    /// There is a header, or not even that, and no rows.
    #[error("{}: no rows, there is nothing to diagnose", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// Reads a file of measurements; says what its owner should know about it.
///
/// Rows in which the pose is not a number are left out and told.
pub fn read(path: &Path) -> Result<(Run, Vec<Finding>), ReadError> {
    read_text(path, &bytes(path)?)
}

/// The table in a file, expanded when its name ends in `.gz`, as text when it ends in `.mcap`.
pub(super) fn bytes(path: &Path) -> Result<Vec<u8>, ReadError> {
    let io = |error| ReadError::Io { path: path.into(), error };
    let mut file = File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    let ends_in = |end: &str| path.extension().is_some_and(|own| own == end);
    if ends_in("gz") {
        MultiGzDecoder::new(file).read_to_end(&mut bytes).map_err(io)?;
    } else {
        file.read_to_end(&mut bytes).map_err(io)?;
    }
    if ends_in("mcap") {
        return log::to_text(&bytes).map_err(|error| ReadError::Log { path: path.into(), error });
    }
    Ok(bytes)
}

/// The same of text that is in memory; `path` only serves messages.
pub fn read_text(path: &Path, text: &[u8]) -> Result<(Run, Vec<Finding>), ReadError> {
    let table_error = |error| ReadError::Table { path: path.into(), error };
    let mut table = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text);
    let columns = Columns::find(path, table.headers().map_err(table_error)?)?;
    let (mut run, mut findings) = (Run::default(), columns.findings.clone());
    for record in table.records() {
        let record = record.map_err(table_error)?;
        let line = record.position().map_or(0, |position| position.line() as usize);
        let row = Row { path, line, record: &record, columns: &columns };
        match row.sample(run.samples.last(), run.samples.len())? {
            Ok(sample) => {
                run.samples.push(sample);
                run.lines.push(line);
            }
            Err(finding) => findings.push(finding),
        }
    }
    if run.samples.is_empty() && findings.iter().all(|finding| finding.line.is_none()) {
        return Err(ReadError::Empty { path: path.into() });
    }
    Ok((run, findings))
}

/// Writes a file of measurements, compressed when its name ends in `.gz`, a log when it ends in `.mcap`; `about` are
/// comment lines (`# key value`) that stand before the table.
pub fn write(path: &Path, about: &str, run: &Run) -> io::Result<()> {
    let text = about.to_owned() + &write_text(run);
    match path.extension().and_then(|end| end.to_str()) {
        Some("gz") => {
            let mut encoder = GzEncoder::new(File::create(path)?, Compression::default());
            encoder.write_all(text.as_bytes())?;
            encoder.finish()?.flush()
        }
        Some("mcap") => std::fs::write(path, log::from_text(&text).map_err(io::Error::other)?),
        _ => std::fs::write(path, text),
    }
}

/// The text of such a file.
pub fn write_text(run: &Run) -> String {
    let planar = run.samples.iter().all(|sample| sample.pose.is_planar());
    let n_servos = run.samples.first().map_or(0, |sample| sample.servos_rad.len());
    let servos: String = (1..=n_servos).map(|k| format!("servo{k}_deg,")).collect();
    let pose = if planar { "x_m,y_m,angle_deg" } else { "x_m,y_m,z_m,rx_deg,ry_deg,rz_deg" };
    let mut text = format!("time_s,word,previous,{servos}{pose},supply_bar,temperature_c,run,visit,held_out\n");
    for sample in &run.samples {
        let previous = sample.previous.map_or(String::new(), |word| word.to_string());
        let servos: String = sample.servos_rad.iter().map(|angle| format!("{:.4},", angle.to_degrees())).collect();
        let optional = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.4}"));
        text += &format!(
            "{:.6},{},{previous},{servos}{},{},{},{},{},{}\n",
            sample.time_s,
            sample.word,
            pose_text(&sample.pose, planar),
            optional(sample.supply.map(|supply_pa| supply_pa / PA_PER_BAR)),
            optional(sample.temperature_c),
            sample.run,
            sample.visit,
            u8::from(sample.held_out),
        );
    }
    text
}

fn pose_text(pose: &Pose<f64>, planar: bool) -> String {
    let p = &pose.position;
    if planar {
        let flat = Pose2::projection(pose);
        return format!("{:.7},{:.7},{:.6}", p.x, p.y, flat.angle_rad.to_degrees());
    }
    let w = pose.log().angular.map(f64::to_degrees);
    format!("{:.7},{:.7},{:.7},{:.6},{:.6},{:.6}", p.x, p.y, p.z, w.x, w.y, w.z)
}

/// Where in a row each quantity stands.
struct Columns {
    at: BTreeMap<String, usize>,
    servos: Vec<String>,
    planar: bool,
    findings: Vec<Finding>,
}

const PLANAR: [&str; 3] = ["x_m", "y_m", "angle_deg"];
const SPATIAL: [&str; 6] = ["x_m", "y_m", "z_m", "rx_deg", "ry_deg", "rz_deg"];
/// Files hold bar, samples Pa.
const PA_PER_BAR: f64 = 1e5;

const OTHERS: [&str; 8] = ["time_s", "word", "previous", "supply_bar", "temperature_c", "run", "visit", "held_out"];

impl Columns {
    fn find(path: &Path, header: &csv::StringRecord) -> Result<Self, ReadError> {
        let at: BTreeMap<String, usize> = header.iter().enumerate().map(|(k, name)| (name.to_string(), k)).collect();
        let planar = !at.contains_key("z_m");
        let pose: &[&str] = if planar { &PLANAR } else { &SPATIAL };
        if let Some(missing) = ["time_s", "word"].iter().chain(pose).find(|name| !at.contains_key(**name)) {
            let present = header.iter().collect::<Vec<_>>().join(", ");
            return Err(ReadError::NoColumn { path: path.into(), column: (*missing).into(), present });
        }
        let servos: Vec<String> =
            (1..).map(|k| format!("servo{k}_deg")).take_while(|name| at.contains_key(name)).collect();
        let known =
            |name: &str| OTHERS.contains(&name) || pose.contains(&name) || servos.iter().any(|servo| servo == name);
        let unread: Vec<&str> = header.iter().filter(|name| !known(name)).collect();
        let mut findings = Vec::new();
        if !unread.is_empty() {
            findings.push(Finding { line: None, what: format!("columns left unread: {}", unread.join(", ")) });
        }
        Ok(Self { at, servos, planar, findings })
    }
}

/// One row with what is needed to tell what is wrong with it.
struct Row<'a> {
    path: &'a Path,
    line: usize,
    record: &'a csv::StringRecord,
    columns: &'a Columns,
}

impl Row<'_> {
    /// The sample of this row, or why it is left out.
    fn sample(&self, before: Option<&Sample>, index: usize) -> Result<Result<Sample, Finding>, ReadError> {
        let pose_names: &[&str] = if self.columns.planar { &PLANAR } else { &SPATIAL };
        let mut numbers = [0.0f64; 6];
        for (number, name) in numbers.iter_mut().zip(pose_names) {
            *number = self.required(name, "a number")?;
            if !number.is_finite() {
                return Ok(Err(self.finding(format!("{name} is not a number, the row is left out"))));
            }
        }
        let time_s: f64 = self.required("time_s", "a number")?;
        let word: Word = self.required("word", "digits 0 to 3")?;
        let run = self.optional("run", "a whole number")?.unwrap_or(0);
        let previous = if self.columns.at.contains_key("previous") {
            self.optional("previous", "digits 0 to 3")?
        } else {
            before.filter(|before| before.run == run).map(|before| before.word)
        };
        let servos_rad: Vec<f64> = self
            .columns
            .servos
            .iter()
            .map(|name| self.required::<f64>(name, "a number").map(f64::to_radians))
            .collect::<Result<_, _>>()?;
        if !time_s.is_finite() || servos_rad.iter().any(|angle| !angle.is_finite()) {
            return Ok(Err(self.finding("time or servo position is not a number, the row is left out".into())));
        }
        Ok(Ok(Sample {
            time_s,
            word,
            previous,
            servos_rad,
            pose: self.pose(&numbers),
            supply: self
                .optional("supply_bar", "a number")?
                .filter(|value: &f64| value.is_finite())
                .map(|bar| bar * PA_PER_BAR),
            temperature_c: self.optional("temperature_c", "a number")?.filter(|value: &f64| value.is_finite()),
            run,
            visit: self.optional("visit", "a whole number")?.unwrap_or(index as u32),
            held_out: self.optional::<u8>("held_out", "0 or 1")?.unwrap_or(0) != 0,
        }))
    }

    fn pose(&self, numbers: &[f64; 6]) -> Pose<f64> {
        let [x, y, z, ..] = *numbers;
        if self.columns.planar {
            return Pose2::new(x, y, z.to_radians()).into();
        }
        let turn = Vec3::new(numbers[3], numbers[4], numbers[5]).map(f64::to_radians);
        Pose::new(&turn, Vec3::new(x, y, z))
    }

    fn finding(&self, what: String) -> Finding {
        Finding { line: Some(self.line), what }
    }

    fn required<T: FromStr>(&self, column: &str, expected: &'static str) -> Result<T, ReadError> {
        let text = self.text(column);
        text.parse().map_err(|_| self.cell(column, expected))
    }

    /// `None` of an empty cell or a missing column.
    fn optional<T: FromStr>(&self, column: &str, expected: &'static str) -> Result<Option<T>, ReadError> {
        match self.text(column) {
            "" => Ok(None),
            text => text.parse().map(Some).map_err(|_| self.cell(column, expected)),
        }
    }

    fn text(&self, column: &str) -> &str {
        self.columns.at.get(column).and_then(|&at| self.record.get(at)).unwrap_or("")
    }

    fn cell(&self, column: &str, expected: &'static str) -> ReadError {
        ReadError::Cell {
            path: self.path.into(),
            line: self.line,
            column: column.into(),
            text: self.text(column).into(),
            expected,
        }
    }
}

#[cfg(test)]
mod tests;
