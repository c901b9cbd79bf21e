//! Tool poses of an arm of words, as a kind of observation: whole words are left out, and the held-out words confirm.

use darm_core::effect::Effect;
use darm_core::effect::step::Step;
use darm_core::model::MAX_EFFECTS;
use nalgebra::DVector;

use crate::linearise::arm_candidates;
use crate::linearise::sensitivity::Sensitivity;
use crate::measurement::root_mean_square;
use crate::prepare::observations::{NoPose, Observations, Value};
use crate::select::problem::{Kind, Trial};
use crate::select::robust_fit::{Fit, cross_validated, fit, losses, moved, weights};
use crate::select::significance::{CONFIRMATION_LEVEL, Fall, fall};
use darm_arm::arm::{ArmModel, ArmScratch};

/// Poses that fits see, poses that judge, and room to compute in.
#[derive(Debug)]
pub struct ToolPose {
    /// Rows that fits see.
    pub training: Observations,
    /// Rows that judge; may be none.
    pub heldout: Observations,
    /// The fold of each training row.
    pub folds: Vec<usize>,
    /// Room to compute in.
    pub scratch: ArmScratch,
}

/// The values of all effects of a model.
pub fn values(model: &ArmModel) -> Vec<Value> {
    let effects = model.effects.iter().enumerate();
    effects.flat_map(|(k, effect)| (0..effect.law().values().len()).map(move |value| (k, value))).collect()
}

impl ToolPose {
    /// A model with all its values fitted in full.
    pub fn fitted(&mut self, model: &ArmModel) -> Result<Trial<Self>, NoPose> {
        let fit = fit(model, &self.training, &values(model), &mut self.scratch)?;
        let last = fit.model.effects.last().copied();
        Ok(self.judged(fit, last))
    }

    /// A candidate by its linear fit; `None` where it changes nothing in these rows.
    fn candidate(&self, current: &Trial<Self>, effect: &Effect<f64>, sensitivity: &Sensitivity) -> Option<Trial<Self>> {
        let mut model = current.fit.model.clone();
        let new = model.effects.len();
        model.effects.push(*effect).ok()?;
        let mut fit = Fit { model, ..current.fit.clone() };
        for value in 0..effect.law().values().len() {
            if let Some(column) = sensitivity.column(effect, value) {
                fit.values.push((new, value));
                fit.columns.push(column);
            }
        }
        (fit.values.len() > current.fit.values.len()).then(|| self.judged(fit, Some(*effect)))
    }

    /// A step at the moment that it explains most from; any other effect as it is.
    fn timed(&self, effect: &Effect<f64>, residuals: &[f64], sensitivity: &Sensitivity) -> Effect<f64> {
        let Effect::Step(step) = *effect else { return *effect };
        let always = Step { since_s: f64::NEG_INFINITY, ..step };
        let since_s = sensitivity.column(&always.into(), 0).and_then(|column| self.moment(&column, residuals));
        Step { since_s: since_s.unwrap_or(step.since_s), ..step }.into()
    }

    /// The model with its steps at the moments that they explain most from, each beside all other effects; `None` where
    /// they are there already.
    fn timed_again(&mut self, fit: &Fit) -> Result<Option<ArmModel>, NoPose> {
        let mut model = fit.model.clone();
        if !model.effects.iter().any(|effect| matches!(effect, Effect::Step(_))) {
            return Ok(None);
        }
        let sensitivity = Sensitivity::new(&fit.model, &self.training, &mut self.scratch)?;
        for (k, effect) in fit.model.effects.iter().enumerate() {
            let Effect::Step(step) = *effect else { continue };
            let Some(own) = fit.values.iter().position(|&(of, _)| of == k) else { continue };
            let without = moved(&fit.columns[own..=own], &fit.residuals, &DVector::from_element(1, -step.shift_m));
            model.effects[k] = self.timed(effect, &without, &sensitivity);
        }
        Ok((model.effects != fit.model.effects).then_some(model))
    }

