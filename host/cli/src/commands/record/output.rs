//! The file of a recording: checked before the arm moves, then written row by row.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use darm_core::units::Digest;
use darm_measure::poses::{self, Which};
use darm_measure::{ReadError, Run, Sample, Stream, about};

use super::RecordError;
use darm_arm::table_file::digest;

/// Contents of an earlier recording of the same program.
pub(crate) struct Earlier {
    /// Time of row 0, in seconds of the board.
    pub(crate) start_s: f64,
    /// Number of the board's start in which the program runs.
    pub(crate) boots: u32,
    /// The board.
    pub(crate) device: String,
    /// Digest of the table.
    pub(crate) table: Digest,
    about: BTreeMap<String, String>,
    run: Run,
}

/// A file that grows.
pub(crate) struct Output {
    path: PathBuf,
    /// File that is written until it contains the earlier recording.
    written: PathBuf,
    stream: Stream,
    /// The file is new and nothing was written yet.
    empty: bool,
    /// All rows of the file.
    pub(crate) samples: Vec<Sample>,
}

impl Output {
    /// Opens a file for a new recording; its old contents stay until the program has started.
    pub(crate) fn create(path: &Path) -> anyhow::Result<Self> {
        Self::at(path, path.into())
    }

    /// Opens the file of an earlier recording, and reads it.
    pub(crate) fn resume(path: &Path) -> anyhow::Result<(Self, Earlier)> {
        let earlier = earlier(path)?;
        let name = path.file_name().ok_or_else(|| RecordError::NothingToResume(path.into()))?;
        let written = path.with_file_name(format!("resumed-{}", name.to_string_lossy()));
        Ok((Self::at(path, written)?, earlier))
    }

    fn at(path: &Path, written: PathBuf) -> anyhow::Result<Self> {
        let empty = !written.exists();
        let stream = Stream::open(&written).with_context(|| format!("cannot write {}", path.display()))?;
        Ok(Self { path: path.into(), written, stream, empty, samples: Vec::new() })
    }

    /// Begins a new recording with these comment lines.
    pub(crate) fn begin(&mut self, about: &str) -> anyhow::Result<()> {
        self.empty = false;
        self.stream.begin(about).with_context(|| format!("cannot write {}", self.path.display()))
    }

    /// Begins with the rows of an earlier recording, and replaces its file.
    pub(crate) fn begin_after(&mut self, earlier: Earlier) -> anyhow::Result<()> {
        let about: String = earlier.about.iter().map(|(key, value)| format!("# {key} {value}\n")).collect();
        self.begin(&about)?;
        let copied = self.stream.rows(&earlier.run).and_then(|()| std::fs::rename(&self.written, &self.path));
        copied.with_context(|| format!("cannot write {}", self.path.display()))?;
        self.samples = earlier.run.samples;
        Ok(())
    }

    /// Writes a row.
    pub(crate) fn row(&mut self, sample: Sample, planar: bool) -> anyhow::Result<()> {
        self.stream.row(&sample, planar).with_context(|| format!("cannot write {}", self.path.display()))?;
        self.samples.push(sample);
        Ok(())
    }

    /// Writes comment lines.
    pub(crate) fn note(&mut self, lines: &str) -> anyhow::Result<()> {
        self.stream.note(lines).with_context(|| format!("cannot write {}", self.path.display()))
    }

    /// Writes the end of the file; returns all rows.
    pub(crate) fn finish(mut self) -> anyhow::Result<Vec<Sample>> {
        let samples = std::mem::take(&mut self.samples);
        self.stream.finish().with_context(|| format!("cannot write {}", self.path.display()))?;
        Ok(samples)
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        if self.empty {
            // Do not leave an empty file.
            let _ = std::fs::remove_file(&self.written);
        }
    }
}

impl Earlier {
    /// The first visit of this run that is not in the file, nor before one that is.
    pub(crate) fn next(&self, run: u32) -> usize {
        let visits = self.run.samples.iter().filter(|sample| sample.run == run).map(|sample| sample.visit as usize + 1);
        visits.max().unwrap_or(0)
    }
}

fn earlier(path: &Path) -> anyhow::Result<Earlier> {
    let about = about(path)?;
    let none = || RecordError::NothingToResume(path.into());
    let run = match poses::read(path, &Default::default(), &Which::default()) {
        Ok((run, _)) => run,
        // The recording was killed before its first row.
        Err(ReadError::Empty { .. }) => Run::default(),
        Err(error) => return Err(error.into()),
    };
    let value = |key: &str| about.get(key).ok_or_else(none);
    Ok(Earlier {
        start_s: value("program_start_s")?.parse().map_err(|_| none())?,
        boots: value("boot")?.parse().map_err(|_| none())?,
        device: value("board")?.clone(),
        table: digest(value("table")?).ok_or_else(none)?,
        run,
        about,
    })
}
