//! A file of measurements that grows row by row: what was written is readable at any moment.

use super::csv_text::csv_text;
use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use flate2::Compression;
use flate2::write::GzEncoder;

use super::csv::Columns;
use super::log::{self, Rows};
use super::{Run, Sample};

/// A file that grows, compressed when its name ends in `.gz`, a log when it ends in `.mcap`.
pub struct Stream {
    sink: Sink,
    columns: Option<Columns>,
}

enum Sink {
    Text(File),
    Compressed(GzEncoder<File>),
    /// Its comment lines until the columns are known, then its rows.
    Log {
        file: File,
        about: String,
        rows: Option<Rows>,
    },
}

impl Stream {
    /// Opens a file for writing and leaves what it holds until [`Stream::begin`]; a missing file is made.
    ///
    /// # Errors
    ///
    /// The file cannot be opened or made.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().write(true).create(true).truncate(false).open(path)?;
        let sink = match path.extension().and_then(|end| end.to_str()) {
            Some("gz") => Sink::Compressed(GzEncoder::new(file, Compression::default())),
            Some("mcap") => Sink::Log { file, about: String::new(), rows: None },
            _ => Sink::Text(file),
        };
        Ok(Self { sink, columns: None })
    }

    /// Drops what the file held and writes comment lines (`# key value`).
    ///
    /// # Errors
    ///
    /// The file cannot be emptied or written.
    pub fn begin(&mut self, about: &str) -> io::Result<()> {
        self.file().set_len(0)?;
        self.note(about)
    }

    /// Writes comment lines, between rows or after the last.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn note(&mut self, lines: &str) -> io::Result<()> {
        match &mut self.sink {
            Sink::Log { about, rows: None, .. } => about.push_str(lines),
            Sink::Log { file, rows: Some(rows), .. } => {
                rows.log.metadata(&log::about(lines.lines()));
                return file.write_all(&rows.log.take());
            }
            Sink::Text(file) => return file.write_all(lines.as_bytes()),
            Sink::Compressed(encoder) => return write_compressed(encoder, lines),
        }
        Ok(())
    }

    /// Writes a row, after the header before the first one. All rows are of one kind of arm: planar or not.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn row(&mut self, sample: &Sample, planar: bool) -> io::Result<()> {
        let columns = match self.columns {
            Some(columns) => columns,
            None => self.header(sample, planar)?,
        };
        let row = columns.row(sample);
        match &mut self.sink {
            Sink::Text(file) => file.write_all(csv_text([&row]).as_bytes()),
            Sink::Compressed(encoder) => write_compressed(encoder, &csv_text([&row])),
            Sink::Log { file, rows, .. } => {
                let Some(rows) = rows else { return Ok(()) };
                rows.push(&row);
                file.write_all(&rows.log.take())
            }
        }
    }

    /// Writes the rows of a run.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn rows(&mut self, run: &Run) -> io::Result<()> {
        let planar = run.samples.iter().all(|sample| sample.pose.is_planar());
        run.samples.iter().try_for_each(|sample| self.row(sample, planar))
    }

    /// Writes what belongs to the end.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn finish(&mut self) -> io::Result<()> {
        match &mut self.sink {
            Sink::Text(file) => file.flush(),
            Sink::Compressed(encoder) => encoder.try_finish(),
            Sink::Log { file, about, rows } => {
                let rows =
                    rows.take().unwrap_or_else(|| Rows::new(&log::about(about.lines()), csv::StringRecord::new()));
                file.write_all(&rows.log.finish())
            }
        }
    }

    fn header(&mut self, sample: &Sample, planar: bool) -> io::Result<Columns> {
        let (n_servos, n_strokes) = (sample.servos_rad.len(), sample.strokes_s.len());
        let columns = Columns { planar, has_load: sample.load_kg.is_some(), n_servos, n_strokes };
        let header = columns.header();
        match &mut self.sink {
            Sink::Text(file) => file.write_all(csv_text([&header]).as_bytes())?,
            Sink::Compressed(encoder) => write_compressed(encoder, &csv_text([&header]))?,
            Sink::Log { file, about, rows } => {
                let now = SystemTime::now().duration_since(UNIX_EPOCH).map_err(io::Error::other)?;
                about.push_str(&format!("# {} {:.3}\n", log::FIRST_ROW, now.as_secs_f64()));
                let rows = rows.insert(Rows::new(&log::about(about.lines()), header));
                file.write_all(&rows.log.take())?;
            }
        }
        Ok(*self.columns.insert(columns))
    }

    fn file(&self) -> &File {
        match &self.sink {
            Sink::Text(file) | Sink::Log { file, .. } => file,
            Sink::Compressed(encoder) => encoder.get_ref(),
        }
    }
}

/// Writes so that all of it can be expanded without what follows.
fn write_compressed(encoder: &mut GzEncoder<File>, text: &str) -> io::Result<()> {
    encoder.write_all(text.as_bytes())?;
    encoder.flush()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_core::se::Pose2;

    use super::*;
    use crate::poses::{self, Which};

    fn sample(visit: u32) -> Sample {
        Sample {
            time_s: f64::from(visit),
            word: "01".parse().unwrap(),
            previous: None,
            servos_rad: vec![],
            pose: Pose2::new(0.1 * f64::from(visit), 0.2, 0.3).into(),
            supply: Some(6e5),
            temperature_c: None,
            load_kg: None,
            strokes_s: vec![None, Some(0.0123)],
            run: 3,
            visit,
            held_out: false,
        }
    }

    fn visits(path: &Path) -> Option<Vec<u32>> {
        let (run, _) = poses::read(path, &Default::default(), &Which::default()).ok()?;
        Some(run.samples.iter().map(|sample| sample.visit).collect())
    }

    #[test]
    fn a_file_is_readable_after_each_row_and_wherever_it_was_cut() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["run.csv", "run.csv.gz", "run.mcap"] {
            let path = folder.path().join(name);
            let mut stream = Stream::open(&path).unwrap();
            stream.begin("# model 7\n# program_start_s 1.5\n").unwrap();
            for visit in 0..5 {
                stream.row(&sample(visit), true).unwrap();
                assert_eq!(visits(&path), Some((0..=visit).collect()), "{name}");
            }
            let bytes = std::fs::read(&path).unwrap();
            for end in 0..bytes.len() {
                std::fs::write(&path, &bytes[..end]).unwrap();
                if let Some(read) = visits(&path) {
                    assert_eq!(read, (0..read.len() as u32).collect::<Vec<_>>(), "{name} cut at {end}");
                }
            }
            std::fs::write(&path, &bytes[..bytes.len() - 3]).unwrap();
            assert!(visits(&path).is_some_and(|read| read.len() >= 4), "{name}");
        }
    }

    #[test]
    fn what_a_file_held_stays_until_the_first_line_and_notes_are_found_again() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["run.csv", "run.csv.gz", "run.mcap"] {
            let path = folder.path().join(name);
            std::fs::write(&path, "older").unwrap();
            let mut stream = Stream::open(&path).unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), b"older");
            stream.begin("# model 7\n# boot 2\n").unwrap();
            stream.row(&sample(0), true).unwrap();
            stream.note("# boot 3\n").unwrap();
            stream.finish().unwrap();
            let about = crate::about(&path).unwrap();
            assert_eq!([&about["model"], &about["boot"]], ["7", "3"], "{name}");
            assert_eq!(visits(&path), Some(vec![0]), "{name}");
        }
    }
}
