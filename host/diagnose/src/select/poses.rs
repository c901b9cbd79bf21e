//! Tool poses of an arm of discrete actuators: words are left out one after the other, and the held-out words may veto.

mod change_point;
pub mod cross_validation;
pub mod robust_fit;

use std::sync::Arc;

use darm_core::effect::Effect;
use darm_core::model::MAX_EFFECTS;

use self::cross_validation::cross_validated;
use self::robust_fit::{PoseFit, fit};
use super::problem::{CandidateName, Loss, Neighbours, Policy, RegressionProblem, Trial};
use super::significance::{Levels, LossReduction, RIVAL_LEVEL, clustered_t_test};
use crate::effect::Place;
use crate::least_squares::losses;
use crate::linearise::arm_candidates::{self, beginning};
use crate::linearise::sensitivity::Sensitivity;
use crate::prepare::observations::{NoPose, Observations, ValueIndex};
use crate::progress::{Cancelled, Progress};
use darm_arm::arm::{ArmModel, ArmScratch};
use darm_measure::root_mean_square;

/// Held-out rows may not show an effect that is expected to lower their squares by less than this many standard errors: they do
/// not veto it then.
const ERRORS_TO_SHOW: f64 = 4.0;

/// Why there is no model of tool poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoTrial {
    /// It has no pose for a row.
    NoPose(NoPose),
    /// The diagnosis was given up.
    Cancelled,
}

impl From<NoPose> for NoTrial {
    fn from(none: NoPose) -> Self {
        Self::NoPose(none)
    }
}

impl From<Cancelled> for NoTrial {
    fn from(Cancelled: Cancelled) -> Self {
        Self::Cancelled
    }
}

/// Standard deviation of each component of a twist, rad and m.
pub type AxisNoise = [f64; 6];

/// Poses that fits see, and poses that judge.
#[derive(Debug)]
pub struct ToolPoses {
    /// Rows that fits see.
    pub training: Observations,
    /// Rows that judge; may be none.
    pub held_out: Observations,
    /// The fold of each training row.
    pub folds: Vec<usize>,
    /// Candidates that are rejected.
    pub rejected: Vec<Effect<f64>>,
    /// Of the tests.
    pub(crate) levels: Levels,
    progress: Progress,
}

/// The values of all effects of a model.
pub fn values(model: &ArmModel) -> Vec<ValueIndex> {
    let effects = model.effects.iter().enumerate();
    effects.flat_map(|(k, effect)| (0..effect.values().len()).map(move |value| (k, value))).collect()
}

impl ToolPoses {
    /// Training rows with their folds, and held-out rows, both in units of the same noise.
    pub fn new(training: Observations, held_out: Observations, folds: Vec<usize>) -> Self {
        let levels = Levels::default();
        Self { training, held_out, folds, rejected: Vec::new(), levels, progress: Progress::default() }
    }

    /// Sets the levels of the tests.
    pub fn with_levels(self, levels: Levels) -> Self {
        Self { levels, ..self }
    }

    /// Reports to `progress` how far the selection is.
    pub fn with_progress(self, progress: Progress) -> Self {
        Self { progress, ..self }
    }

    /// Excludes these candidates.
    pub(crate) fn without(self, rejected: Vec<Effect<f64>>) -> Self {
        Self { rejected, ..self }
    }

    /// Scales the residuals of all rows by another noise.
    pub fn with_noise(self, sigma: AxisNoise) -> Self {
        let (training, held_out) = (self.training.with_noise(sigma), self.held_out.with_noise(sigma));
        Self { training, held_out, ..self }
    }

    /// A model with all its values fitted in full.
    ///
    /// # Errors
    ///
    /// The model has no pose for a training row, or the diagnosis was given up.
    pub fn fitted(&self, model: &ArmModel) -> Result<Trial<Self>, NoTrial> {
        self.progress.check()?;
        let fit = fit(model, &self.training, &values(model), &mut ArmScratch::default())?;
        let last = fit.model.effects.last().copied();
        let steps = self.steps(&fit)?;
        Ok(self.judged(fit, last, &steps))
    }

    /// The steps among the effects of a model, as cross-validation needs them.
    fn steps(&self, fit: &PoseFit) -> Result<Vec<change_point::FittedStep>, NoPose> {
        if !has_step(&fit.model) {
            return Ok(Vec::new());
        }
        let sensitivity = Sensitivity::new(&fit.model, &self.training, &mut ArmScratch::default())?;
        Ok(steps(fit, &sensitivity))
    }

