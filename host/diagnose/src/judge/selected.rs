//! A model that was selected, with what it was selected from: what the judgement and the report read.

use darm_arm::arm::Arm;
use darm_core::effect::Effect;

use crate::agreement::Agreement;
use crate::linearise::experiment::Candidate;
use crate::prepare::repeatability::PoseRepeatability;
use crate::select::forward::SelectionStep;
use crate::select::poses::ToolPoses;
use crate::select::problem::Trial;
use crate::select::signals::Signals;
use darm_measure::{Finding, Run};

/// A model of tool poses that was selected.
#[derive(Clone, Copy)]
pub(crate) struct SelectedPoses<'a> {
    /// The arm that was diagnosed.
    pub(crate) arm: &'a Arm,
    /// Its measurement.
    pub(crate) run: &'a Run,
    /// The rows.
    pub(crate) problem: &'a ToolPoses,
    /// The scatter of repeats, however few.
    pub(crate) repeatability: Option<&'a PoseRepeatability>,
    /// The model with the effects selected.
    pub(crate) best: &'a Trial<ToolPoses>,
    /// How the run agrees with the arm before them.
    pub(crate) agreement: &'a Agreement,
}

impl SelectedPoses<'_> {
    /// How many effects the arm had before.
    pub(crate) fn n_known(&self) -> usize {
        self.arm.model.effects.len()
    }

    /// The noise of repeats, where there are enough of them.
    pub(crate) fn repeats(&self) -> Option<&PoseRepeatability> {
        self.repeatability.filter(|noise| noise.is_known())
    }

    /// The effects selected.
    pub(crate) fn effects(&self) -> Vec<Effect<f64>> {
        self.best.fit.model.effects.iter().skip(self.n_known()).copied().collect()
    }
}

/// A model of signals that was selected.
pub(crate) struct SelectedSignals {
    /// The rows and candidates.
    pub(crate) problem: Signals,
    /// The model with the effects selected.
    pub(crate) best: Trial<Signals>,
    /// How many of its effects were in it from the start.
    pub(crate) n_known: usize,
    /// Candidates that fit best with sizes which cannot be; the model is without them.
    pub(crate) impossible: Vec<usize>,
    /// Candidates that the user rejected; the problem is without them.
    pub(crate) rejected: Vec<Candidate>,
    /// What was tried.
    pub(crate) path: Vec<SelectionStep>,
    /// How the table agrees with the model before any effect is added.
    pub(crate) agreement: Agreement,
    /// How the rows were chosen that the fit did not see.
    pub(crate) held_out: String,
    /// What was found in the table.
    pub(crate) findings: Vec<Finding>,
}

impl SelectedSignals {
    /// A candidate of the model.
    pub(crate) fn candidate(&self, order: usize) -> &Candidate {
        &self.problem.experiment.candidates[self.best.fit.active[order]]
    }

    /// How many effects were added to the model.
    pub(crate) fn n_found(&self) -> usize {
        self.best.fit.active.len() - self.n_known
    }
}
