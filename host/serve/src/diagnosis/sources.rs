//! What a diagnosis is made from: the files of an upload, or a model that the server has.

use std::fmt;
use std::path::Path;

use darm_diagnose::diagnosis::SignalOptions;
use darm_diagnose::error::{DiagnoseError, sentence};
use darm_diagnose::files::{FileDiagnosis, FileOptions, Files, FilesError, Subject};
use darm_diagnose::progress::Progress;
use darm_measure::ReadError;

use super::{log, models};
use crate::hub::Hub;
use crate::job_queue::Unwanted;
use crate::refusal::{Kind, Refused};
use crate::upload::{Model, Upload};

/// Seed of the cross-validation: that of `darm diagnose`.
const SEED: u64 = 1;

/// An upload with its model.
pub(super) struct Sources<'a> {
    pub(super) upload: &'a Upload<'a>,
    /// Name of the model's file.
    pub(super) model: String,
    /// Its text, where it was not sent.
    known: Option<String>,
}

impl<'a> Sources<'a> {
    /// Finds the model.
    pub(super) fn of(hub: &Hub, upload: &'a Upload<'a>) -> Result<Self, Refused> {
        match &upload.model {
            Model::Sent(name) => Ok(Self { upload, model: name.clone(), known: None }),
            Model::Known(digest) => {
                models::text(hub, digest).map(|known| Self { upload, model: known.name, known: Some(known.text) })
            }
            Model::Missing => Err(Refused::new(Kind::Invalid, "no model; choose one")),
        }
    }

    pub(super) fn model_bytes(&self) -> &[u8] {
        self.known.as_ref().map_or_else(|| self.upload.bytes(&self.model), |text| text.as_bytes())
    }

    /// The diagnosis of the files that were sent, and of no others.
    pub(super) fn diagnose(&self, progress: &Progress) -> Result<FileDiagnosis, Refused> {
        let invalid = |text: String| Refused::new(Kind::Invalid, text);
        let (model, data) = (Path::new(&self.model), Path::new(&self.upload.data));
        let mut sent = self.upload.handed();
        if let Some(text) = &self.known {
            sent = sent.with(model, text.clone().into_bytes());
        }
        let check = || if progress.is_cancelled() { Err(Unwanted) } else { Ok(()) };
        let read = log::readable(&sent.file(data), &self.upload.columns, &check)
            .map_err(|fault| invalid(fault.to_string()))?;
        check()?;
        let how = FileOptions {
            names: read.names,
            rows: SignalOptions { seed: SEED, progress: progress.clone(), ..SignalOptions::default() },
            accepts_other_model: self.upload.accepts_other_model,
        };
        let files = Files { model: sent.file(model), data: read.files.file(&read.data) };
        let subject = Subject::read(&files.model).map_err(|error| match self.missing(&sent) {
            Some(name) => Refused::new(
                Kind::Invalid,
                format!(
                    "{} names {name}, which was not sent; choose it under `Files that the model names`",
                    self.model
                ),
            ),
            None => invalid(without_option(&error)),
        })?;
        files.diagnose(subject, &how).map_err(|error| invalid(without_option(&error)))
    }

    /// A robot that the text of the model names in quotes and that was not sent.
    fn missing(&self, sent: &darm_robot::files::Files) -> Option<&str> {
        let pieces = std::str::from_utf8(self.model_bytes()).ok()?.split(['"', '\'']);
        let mut robots = pieces.filter(|piece| [".urdf", ".xml"].iter().any(|end| piece.ends_with(end)));
        robots.find(|name| !sent.has(Path::new(name)))
    }
}

impl fmt::Display for Sources<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} and {}", self.model, self.upload.data)
    }
}

/// What is wrong, with what to do on the page in place of options of the command line.
fn without_option(error: &FilesError) -> String {
    match error {
        FilesError::Read(ReadError::NoQuantity { path, column, .. })
        | FilesError::Diagnose { source: DiagnoseError::Read(ReadError::NoQuantity { path, column, .. }), .. } => {
            log::no_quantity(path, column)
        }
        FilesError::OtherModel(other) => format!(
            "{} was recorded with a table of model {}, {} is model {} and differs in more than its effects; choose the \
             model of the recording, or accept one of another arm",
            other.data.display(),
            other.recorded,
            other.arm.display(),
            other.given
        ),
        error => sentence(error),
    }
}
