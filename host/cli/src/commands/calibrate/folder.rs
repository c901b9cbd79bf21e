//! The folder of a calibration: what it was begun with, the rows of each look, and what came of it.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use darm_arm::arm::Arm;
use darm_arm::arm::frames::{self, DesiredFrame};
use darm_arm::board_profile::BoardProfile;
use darm_arm::plan::Visit;
use darm_arm::table_file::{self, visits_file};
use darm_diagnose::calibrate::CalibrateOptions;
use darm_diagnose::outcome::Diagnosis;
use darm_measure::poses::{self, Which};
use darm_measure::visit_table::{PlannedVisit, VisitTable};
use darm_measure::{Run, Sample, write_text};
use serde::{Deserialize, Serialize};

use super::CalibrateError;
use crate::commands::diagnose;
use crate::output_file;

/// Version of the folder's files.
const FORMAT: u32 = 1;
/// What the calibration was begun with.
const SETTINGS: &str = "calibration.json";

/// All rows.
const RUN: &str = "run.csv";
/// The verdict and its evidence.
pub(super) const REPORT: &str = "report.html";
/// What was measured at the frames.
const FRAMES: &str = "frames.csv";

/// What a calibration is begun with; it holds for all of its looks.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Settings {
    format: u32,
    /// Hash of the arm.
    arm: String,
    /// The frames, as a file of frames has them.
    frames: String,
    options: CalibrateOptions,
}

/// An open folder.
pub(super) struct Folder {
    path: PathBuf,
}

impl Settings {
    pub(super) fn new(arm: &Arm, frames: &[DesiredFrame], options: &CalibrateOptions) -> Self {
        let (arm, frames) = (arm.hash().to_string(), frames::to_toml(frames));
        Self { format: FORMAT, arm, frames, options: options.clone() }
    }

    /// What differs.
    fn difference(&self, other: &Self) -> Option<&'static str> {
        match () {
            () if self.format != other.format => Some("format"),
            () if self.arm != other.arm => Some("arm"),
            () if self.frames != other.frames => Some("set of frames"),
            () if self.options != other.options => Some("--goal, --looks or --seed"),
            () => None,
        }
    }
}

impl Folder {
    /// Whether a calibration was begun there.
    pub(super) fn is_begun(path: &Path) -> bool {
        path.join(SETTINGS).exists()
    }

    /// Opens the folder of a calibration with these settings, or makes it.
    pub(super) fn open(path: &Path, settings: &Settings) -> anyhow::Result<Self> {
        let file = path.join(SETTINGS);
        if let Ok(text) = std::fs::read_to_string(&file) {
            let before: Settings = serde_json::from_str(&text)
                .with_context(|| format!("{} is not of a calibration; choose another --folder", file.display()))?;
            if let Some(what) = settings.difference(&before) {
                return Err(CalibrateError::OtherCalibration { path: file, what }.into());
            }
        } else {
            if path.read_dir().is_ok_and(|mut files| files.next().is_some()) {
                return Err(CalibrateError::OtherFolder(path.into()).into());
            }
            std::fs::create_dir_all(path).with_context(|| format!("cannot make the folder {}", path.display()))?;
            let text = serde_json::to_string_pretty(settings)? + "\n";
            output_file::write_all(&[(&file, text.as_bytes())])?;
        }
        Ok(Self { path: path.into() })
    }

    /// A file in it.
    pub(super) fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    fn look_file(&self, look: usize) -> PathBuf {
        self.file(&format!("look-{:02}.csv", look + 1))
    }

    /// The rows of a look, counted from 0; `None` where it is not complete.
    pub(super) fn look(&self, look: usize) -> anyhow::Result<Option<Vec<Sample>>> {
        samples(&self.look_file(look))
    }

    /// What was measured at the frames; `None` where it was not.
    pub(super) fn frames(&self) -> anyhow::Result<Option<Vec<Sample>>> {
        samples(&self.file(FRAMES))
    }

    /// Keeps what was measured at the frames; what is read of it again.
    pub(super) fn keep_frames(&self, samples: Vec<Sample>) -> anyhow::Result<Vec<Sample>> {
        let text = write_text(&Run { samples, ..Run::default() });
        output_file::write_all(&[(&self.file(FRAMES), text.as_bytes())])?;
        self.frames()?.context("the frames were written")
    }

    /// Keeps the rows of a complete look; what is read of them again.
    pub(super) fn keep_look(&self, look: usize, samples: Vec<Sample>) -> anyhow::Result<Vec<Sample>> {
        let text = write_text(&Run { samples, ..Run::default() });
        output_file::write_all(&[(&self.look_file(look), text.as_bytes())])?;
        self.look(look)?.context("the look was written")
    }

    /// Keeps all rows in one file.
    pub(super) fn keep_run(&self, run: &Run) -> anyhow::Result<()> {
        output_file::write_all(&[(&self.file(RUN), write_text(run).as_bytes())])
    }

    /// Keeps the page of the diagnosis of all rows, with what to do next.
    pub(super) fn keep_report(&self, diagnosis: &Diagnosis, next: &str, arm: &Path) -> anyhow::Result<()> {
        let page = diagnose::page(diagnosis, next, arm, &self.file(RUN))?;
        output_file::write_all(&[(&self.file(REPORT), page.as_bytes())])
    }

    /// Keeps an arm.
    pub(super) fn keep_arm(&self, name: &str, arm: &Arm) -> anyhow::Result<PathBuf> {
        let path = self.file(name);
        arm.write(&path)?;
        Ok(path)
    }

    /// Keeps the table of frames with their visit file; the table's name.
    pub(super) fn keep_words(
        &self,
        arm: &Arm,
        profile: &BoardProfile,
        frames: &[DesiredFrame],
        dwell_s: f64,
    ) -> anyhow::Result<PathBuf> {
        let visit = |frame: &DesiredFrame| PlannedVisit {
            visit: Visit { word: frame.word, servos_rad: frame.servos_rad.clone(), dwell_s, label: frame.name.clone() },
            held_out: false,
        };
        let planned: Vec<PlannedVisit> = frames.iter().map(visit).collect();
        let table = VisitTable { arm, profile, device: None, modules: &[], may_rest: false };
        let (plan, visits) = table.of(&planned)?;
        let path = self.file("words.darm");
        let (image, text) = (table_file::bytes(&plan.image), visits.to_text());
        output_file::write_all(&[(&path, &image), (&visits_file(&path), text.as_bytes())])?;
        Ok(path)
    }
}

/// The rows of a file; `None` where there is none.
fn samples(path: &Path) -> anyhow::Result<Option<Vec<Sample>>> {
    if !path.exists() {
        return Ok(None);
    }
    Ok(Some(poses::read(path, &Default::default(), &Which::default())?.0.samples))
}