    /// A candidate by its linear fit; `None` where it changes nothing in these rows.
    fn candidate(
        &self,
        current: &Trial<Self>,
        effect: &Effect<f64>,
        sensitivity: &Sensitivity,
        current_steps: &[change_point::FittedStep],
    ) -> Option<Trial<Self>> {
        let mut model = current.fit.model.clone();
        let new = model.effects.len();
        model.effects.push(*effect).ok()?;
        let mut fit = PoseFit { model, ..current.fit.clone() };
        for value in 0..effect.values().len() {
            if let Some(column) = sensitivity.column(effect, value) {
                fit.values.push((new, value));
                fit.columns.push(column);
            }
        }
        if fit.values.len() == current.fit.values.len() {
            return None;
        }
        let mut steps = current_steps.to_vec();
        steps.extend(step(&fit, new, sensitivity));
        Some(self.judged(fit, Some(*effect), &steps))
    }

    /// A step at the moment that it explains most from, `None` where there is none; any other effect as it is.
    fn timed(&self, effect: &Effect<f64>, residuals: &[f64], sensitivity: &Sensitivity) -> Option<Effect<f64>> {
        let Some(from_the_start) = beginning(effect, f64::NEG_INFINITY) else { return Some(*effect) };
        let values = 0..effect.values().len();
        let always: Vec<_> = values.filter_map(|value| sensitivity.column(&from_the_start, value)).collect();
        let counts = vec![1.0; self.training.rows.len()];
        let since_s = change_point::change_point(&self.training, &always, residuals, &counts)?;
        beginning(effect, since_s)
    }

    /// The model with its steps at the moments that they explain most from, each beside all other effects; `None` where
    /// they are there already.
    fn timed_again(&self, fit: &PoseFit) -> Result<Option<ArmModel>, NoPose> {
        let mut model = fit.model.clone();
        if !has_step(&model) {
            return Ok(None);
        }
        let sensitivity = Sensitivity::new(&fit.model, &self.training, &mut ArmScratch::default())?;
        for (k, effect) in fit.model.effects.iter().enumerate() {
            let Some(step) = step(fit, k, &sensitivity) else { continue };
            let without = step.taken_from(&fit.columns, &fit.residuals);
            model.effects[k] = self.timed(effect, &without, &sensitivity).unwrap_or(*effect);
        }
        Ok((model.effects != fit.model.effects).then_some(model))
    }

    /// Error on rows that no fit saw, held out for good or in turn, as a distance d, root mean square, m.
    ///
    /// # Errors
    ///
    /// The model has no pose for a row that is held out.
    pub fn held_out_m(&self, trial: &Trial<Self>) -> Result<f64, NoPose> {
        if self.held_out.rows.is_empty() {
            return Ok(root_mean_square(&self.training.distances_m(&trial.unseen_residuals)));
        }
        let residuals = self.held_out.residuals(&trial.fit.model, &mut ArmScratch::default())?;
        Ok(root_mean_square(&self.held_out.distances_m(&residuals)))
    }

    /// Whether the error on rows that no fit saw falls by more than its uncertainty: on the held-out ones, or, without any, on
    /// those held out in turn. A row that is far off by both models does not hide it, nor do words that nothing changes.
    /// Held-out rows which the effects change by too little to show it, or in a single word, do not veto what the others show,
    /// unless the error rises there.
    pub(crate) fn held_out_falls(&self, before: &Trial<Self>, after: &Trial<Self>) -> Result<bool, NoPose> {
        let falls_in_turn = self.under(before).predicts_better(after, before, self.levels.confirmation);
        if self.held_out.rows.is_empty() {
            return Ok(falls_in_turn);
        }
        let mut scratch = ArmScratch::default();
        let [before, after] = [before, after].map(|trial| self.held_out.residuals(&trial.fit.model, &mut scratch));
        let (before, after) = (before?, after?);
        let fall = clustered_t_test(&before, &after, &self.held_out.groups());
        // An effect that is there lowers the sum by about the squares of what it changes.
        let change: f64 = before.iter().zip(&after).map(|(before, after)| (before - after).powi(2)).sum();
        let error = fall.error.unwrap_or(0.0);
        let cannot_show = change < ERRORS_TO_SHOW * error || error == 0.0 || fall.dof.is_nan() || fall.dof < 1.0;
        let rises = fall.sum < -error;
        let confirms_in_turn = self.levels.confirms_in_turn && cannot_show && falls_in_turn && !rises;
        Ok(fall.p < self.levels.confirmation || confirms_in_turn)
    }

    fn judged(&self, fit: PoseFit, effect: Option<Effect<f64>>, steps: &[change_point::FittedStep]) -> Trial<Self> {
        let unseen_residuals = cross_validated(&fit.columns, &fit.residuals, &self.training, &self.folds, steps);
        let error = root_mean_square(&self.training.distances_m(&unseen_residuals));
        Trial { effect, fit, unseen_residuals, weighting: Arc::default(), error }
    }
}

fn has_step(model: &ArmModel) -> bool {
    model.effects.iter().any(|effect| beginning(effect, 0.0).is_some())
}

