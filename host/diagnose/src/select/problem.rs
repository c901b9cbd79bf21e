//! What the search asks of a kind of observation: which effects may be there, and how well a model with one predicts.
//!
//! The search itself, its tests and its ladder do not know what was observed. A kind is a tool pose of an arm of words
//! ([`tool_pose`](crate::select::tool_pose)), or a table of channels whose residuals are linear in what may be missing, near
//! where the model stands ([`channels`](crate::signals)).

use std::fmt::Debug;

use crate::select::significance::Fall;

/// A kind of observation, with its rows and its model.
pub trait Kind {
    /// One effect: a law at a place.
    type Effect: Clone + Debug;
    /// A model with effects in it, fitted to all rows that a fit may see.
    type Fit: Clone + Debug;
    /// Why there is no prediction.
    type Error;

    /// How many effects the model has.
    fn n_effects(&self, fit: &Self::Fit) -> usize;

    /// How many values the fit determined.
    fn n_values(&self, fit: &Self::Fit) -> usize;

    /// The most effects that a model holds.
    fn most(&self) -> usize;

    /// Whether laws overlap, so that another than the best may be the one that proves itself.
    fn overlaps(&self) -> bool {
        false
    }

    /// Whether an effect found may give its place to another when nothing more can be added: where laws overlap.
    fn exchanges(&self) -> bool {
        false
    }

    /// The law and the place of an effect.
    fn name(&self, effect: &Self::Effect) -> (&'static str, String);

    /// Brings what depends on the model up to where it stands now, and judges it.
    fn settled(&mut self, current: Trial<Self>) -> Result<Trial<Self>, Self::Error>;

    /// Every effect that is not in the model yet, beside those that are, as far as a linear fit can tell.
    fn screened(&mut self, current: &Trial<Self>) -> Result<Vec<Trial<Self>>, Self::Error>;

    /// A trial fitted in full.
    fn refined(&mut self, trial: &Trial<Self>) -> Result<Trial<Self>, Self::Error>;

    /// The model without one of its effects, fitted anew.
    fn without(&mut self, best: &Trial<Self>, dropped: usize) -> Result<Trial<Self>, Self::Error>;

    /// By how much one model predicts unseen rows better than another.
    fn fall(&self, before: &Trial<Self>, after: &Trial<Self>) -> Fall;

    /// Whether rows that take part in nothing else agree.
    fn confirmed(&mut self, without: &Trial<Self>, with: &Trial<Self>) -> Result<bool, Self::Error>;
}

/// One model tried: an effect beside those that a model has.
#[derive(Debug)]
pub struct Trial<K: Kind + ?Sized> {
    /// The effect; `None` of the model that the search starts from.
    pub effect: Option<K::Effect>,
    /// The model with it.
    pub fit: K::Fit,
    /// Cross-validated residuals.
    pub predicted: Vec<f64>,
    /// Their loss.
    pub loss: f64,
    /// Cross-validated error, root mean square, in the unit of the kind.
    pub error: f64,
}

impl<K: Kind + ?Sized> Clone for Trial<K> {
    fn clone(&self) -> Self {
        Self {
            effect: self.effect.clone(),
            fit: self.fit.clone(),
            predicted: self.predicted.clone(),
            loss: self.loss,
            error: self.error,
        }
    }
}
