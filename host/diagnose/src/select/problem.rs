//! What forward selection asks of a regression problem: which effects may be added, and how well a model with one predicts.
//!
//! The selection does not know what was measured. A problem is a set of tool poses ([`tool_pose`](super::tool_pose)) or a
//! set of signals whose residuals are linear in what may be missing, near the model ([`signals`](super::signals)).

use std::cmp::Ordering;
use std::fmt::Debug;
use std::sync::Arc;

use serde::Serialize;

use super::significance::LossReduction;
use crate::effect::{Law, Place, as_str};

/// How a selection proceeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Policy {
    /// The most effects that a model holds.
    pub max_effects: usize,
    /// Whether laws overlap: another candidate than the best may then be the one that is added, and an effect selected
    /// before stays as long as it is worth anything.
    pub laws_overlap: bool,
    /// Whether a selected effect may be exchanged for another when none can be added.
    pub exchanges: bool,
}

/// Which candidate it is: a law at one place, or at several together.
#[derive(Clone, Debug, Serialize)]
pub struct CandidateName {
    /// The law.
    #[serde(serialize_with = "as_str")]
    pub law: Law,
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
    /// How rows and axes are weighted: losses are comparable under one weighting only.
    type Weighting: Debug;
    /// A model from which those with one effect more or less are computed.
    type Neighbours<'a>: Neighbours<Self>
    where
        Self: 'a;
    /// Why there is no prediction.
    type Error;

    /// How the selection proceeds.
    fn policy(&self) -> Policy;

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
    fn neighbours<'a>(&'a self, model: &'a Trial<Self>) -> Self::Neighbours<'a>;

    /// A trial fitted in full.
    ///
    /// # Errors
    ///
    /// The model cannot predict a row.
    fn refitted(&self, trial: &Trial<Self>) -> Result<Trial<Self>, Self::Error>;

    /// By how much one model predicts rows that its fit has not seen better than another does.
    fn loss_reduction(&self, before: &Trial<Self>, after: &Trial<Self>) -> LossReduction;
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
    /// Cross-validated residuals, in units of the noise.
    pub predicted: Vec<f64>,
    /// Their loss.
    pub loss: Loss<P::Weighting>,
    /// Cross-validated error, root mean square, in the unit of the problem's norm.
    pub error: f64,
}

impl<P: RegressionProblem> Clone for Trial<P> {
    fn clone(&self) -> Self {
        Self {
            effect: self.effect.clone(),
            fit: self.fit.clone(),
            predicted: self.predicted.clone(),
            loss: self.loss.clone(),
            error: self.error,
        }
    }
}

impl<P: RegressionProblem> Trial<P> {
    /// The weighting that the loss was computed under.
    pub fn weighting(&self) -> &Arc<P::Weighting> {
        &self.loss.weighting
    }
}

/// A loss under a weighting. Losses under different weightings have no order.
#[derive(Debug)]
pub struct Loss<W> {
    value: f64,
    weighting: Arc<W>,
}

impl<W> Clone for Loss<W> {
    fn clone(&self) -> Self {
        Self { value: self.value, weighting: Arc::clone(&self.weighting) }
    }
}

impl<W> Loss<W> {
    /// A loss under this weighting.
    pub fn new(value: f64, weighting: &Arc<W>) -> Self {
        Self { value, weighting: Arc::clone(weighting) }
    }

    /// The same loss under a weighting that differs by no more than its tolerance.
    pub fn under(self, weighting: &Arc<W>) -> Self {
        Self { weighting: Arc::clone(weighting), ..self }
    }

    /// Which of two losses under the same weighting is lower.
    ///
    /// # Panics
    ///
    /// The weightings differ.
    pub fn order(&self, other: &Self) -> Ordering {
        assert!(Arc::ptr_eq(&self.weighting, &other.weighting), "losses under different weightings are compared");
        self.value.total_cmp(&other.value)
    }

    /// By how much this loss is lower than another under the same weighting.
    ///
    /// # Panics
    ///
    /// The two losses are under different weightings.
    pub fn below(&self, other: &Self) -> f64 {
        assert!(Arc::ptr_eq(&self.weighting, &other.weighting), "losses under different weightings are compared");
        other.value - self.value
    }
}
