//! How a log is diagnosed with a model: the options that say so, and the diagnosis.

use std::io::Write as _;
use std::path::Path;

use anyhow::Context as _;
use darm_arm::arm::Arm;
use darm_diagnose::correction::Keep;
use darm_diagnose::diagnosis::SignalOptions;
use darm_diagnose::error::DiagnoseError;
use darm_diagnose::files::{FileOptions, Files, Subject};
use darm_diagnose::outcome::Diagnosis;
use darm_diagnose::overview::{self, Overview};
use darm_diagnose::rejection::Rejection;
use darm_measure::Finding;
use darm_robot::source::{ModelKind, Source};

use super::super::subject::Part;
use super::rows::RowOptions;
use crate::failure::Usage;
use crate::ui::Ui;

/// How a log is diagnosed, whatever is made of it.
#[derive(clap::Args, Debug)]
pub(in crate::commands) struct DiagnoseOptions {
    /// Accept a recording of the table of another arm file
    #[arg(long, requires = "model")]
    other_model: bool,
    /// Exclude an effect, with the reason; can be repeated
    #[arg(long = "reject", value_name = "LAW, PLACE: REASON", requires = "model")]
    rejected: Vec<Rejection>,
    /// Seed of the cross-validation
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Fix a joint of the robot that the data do not have at a position, in deg or mm
    #[arg(long = "lock", value_name = "JOINT=Q", allow_hyphen_values = true, requires = "model")]
    locks: Vec<String>,
    /// Read one tree of a URDF or MJCF: the one that begins with this link or body
    #[arg(long, value_name = "BODY", requires = "model")]
    root: Option<String>,
    #[command(flatten)]
    rows: RowOptions,
}

/// What is diagnosed.
#[derive(Clone, Copy)]
pub(in crate::commands) struct Task<'a> {
    pub(in crate::commands) model: &'a Path,
    pub(in crate::commands) data: &'a Path,
    /// The corrected model, where one is wanted.
    pub(in crate::commands) new_model: Option<NewModel<'a>>,
}

/// Where a corrected model is written, and what of the diagnosis it keeps.
#[derive(Clone, Copy)]
pub(in crate::commands) struct NewModel<'a> {
    pub(in crate::commands) path: &'a Path,
    pub(in crate::commands) keep: Keep,
}

impl DiagnoseOptions {
    /// What the log has.
    pub(super) fn overview(&self, data: &Path) -> anyhow::Result<Result<Overview, DiagnoseError>> {
        let SignalOptions { preparation, .. } = self.rows.options(self.seed, &self.rejected)?;
        Ok(overview::overview(data, &self.rows.names()?, &preparation))
    }

    /// Asks about units that look wrong; what a file that cannot be read is, is for the diagnosis to say.
    pub(super) fn ask(&self, data: &Path, ui: Ui) -> anyhow::Result<Vec<Finding>> {
        let questions = overview::questions(data, &self.rows.names()?).unwrap_or_default();
        questions.iter().for_each(|question| ui.note(&format!("question: {question}")));
        Ok(questions)
    }

    /// The diagnosis, and whether a corrected model was written.
    pub(in crate::commands) fn diagnose(&self, task: Task, ui: Ui) -> anyhow::Result<(Diagnosis, bool)> {
        let Task { model, data, new_model } = task;
        let part = Part { locks: &self.locks, root: self.root.as_deref() };
        let source = Source::read::<String>(model)?;
        let subject = match source.kind() {
            ModelKind::Robot | ModelKind::Experiment => {
                let (model, chosen) = part.model_of(&source)?;
                Subject::Signals(Box::new(model), chosen)
            }
            ModelKind::Arm if !self.locks.is_empty() || self.root.is_some() => {
                return Err(Usage("--lock and --root need a robot, not an arm file".into()).into());
            }
            ModelKind::Arm => {
                self.rows.refuse_those_of_signals()?;
                Subject::Arm(Box::new(Arm::of_source(&source)?))
            }
        };
        let how = FileOptions {
            names: self.rows.names()?,
            rows: self.rows.options(self.seed, &self.rejected)?,
            accepts_other_model: self.other_model,
        };
        let spinner = ui.spinner("diagnosing");
        let found = Files { model: model.into(), data: data.into() }.diagnose(subject, &how);
        spinner.finish_and_clear();
        let (found, mut is_written) = (found?, false);
        if let Some(NewModel { path, keep }) = new_model {
            is_written = found.write_corrected(path, keep)?.is_some();
            if is_written {
                append_rejected(path, &self.rejected).with_context(|| format!("cannot write {}", path.display()))?;
            }
        }
        Ok((found.diagnosis, is_written))
    }
}

/// Appends what was rejected to a model file, as comments.
fn append_rejected(path: &Path, rejected: &[Rejection]) -> std::io::Result<()> {
    let lines = rejected.iter().map(|rejection| format!("# Rejected by the user: {rejection}\n"));
    let lines: String = lines.collect();
    if lines.is_empty() { Ok(()) } else { write!(std::fs::OpenOptions::new().append(true).open(path)?, "\n{lines}") }
}
