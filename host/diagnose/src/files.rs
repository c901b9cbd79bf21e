//! The diagnosis of two files, a model and measurements, and the file of the corrected model.

use std::path::Path;

use darm_arm::arm::{Arm, ArmError};

use darm_robot::files::FileRef;
use darm_robot::source::{ModelKind, Source};
use darm_robot::urdf::Selection;

use crate::correction::{ArmCorrection, Keep, SignalCorrection};
use crate::diagnosis::{PoseOptions, SignalOptions, diagnose, diagnose_file};
use crate::error::DiagnoseError;
use crate::linearise::model::{Model, ModelError};
use crate::model_file::{Chosen, ModelFile};
use crate::outcome::Diagnosis;
use darm_measure::origin::{Origin, OtherModel};
use darm_measure::poses::{self, Which};
use darm_measure::table::Names;
use darm_measure::{ReadError, Run, about};

/// A model and measurements of what it describes.
#[derive(Clone, Debug)]
pub struct Files<'a> {
    /// The file of the model: an arm file, a robot's file, or a TOML file that names its kind.
    pub model: FileRef<'a>,
    /// The measurements: CSV, compressed or not, or MCAP.
    pub data: FileRef<'a>,
}

/// What the file of a model describes.
#[derive(Clone, Debug)]
pub enum Subject {
    /// An arm of words: its tool poses are diagnosed.
    Arm(Box<Arm>),
    /// Another model, with what was chosen of its robot besides what its file says: its signals are diagnosed.
    Signals(Box<Model>, Chosen),
}

/// How files are diagnosed.
#[derive(Clone, Debug, Default)]
pub struct FileOptions {
    /// What columns hold whose own names do not say it.
    pub names: Names,
    /// Which rows count and which are held out; the other options are for signals.
    pub rows: SignalOptions,
    /// Whether a recording of the table of another arm is diagnosed all the same.
    pub accepts_other_model: bool,
}

/// A diagnosis, and what its corrected model is made from.
#[derive(Clone, Debug)]
pub struct FileDiagnosis {
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    correction: Correction,
}

#[derive(Clone, Debug)]
enum Correction {
    Arm(Box<(Arm, Run, ArmCorrection)>),
    Signals(ModelFile, SignalCorrection),
}

/// Why files give no diagnosis, or why no corrected model is written.
#[derive(Debug, thiserror::Error)]
pub enum FilesError {
    /// The model cannot be read, or the corrected one not be written.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The arm cannot be read, or the corrected one not be written.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// The measurements cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The measurements are of another arm.
    #[error(transparent)]
    OtherModel(#[from] OtherModel),
    /// There is no diagnosis.
    #[error("{place}")]
    Diagnose {
        /// The file of the measurements, and the line where the error is in one row.
        place: String,
        /// Why.
        source: DiagnoseError,
    },
}

impl Subject {
    /// Reads the file of a model.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or describes no model.
    pub fn read<'a>(file: impl Into<FileRef<'a>>) -> Result<Self, FilesError> {
        let source = Source::read(file).map_err(FilesError::Model)?;
        Ok(match source.kind() {
            ModelKind::Robot | ModelKind::Experiment => {
                Self::Signals(Box::new(Model::of_source(&source, &Selection::default())?), Chosen::default())
            }
            ModelKind::Arm => Self::Arm(Box::new(Arm::of_source(&source)?)),
        })
    }
}

impl Files<'_> {
    /// What the measurements say about what the model is missing.
    ///
    /// # Errors
    ///
    /// The measurements cannot be read, are of another arm, or give no diagnosis.
    pub fn diagnose(self, subject: Subject, how: &FileOptions) -> Result<FileDiagnosis, FilesError> {
        match subject {
            Subject::Arm(arm) => self.poses(*arm, how),
            Subject::Signals(model, chosen) => self.signals(&model, &chosen, how),
        }
    }

    fn signals(self, model: &Model, chosen: &Chosen, how: &FileOptions) -> Result<FileDiagnosis, FilesError> {
        let found = diagnose_file(model, &self.data, &how.names, &how.rows);
        let found = found.map_err(|error| self.in_data(error))?;
        let file = ModelFile::read(&self.model, found.diagnosis.kind)?.with(chosen);
        Ok(FileDiagnosis { diagnosis: found.diagnosis, correction: Correction::Signals(file, found.correction) })
    }

    fn poses(self, arm: Arm, how: &FileOptions) -> Result<FileDiagnosis, FilesError> {
        let rows = &how.rows;
        let which = Which { keep: rows.preparation.keep.clone(), hold_out: rows.preparation.hold_out.clone() };
        let (run, read) = poses::read(&self.data, &how.names, &which)?;
        let origin = match Origin::find(&about(&self.data)?) {
            Some(origin) if !how.accepts_other_model && !origin.fits(&arm) => {
                return Err(origin.refusal(self.data.path, self.model.path, &arm).into());
            }
            origin => origin.and_then(|origin| origin.finding(&arm)),
        };
        let options = PoseOptions {
            seed: rows.seed,
            rejected: rows.rejected.clone(),
            progress: rows.progress.clone(),
            ..PoseOptions::default()
        };
        let found = diagnose(&arm, &run, &options).map_err(|error| self.in_data(error))?;
        let findings = read.into_iter().chain(origin).chain(found.diagnosis.findings).collect();
        let diagnosis = Diagnosis { findings, ..found.diagnosis };
        Ok(FileDiagnosis { diagnosis, correction: Correction::Arm(Box::new((arm, run, found.correction))) })
    }

    fn in_data(&self, error: DiagnoseError) -> FilesError {
        let file = self.data.path.display();
        let place = error.line().map_or(file.to_string(), |line| format!("{file}:{line}"));
        FilesError::Diagnose { place, source: error }
    }
}

impl FileDiagnosis {
    /// Writes the model with the effects that were found, and its number, the next one; `None` where there is nothing to
    /// add.
    ///
    /// # Errors
    ///
    /// The file cannot be written, or the robot's file that the model names is not there.
    pub fn write_corrected(&self, output: &Path, keep: Keep) -> Result<Option<u64>, FilesError> {
        Ok(match &self.correction {
            Correction::Arm(_) => match self.corrected_arm(keep) {
                Some(arm) => {
                    arm.write(output)?;
                    Some(u64::from(arm.model.number))
                }
                None => None,
            },
            Correction::Signals(file, correction) => match correction.corrected(file, &self.diagnosis, keep) {
                Some(model) => {
                    model.write(output)?;
                    Some(model.number())
                }
                None => None,
            },
        })
    }

    /// The corrected model as a text, for a file beside that of the model, with its number.
    pub fn corrected_text(&self, keep: Keep) -> Option<(u64, String)> {
        match &self.correction {
            Correction::Arm(_) => {
                let arm = self.corrected_arm(keep)?;
                Some((arm.model.number.into(), arm.to_toml()))
            }
            Correction::Signals(file, correction) => {
                let model = correction.corrected(file, &self.diagnosis, keep)?;
                Some((model.number(), model.text()))
            }
        }
    }

    /// The arm that was diagnosed; `None` of another model.
    pub fn arm(&self) -> Option<&Arm> {
        match &self.correction {
            Correction::Arm(parts) => Some(&parts.0),
            Correction::Signals(..) => None,
        }
    }

    /// The arm with the effects that were found; `None` of another model, and where there is nothing to add.
    pub fn corrected_arm(&self, keep: Keep) -> Option<Arm> {
        let Correction::Arm(parts) = &self.correction else { return None };
        let (arm, run, correction) = &**parts;
        correction.corrected(arm, run, keep)
    }
}
