//! How far a diagnosis is, for whoever waits for it, and the request to give it up.
//!
//! A clone is another handle of the same diagnosis. The search looks at it between candidates: once it is given up, no
//! further candidate is tried, and the diagnosis ends with [`Cancelled`](crate::error::DiagnoseError::Cancelled).

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering};

use serde::Serialize;

use crate::error::DiagnoseError;

/// What a diagnosis does at the moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// Reads the files.
    #[default]
    Read,
    /// Prepares the rows and computes residuals and derivatives.
    Prepare,
    /// Searches for effects.
    Select,
    /// Judges what was found.
    Judge,
}

const STAGES: [Stage; 4] = [Stage::Read, Stage::Prepare, Stage::Select, Stage::Judge];

/// A handle on a running diagnosis.
#[derive(Clone, Debug, Default)]
pub struct Progress(Arc<State>);

#[derive(Debug, Default)]
struct State {
    stage: AtomicU8,
    tried: AtomicUsize,
    is_cancelled: AtomicBool,
}

impl Progress {
    /// What the diagnosis does.
    pub fn stage(&self) -> Stage {
        STAGES[usize::from(self.0.stage.load(Ordering::Relaxed))]
    }

    /// How many models were tried so far.
    pub fn n_tried(&self) -> usize {
        self.0.tried.load(Ordering::Relaxed)
    }

    /// Gives the diagnosis up.
    pub fn cancel(&self) {
        self.0.is_cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether it is given up.
    pub fn is_cancelled(&self) -> bool {
        self.0.is_cancelled.load(Ordering::Relaxed)
    }

    /// Begins a stage.
    pub(crate) fn enter(&self, stage: Stage) -> Result<(), DiagnoseError> {
        self.0.stage.store(stage as u8, Ordering::Relaxed);
        self.check()
    }

    /// An error once the diagnosis is given up.
    pub(crate) fn check(&self) -> Result<(), DiagnoseError> {
        if self.is_cancelled() { Err(DiagnoseError::Cancelled) } else { Ok(()) }
    }

    /// Counts models that were tried.
    pub(crate) fn add_tried(&self, models: usize) {
        self.0.tried.fetch_add(models, Ordering::Relaxed);
    }
}