/// The steps among the values of a fit, by the sensitivity of its model.
fn steps(fit: &PoseFit, sensitivity: &Sensitivity) -> Vec<change_point::FittedStep> {
    (0..fit.model.effects.len()).filter_map(|effect| step(fit, effect, sensitivity)).collect()
}

/// An effect of a fit as a step; `None` of one that begins at no moment, or that changes nothing.
fn step(fit: &PoseFit, effect: usize, sensitivity: &Sensitivity) -> Option<change_point::FittedStep> {
    let from_the_start = beginning(&fit.model.effects[effect], f64::NEG_INFINITY)?;
    let own = fit.values.iter().enumerate().filter(|(_, (of, _))| *of == effect);
    let mut step = change_point::FittedStep { values: Vec::new(), always: Vec::new(), sizes: Vec::new() };
    for (value, &(_, number)) in own {
        step.values.push(value);
        step.always.push(sensitivity.column(&from_the_start, number)?);
        step.sizes.push(fit.model.effects[effect].values()[number]);
    }
    (!step.values.is_empty()).then_some(step)
}

/// A model of tool poses, whose neighbours are to be computed.
pub struct PoseNeighbourhood<'a> {
    problem: &'a ToolPoses,
    model: &'a Trial<ToolPoses>,
}

impl Neighbours<ToolPoses> for PoseNeighbourhood<'_> {
    fn with_one_more(&self) -> Result<Vec<Trial<ToolPoses>>, NoTrial> {
        let Self { problem, model } = self;
        let candidates: Vec<Effect<f64>> = arm_candidates::all(&model.fit.model)
            .into_iter()
            .filter(|effect| {
                let mut closed = model.fit.model.effects.iter().chain(&problem.rejected);
                !closed.any(|other| arm_candidates::same(other, effect))
            })
            .collect();
        let sensitivity = Sensitivity::new(&model.fit.model, &problem.training, &mut ArmScratch::default())?;
        let steps = steps(&model.fit, &sensitivity);
        let mut all = Vec::new();
        for effect in &candidates {
            problem.progress.check()?;
            let timed = problem.timed(effect, &model.fit.residuals, &sensitivity);
            all.extend(timed.and_then(|effect| problem.candidate(model, &effect, &sensitivity, &steps)));
        }
        Ok(all)
    }

    fn with_one_less(&self, effect: usize) -> Result<Trial<ToolPoses>, NoTrial> {
        let mut model = self.model.fit.model.clone();
        model.effects.remove(effect);
        self.problem.fitted(&model)
    }
}

impl RegressionProblem for ToolPoses {
    type Effect = Effect<f64>;
    type Fit = PoseFit;
    type Weighting = ();
    type Neighbours<'a> = PoseNeighbourhood<'a>;
    type Error = NoTrial;

    fn policy(&self) -> Policy {
        let discovery_level = self.levels.discovery;
        Policy {
            max_effects: MAX_EFFECTS,
            laws_overlap: false,
            exchanges: true,
            discovery_level,
            rival_level: RIVAL_LEVEL,
        }
    }

    fn progress(&self) -> &Progress {
        &self.progress
    }

    fn n_effects(&self, fit: &PoseFit) -> usize {
        fit.model.effects.len()
    }

    fn n_values(&self, fit: &PoseFit) -> usize {
        fit.values.len()
    }

    fn name(&self, effect: &Effect<f64>) -> CandidateName {
        CandidateName {
            law: effect.name(),
            places: vec![Place::of_arm(effect)],
            constant: None,
            text: arm_candidates::place_code(effect),
        }
    }

    /// The noise of repeats does not depend on the model.
    fn reweight_until_converged(&self, model: Trial<Self>) -> Result<Trial<Self>, NoTrial> {
        Ok(model)
    }

    fn neighbours<'a>(&'a self, model: &'a Trial<Self>) -> Result<PoseNeighbourhood<'a>, NoTrial> {
        Ok(PoseNeighbourhood { problem: self, model })
    }

    /// A trial fitted in full; a step gets the best change point beside the other effects.
    fn refitted(&self, trial: &Trial<Self>) -> Result<Trial<Self>, NoTrial> {
        let refitted = self.fitted(&trial.fit.model)?;
        let Some(model) = self.timed_again(&refitted.fit)? else {
            return Ok(Trial { effect: trial.effect, ..refitted });
        };
        let again = self.fitted(&model)?;
        let better = if self.under(&again).is_lower(&again, &refitted) { again } else { refitted };
        Ok(Trial { effect: better.fit.model.effects.last().copied(), ..better })
    }

    fn loss(&self, (): &(), unseen: &[f64]) -> Loss {
        Loss::new(losses(unseen, self.training.n_axes()).iter().sum())
    }

    fn loss_reduction(&self, (): &(), before: &[f64], after: &[f64]) -> LossReduction {
        clustered_t_test(before, after, &self.training.groups())
    }
}
