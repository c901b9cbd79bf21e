//! What forward selection asks of a regression problem: which effects may be added, and how well a model with one predicts.
//!
//! The selection does not know what was measured. A problem is a set of tool poses ([`poses`](super::poses)) or a
//! set of signals whose residuals are linear in what may be missing, near the model ([`signals`](super::signals)).

use std::fmt::Debug;
use std::sync::Arc;

use serde::Serialize;

use super::significance::LossReduction;
use crate::effect::{LawName, Place, as_str};
use crate::progress::{Cancelled, Progress};

/// How a selection proceeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Policy {
    /// The most effects that a model holds.
    pub max_effects: usize,
    /// Whether laws overlap: another candidate than the best may then be the one that is added, and an effect selected
    /// before stays as long as it is worth anything.
    pub laws_overlap: bool,
    /// Whether a selected effect may be exchanged for another when none can be added.
    pub exchanges: bool,
    /// Chance to discover any effect, of all that are tried, where there is none.
    pub discovery_level: f64,
    /// A candidate worse than an effect so that chance is less than this is not its rival.
    pub rival_level: f64,
}

/// Which candidate it is: a law at one place, or at several together.
#[derive(Clone, Debug, Serialize)]
pub struct CandidateName {
    /// The law.
    #[serde(serialize_with = "as_str")]
    pub law: LawName,
    /// Where it acts.
    #[serde(skip)]
    pub places: Vec<Place>,
    /// The number that the law has and no fit changes.
    #[serde(skip)]
    pub constant: Option<f64>,
    /// Places and constant as text.
    #[serde(rename = "where")]
    pub text: String,
}

impl PartialEq for CandidateName {
    fn eq(&self, other: &Self) -> bool {
        (self.law, &self.places, self.constant) == (other.law, &other.places, other.constant)
    }
}

/// Rows, a model and the effects that it may be missing.
pub trait RegressionProblem: Sized {
    /// One candidate: a law at a place.
    type Effect: Clone + Debug;
    /// A model with effects in it, fitted to all training rows.
    type Fit: Clone + Debug;
    /// How rows and axes count, where that depends on the model; `()` where the problem gives it.
    type Weighting: Debug;
    /// A model from which those with one effect more or less are computed.
    type Neighbours<'a>: Neighbours<Self>
    where
        Self: 'a;
    /// Why there is no prediction, or that the selection was given up.
    type Error: From<Cancelled>;

    /// How the selection proceeds.
    fn policy(&self) -> Policy;

    /// How far the selection is, and whether it is given up.
    fn progress(&self) -> &Progress;

    /// How many effects the model has.
    fn n_effects(&self, fit: &Self::Fit) -> usize;

    /// How many values the fit determined.
    fn n_values(&self, fit: &Self::Fit) -> usize;

    /// The law and the place of a candidate.
    fn name(&self, effect: &Self::Effect) -> CandidateName;

    /// The model under the weighting that its own residuals give, fitted again until both agree (IRLS).
    ///
    /// # Errors
    ///
    /// The model cannot predict a row.
    fn reweight_until_converged(&self, model: Trial<Self>) -> Result<Trial<Self>, Self::Error>;

    /// The model, ready for its neighbours.
    ///
    /// # Errors
    ///
    /// The selection was given up.
    fn neighbours<'a>(&'a self, model: &'a Trial<Self>) -> Result<Self::Neighbours<'a>, Self::Error>;

    /// A trial fitted in full.
    ///
    /// # Errors
    ///
    /// The model cannot predict a row.
    fn refitted(&self, trial: &Trial<Self>) -> Result<Trial<Self>, Self::Error>;

    /// The loss of residuals of rows that no fit has seen, in their units, under a weighting.
    fn loss(&self, weighting: &Self::Weighting, unseen: &[f64]) -> Loss;

    /// By how much the residuals `after` of rows that no fit has seen are less than those `before`.
    fn loss_reduction(&self, weighting: &Self::Weighting, before: &[f64], after: &[f64]) -> LossReduction;

    /// The problem under the weighting of a model.
    fn under<'a>(&'a self, model: &'a Trial<Self>) -> Weighted<'a, Self> {
        Weighted { problem: self, weighting: &model.weighting }
    }
}

/// The models around one model.
pub trait Neighbours<P: RegressionProblem> {
    /// The models with one more effect each, fitted linearly.
    ///
    /// # Errors
    ///
    /// A model cannot predict a row.
    fn with_one_more(&self) -> Result<Vec<Trial<P>>, P::Error>;

