//! Measurements as comma-separated text.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Write};
use std::iter;
use std::path::Path;

use csv::StringRecord;
use darm_core::se::{Pose, Pose2};
use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;

use super::csv_text::{csv_cells, csv_text};
use super::error::ReadError;
use super::foreign;
use super::log::{self, LogError};
use super::mcap::{self, Log};
use super::{Run, Sample};
use darm_robot::files::{FileRef, Limits};

/// The table in a file.
pub(super) struct Content {
    /// Comma-separated text of complete rows.
    pub(super) text: Vec<u8>,
    /// The file ends in the middle of a row, as when its writer was killed.
    pub(super) cut: bool,
    /// What of a log is damaged and left out.
    pub(super) damaged: Vec<String>,
}

/// The table in a file, expanded when its name ends in `.gz`, as text when it ends in `.mcap`. A file that ends early
/// gives the rows that are complete.
pub(super) fn content(file: &FileRef<'_>) -> Result<Content, ReadError> {
    let (path, limits) = (file.path, file.files.limits());
    let io = |error| ReadError::Io { path: path.into(), error };
    let ends_in = |end: &str| path.extension().is_some_and(|own| own == end);
    let mut text = file.bytes().map_err(io)?;
    let mut cut = false;
    if ends_in("gz") || text.starts_with(&[0x1f, 0x8b]) {
        (text, cut) = expanded(&text, &limits).map_err(io)?;
    } else if ends_in("mcap") || text.starts_with(&mcap::MAGIC) {
        let log = log::text_within(&text, &limits);
        let (text, cut, damaged) = log.map_err(|error| ReadError::Log { path: path.into(), error })?;
        return Ok(Content { text, cut, damaged });
    }
    if let Some(fault) = foreign::unread(path, &text).or_else(|| foreign::imported(path, &text)) {
        return Err(ReadError::Foreign { path: path.into(), fault });
    }
    if !limits.has_room_for_lines(&text, b',') {
        return Err(io(io::Error::other(limits.too_many_cells())));
    }
    cut |= is_last_row_short(&text);
    if cut {
        let end = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
        text.truncate(end);
    }
    Ok(Content { text, cut, damaged: Vec::new() })
}

/// Compressed text, and whether it ends early; an error where not even its beginning can be read, or where it is longer than
/// the limit.
pub(crate) fn expanded(bytes: &[u8], limits: &Limits) -> io::Result<(Vec<u8>, bool)> {
    let mut text = Vec::new();
    match MultiGzDecoder::new(bytes).take(limits.bytes + 1).read_to_end(&mut text) {
        Ok(length) if length as u64 > limits.bytes => Err(io::Error::other(limits.too_large())),
        Ok(_) => Ok((text, false)),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof && !text.is_empty() => Ok((text, true)),
        Err(error) => Err(error),
    }
}

/// Whether the last line has no end and fewer cells than the header.
fn is_last_row_short(text: &[u8]) -> bool {
    let cells = |line: &[u8]| csv_cells(&String::from_utf8_lossy(line)).len();
    let mut lines = text.split(|&byte| byte == b'\n').filter(|line| !line.starts_with(b"#"));
    let header = lines.next().map_or(0, cells);
    lines.next_back().is_some_and(|last| !last.is_empty() && cells(last) < header)
}

/// Comment lines (`# key value`) of a file of measurements, or the metadata of a log.
///
/// # Errors
///
/// The file cannot be read or decompressed, or its name ends in `.mcap` and it is not a sound log.
pub fn about<'a>(file: impl Into<FileRef<'a>>) -> Result<BTreeMap<String, String>, ReadError> {
    let file = file.into();
    let path = file.path;
    if path.extension().is_some_and(|end| end == "mcap") {
        let bytes = file.bytes().map_err(|error| ReadError::Io { path: path.into(), error })?;
        let log = Log::read_within(&bytes, &file.files.limits());
        return log
            .map(|(log, _)| log.metadata)
            .map_err(|error| ReadError::Log { path: path.into(), error: LogError::Mcap(error) });
    }
    let text = content(&file)?.text;
    Ok(log::about(String::from_utf8_lossy(&text).lines()).into_iter().collect())
}

/// Writes a file of measurements, compressed when its name ends in `.gz`, a log when it ends in `.mcap`; `about` are
/// comment lines (`# key value`) that are before the table.
///
/// # Errors
///
/// The file cannot be written.
pub fn write(path: &Path, about: &str, run: &Run) -> io::Result<()> {
    write_table(path, &(about.to_owned() + &write_text(run)))
}