    /// The moment t₀ for which a column that acts from then on takes most from the residuals: the largest
    /// (Σ w·c·r)² / Σ w·c², the sums over all rows from t₀ on.
    fn moment(&self, column: &[f64], residuals: &[f64]) -> Option<f64> {
        let n_axes = self.training.n_axes();
        let row_weights = weights(residuals, n_axes);
        let times: Vec<f64> = self.training.times_s().collect();
        let mut order: Vec<usize> = (0..times.len()).collect();
        order.sort_by(|&a, &b| times[b].total_cmp(&times[a]));
        let (mut along, mut square, mut best) = (0.0, 0.0, (0.0, None));
        for row in order {
            for k in row * n_axes..(row + 1) * n_axes {
                along += row_weights[row] * column[k] * residuals[k];
                square += row_weights[row] * column[k] * column[k];
            }
            let gain = along * along / square;
            if gain > best.0 {
                best = (gain, Some(times[row]));
            }
        }
        best.1
    }

    /// Error on rows that no fit saw, held out for good or in turn, as a distance d, root mean square, m.
    pub fn unseen_m(&mut self, trial: &Trial<Self>) -> Result<f64, NoPose> {
        if self.heldout.rows.is_empty() {
            return Ok(trial.error);
        }
        let residuals = self.heldout.residuals(&trial.fit.model, &mut self.scratch)?;
        Ok(root_mean_square(&self.heldout.distances_m(&residuals)))
    }

    fn judged(&self, fit: Fit, effect: Option<Effect<f64>>) -> Trial<Self> {
        let predicted = cross_validated(&fit.columns, &fit.residuals, &self.training, &self.folds);
        let loss = losses(&predicted, self.training.n_axes()).iter().sum();
        let error = root_mean_square(&self.training.distances_m(&predicted));
        Trial { effect, fit, predicted, loss, error }
    }
}

impl Kind for ToolPose {
    type Effect = Effect<f64>;
    type Fit = Fit;
    type Error = NoPose;

    fn n_effects(&self, fit: &Fit) -> usize {
        fit.model.effects.len()
    }

    fn n_values(&self, fit: &Fit) -> usize {
        fit.values.len()
    }

    fn most(&self) -> usize {
        MAX_EFFECTS
    }

    fn exchanges(&self) -> bool {
        true
    }

    fn name(&self, effect: &Effect<f64>) -> (&'static str, String) {
        (effect.law().name(), arm_candidates::place_code(effect))
    }

    fn settled(&mut self, current: Trial<Self>) -> Result<Trial<Self>, NoPose> {
        Ok(current)
    }

    fn screened(&mut self, current: &Trial<Self>) -> Result<Vec<Trial<Self>>, NoPose> {
        let candidates: Vec<Effect<f64>> = arm_candidates::all(&current.fit.model)
            .into_iter()
            .filter(|effect| !current.fit.model.effects.iter().any(|known| arm_candidates::same(known, effect)))
            .collect();
        let sensitivity = Sensitivity::new(&current.fit.model, &self.training, &mut self.scratch)?;
        let timed = candidates.iter().map(|effect| self.timed(effect, &current.fit.residuals, &sensitivity));
        Ok(timed.filter_map(|effect| self.candidate(current, &effect, &sensitivity)).collect())
    }

    /// A trial fitted in full; a step is timed again beside the other effects.
    fn refined(&mut self, trial: &Trial<Self>) -> Result<Trial<Self>, NoPose> {
        let refined = self.fitted(&trial.fit.model)?;
        let Some(model) = self.timed_again(&refined.fit)? else {
            return Ok(Trial { effect: trial.effect, ..refined });
        };
        let again = self.fitted(&model)?;
        let better = if again.loss < refined.loss { again } else { refined };
        Ok(Trial { effect: better.fit.model.effects.last().copied(), ..better })
    }

    fn without(&mut self, best: &Trial<Self>, dropped: usize) -> Result<Trial<Self>, NoPose> {
        let mut model = best.fit.model.clone();
        model.effects.remove(dropped);
        self.fitted(&model)
    }

    fn fall(&self, before: &Trial<Self>, after: &Trial<Self>) -> Fall {
        fall(&before.predicted, &after.predicted, &self.training.groups())
    }

    /// Whether the held-out error falls by more than its uncertainty, by the noise that is left: a row that is far off by
    /// both models does not hide the fall, nor do words on which the effect does not act.
    fn confirmed(&mut self, without: &Trial<Self>, with: &Trial<Self>) -> Result<bool, NoPose> {
        if self.heldout.rows.is_empty() {
            return Ok(true);
        }
        let before = self.heldout.residuals(&without.fit.model, &mut self.scratch)?;
        let after = self.heldout.residuals(&with.fit.model, &mut self.scratch)?;
        Ok(fall(&before, &after, &self.heldout.groups()).p < CONFIRMATION_LEVEL)
    }
}