    /// The model without one of its effects, fitted.
    ///
    /// # Errors
    ///
    /// The model cannot predict a row.
    fn with_one_less(&self, effect: usize) -> Result<Trial<P>, P::Error>;
}

/// One model that was tried.
#[derive(Debug)]
pub struct Trial<P: RegressionProblem> {
    /// The effect that was added; `None` of the model that the selection starts from.
    pub effect: Option<P::Effect>,
    /// The model with it.
    pub fit: P::Fit,
    /// Cross-validated residuals: each as a fit that has not seen its row leaves it.
    pub unseen_residuals: Vec<f64>,
    /// How rows and axes counted in its fit.
    pub weighting: Arc<P::Weighting>,
    /// Cross-validated error, root mean square, in the unit of the problem's norm.
    pub error: f64,
}

impl<P: RegressionProblem> Clone for Trial<P> {
    fn clone(&self) -> Self {
        Self {
            effect: self.effect.clone(),
            fit: self.fit.clone(),
            unseen_residuals: self.unseen_residuals.clone(),
            weighting: Arc::clone(&self.weighting),
            error: self.error,
        }
    }
}

/// A loss. It has no order: only [`Weighted`] one weighting are losses compared.
#[derive(Clone, Copy, Debug)]
pub struct Loss(f64);

impl Loss {
    /// A loss of this size.
    pub fn new(size: f64) -> Self {
        Self(size)
    }
}

/// A problem under one weighting: models are compared under it, whatever weighting they were fitted under.
#[derive(Debug)]
pub struct Weighted<'a, P: RegressionProblem> {
    /// The problem.
    pub problem: &'a P,
    /// The weighting.
    pub weighting: &'a Arc<P::Weighting>,
}

impl<P: RegressionProblem> Clone for Weighted<'_, P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<P: RegressionProblem> Copy for Weighted<'_, P> {}

impl<P: RegressionProblem> Weighted<'_, P> {
    fn loss(&self, trial: &Trial<P>) -> f64 {
        self.problem.loss(self.weighting, &trial.unseen_residuals).0
    }

    /// Whether one model's loss is lower than another's.
    pub fn is_lower(&self, one: &Trial<P>, other: &Trial<P>) -> bool {
        self.loss(one) < self.loss(other)
    }

    /// By how much the loss of the model `after` is lower than that of the model `before`.
    pub fn gain(&self, before: &Trial<P>, after: &Trial<P>) -> f64 {
        self.loss(before) - self.loss(after)
    }

    /// The models with the lowest loss first.
    pub fn sorted(&self, trials: Vec<Trial<P>>) -> Vec<Trial<P>> {
        let mut losses: Vec<(f64, Trial<P>)> = trials.into_iter().map(|trial| (self.loss(&trial), trial)).collect();
        losses.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        losses.into_iter().map(|(_, trial)| trial).collect()
    }

    /// The element whose model has the lowest loss, the first of several.
    ///
    /// # Errors
    ///
    /// That of the first element that has one.
    pub fn lowest<T, E>(
        &self,
        trials: impl IntoIterator<Item = Result<T, E>>,
        trial: impl Fn(&T) -> &Trial<P>,
    ) -> Result<Option<T>, E> {
        let mut lowest: Option<(f64, T)> = None;
        for element in trials {
            let element = element?;
            let loss = self.loss(trial(&element));
            if lowest.as_ref().is_none_or(|(lowest, _)| loss.total_cmp(lowest).is_lt()) {
                lowest = Some((loss, element));
            }
        }
        Ok(lowest.map(|(_, element)| element))
    }

    /// Whether a model predicts rows that no fit has seen better `than` another does: by so much that chance, where it does
    /// not, is less than `level`.
    pub fn predicts_better(&self, better: &Trial<P>, than: &Trial<P>, level: f64) -> bool {
        self.predicts_better_among(better, than, 1, level)
    }

    /// Whether one of `n_tried` models predicts better `than` another, so that chance is less than `level` for all of them
    /// together (Bonferroni).
    pub fn predicts_better_among(&self, better: &Trial<P>, than: &Trial<P>, n_tried: usize, level: f64) -> bool {
        self.reduction(than, better).p * (n_tried as f64) < level
    }

    /// By how much one model predicts rows that its fit has not seen better than another does.
    pub fn reduction(&self, before: &Trial<P>, after: &Trial<P>) -> LossReduction {
        self.problem.loss_reduction(self.weighting, &before.unseen_residuals, &after.unseen_residuals)
    }
}