/// Writes a table of comma-separated text with its comment lines in the same way.
///
/// # Errors
///
/// The file cannot be written. For a log also where `text` is not a table: a row is longer or shorter than the header.
pub fn write_table(path: &Path, text: &str) -> io::Result<()> {
    match path.extension().and_then(|end| end.to_str()) {
        Some("gz") => {
            let mut encoder = GzEncoder::new(File::create(path)?, Compression::default());
            encoder.write_all(text.as_bytes())?;
            encoder.finish()?.flush()
        }
        Some("mcap") => std::fs::write(path, log::from_text(text).map_err(io::Error::other)?),
        _ => std::fs::write(path, text),
    }
}

/// The text of such a file.
pub fn write_text(run: &Run) -> String {
    let samples = &run.samples;
    let columns = Columns {
        planar: samples.iter().all(|sample| sample.pose.is_planar()),
        has_load: samples.iter().any(|sample| sample.load_kg.is_some()),
        n_servos: samples.first().map_or(0, |sample| sample.servos_rad.len()),
        n_strokes: samples.first().map_or(0, |sample| sample.strokes_s.len()),
    };
    let rows = samples.iter().map(|sample| columns.row(sample));
    csv_text(&iter::once(columns.header()).chain(rows).collect::<Vec<_>>())
}

/// Which columns a file of poses has.
#[derive(Clone, Copy)]
pub(super) struct Columns {
    pub(super) planar: bool,
    pub(super) has_load: bool,
    pub(super) n_servos: usize,
    pub(super) n_strokes: usize,
}

impl Columns {
    /// Their names.
    pub(super) fn header(&self) -> StringRecord {
        let pose: &[_] = match self.planar {
            true => &["x_m", "y_m", "angle_deg"],
            false => &["x_m", "y_m", "z_m", "rx_deg", "ry_deg", "rz_deg"],
        };
        let mut header = StringRecord::from(vec!["time_s", "word", "previous"]);
        header.extend((0..self.n_servos).map(|k| format!("servo{k}_deg")));
        header.extend(pose);
        header.extend(["supply_bar", "temperature_c"]);
        header.extend(self.has_load.then_some("load_kg"));
        // Not at the end: a number that is cut there would be read as a shorter one.
        header.extend((0..self.n_strokes).map(|k| format!("stroke{k}_us")));
        header.extend(["run", "visit", "held_out"]);
        header
    }

    /// The cells of a sample.
    pub(super) fn row(&self, sample: &Sample) -> StringRecord {
        let optional = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.4}"));
        let previous = sample.previous.map_or(String::new(), |word| word.to_string());
        let mut row = StringRecord::from(vec![format!("{:.6}", sample.time_s), sample.word.to_string(), previous]);
        row.extend(sample.servos_rad.iter().map(|angle| format!("{:.4}", angle.to_degrees())));
        row.extend(pose_cells(&sample.pose, self.planar));
        row.extend([optional(sample.supply.map(|supply_pa| supply_pa / PA_PER_BAR)), optional(sample.temperature_c)]);
        row.extend(self.has_load.then(|| optional(sample.load_kg)));
        let strokes = sample.strokes_s.iter().chain(iter::repeat(&None)).take(self.n_strokes);
        row.extend(strokes.map(|time_s| time_s.map_or(String::new(), |time_s| format!("{:.0}", 1e6 * time_s))));
        row.extend([sample.run.to_string(), sample.visit.to_string(), u8::from(sample.held_out).to_string()]);
        row
    }
}

/// Files hold bar, samples Pa.
const PA_PER_BAR: f64 = 1e5;

fn pose_cells(pose: &Pose<f64>, planar: bool) -> Vec<String> {
    let (metres, degrees) = (|x: f64| format!("{x:.7}"), |angle: f64| format!("{:.6}", angle.to_degrees()));
    let p = &pose.position;
    if planar {
        return vec![metres(p.x), metres(p.y), degrees(Pose2::projection(pose).angle_rad)];
    }
    let w = pose.log().angular;
    vec![metres(p.x), metres(p.y), metres(p.z), degrees(w.x), degrees(w.y), degrees(w.z)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_compressed_file_expands_to_no_more_than_memory_is_given_for() {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&[b'0'; 10_000]).unwrap();
        let bomb = encoder.finish().unwrap();
        assert!(bomb.len() < 100);
        let limits = |bytes| Limits { bytes, ..Limits::SERVER };
        assert_eq!(expanded(&bomb, &limits(10_000)).unwrap(), (vec![b'0'; 10_000], false));
        assert!(expanded(&bomb, &limits(9_999)).unwrap_err().to_string().contains("expands to more than"));
    }
}
