//! How far a diagnosis is, for whoever waits for it, and the request to give it up.
//!
//! A clone is another handle of the same diagnosis. Whatever takes long asks `Progress::check` before each piece of its work: the
//! equations of a fold on an axis, a model, a hypothesis, a candidate. Once the diagnosis is given up the answer is
//! [`Cancelled`], an error like another: what is half computed is never taken for a result, and nobody can forget to ask how a
//! piece ended. A piece takes below a tenth of a second for a log of six joints and 1500 rows; a fit of tool poses is one piece.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering};

use serde::Serialize;

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

/// Whoever waited for a diagnosis has given it up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the diagnosis was given up; start it again")]
pub struct Cancelled;

/// A handle on a running diagnosis.
#[derive(Clone, Debug, Default)]
pub struct Progress(Arc<State>);

#[derive(Debug, Default)]
struct State {
    stage: AtomicU8,
    tried: AtomicUsize,
    is_cancelled: AtomicBool,
    /// How often it was asked.
    #[cfg(test)]
    checks: AtomicUsize,
    /// The check that gives it up.
    #[cfg(test)]
    last: Option<usize>,
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
    pub(crate) fn enter(&self, stage: Stage) -> Result<(), Cancelled> {
        self.0.stage.store(stage as u8, Ordering::Relaxed);
        self.check()
    }

    /// An error once the diagnosis is given up.
    pub(crate) fn check(&self) -> Result<(), Cancelled> {
        #[cfg(test)]
        if Some(self.0.checks.fetch_add(1, Ordering::Relaxed) + 1) == self.0.last {
            self.cancel();
        }
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }

    /// A diagnosis that is given up at its n-th check.
    #[cfg(test)]
    pub(crate) fn until_check(n: usize) -> Self {
        Self(Arc::new(State { last: Some(n), ..State::default() }))
    }

    /// How often it was asked.
    #[cfg(test)]
    pub(crate) fn n_checks(&self) -> usize {
        self.0.checks.load(Ordering::Relaxed)
    }

    /// Counts models that were tried.
    pub(crate) fn add_tried(&self, models: usize) {
        self.0.tried.fetch_add(models, Ordering::Relaxed);
    }
}
