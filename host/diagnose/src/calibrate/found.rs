//! What the training rows have chosen, and how certain the predicted pose at the frames is.

use darm_arm::arm::{Arm, ArmModel, ArmScratch};
use darm_core::effect::Effect;
use nalgebra::DMatrix;

use super::Task;
use super::design::{any, values_of};
use super::rows::{PlannedRows, Rows};
use crate::correction::{ArmCorrection, Outcome};
use crate::judge::next_words::together;
use crate::measurement_plan::{LIKELY, PlanStep};
use crate::prepare::observations::{NoPose, Observations};
use crate::select::poses::robust_fit::{PoseFit, covariance, fit};
use crate::select::poses::values;
use crate::select::significance::quantile_975;
use darm_measure::Run;

/// How many standard deviations wide 95 % of a normal distribution reaches to one side.
const NORMAL_975: f64 = 1.959_964;

/// Effects that the training rows have chosen, with those that would explain them as well, fitted together.
pub(super) struct Found {
    fit: PoseFit,
    sigma: [f64; 6],
}

impl Found {
    /// What a diagnosis has chosen; `None` where that is nothing.
    pub(super) fn of(task: &Task, run: &Run, outcome: &Outcome<ArmCorrection>) -> Result<Option<Self>, NoPose> {
        let best = &outcome.correction.best_effects;
        if best.len() == task.arm.model.effects.len() {
            return Ok(None);
        }
        let model = together(task.arm, &with(task.arm, best), &outcome.diagnosis.alternatives);
        let (found, _) = Self::fitted(task, run, &model)?;
        Ok(Some(found))
    }

    /// The effects of a model fitted to the training rows, and these.
    fn fitted(task: &Task, run: &Run, model: &ArmModel) -> Result<(Self, Observations), NoPose> {
        let sigma = task.sigma(run);
        let training = Observations::new(task.arm, run, sigma, |sample| !sample.held_out);
        let fit = fit(model, &training, &values(model), &mut ArmScratch::default())?;
        Ok((Self { fit, sigma }, training))
    }

    /// The model with all of them.
    pub(super) fn model(&self) -> &ArmModel {
        &self.fit.model
    }

    /// Their values that the rows determine.
    pub(super) fn values(&self) -> Vec<(Effect<f64>, usize)> {
        self.fit.values.iter().map(|&(effect, value)| (self.fit.model.effects[effect], value)).collect()
    }

    /// The noise that they were fitted under.
    pub(super) fn sigma(&self) -> [f64; 6] {
        self.sigma
    }
}

/// The model of an arm with these effects only.
fn with(arm: &Arm, effects: &[Effect<f64>]) -> ArmModel {
    let mut model = arm.model.clone();
    model.effects = effects.iter().copied().collect();
    model
}

/// How far the pose at the desired frames may be from the predicted one by the values of these effects, with 95 %
/// confidence, as a distance d, root mean square, m.
pub(super) fn of_named(task: &Task, run: &Run, effects: &[Effect<f64>]) -> Result<f64, NoPose> {
    let (found, training) = Found::fitted(task, run, &with(task.arm, effects))?;
    let of_values = covariance(&found.fit, &training.groups(), training.n_groups);
    let sigma = found.sigma;
    let conditions = run.settled_or_nominal(task.arm);
    let rows = Rows::new(task.arm, run, &PlannedRows { frames: task.frames, next: &[], conditions, sigma });
    let slopes = rows.slopes(&rows.sensitivity(found.model())?, &found.values());
    let width = quantile_975(training.n_groups.saturating_sub(found.fit.values.len()));
    Ok(width * slopes.at_frames_m(&of_values))
}

/// How far the pose at the frames may be off by what an arm in which nothing was found may still be missing: by the candidate,
/// each taken alone, whose values these rows determine worst.
pub(super) fn of_any(task: &Task, run: &Run, next: &[PlanStep]) -> Result<f64, NoPose> {
    let sigma = task.sigma(run);
    let conditions = run.settled_or_nominal(task.arm);
    let rows = Rows::new(task.arm, run, &PlannedRows { frames: task.frames, next, conditions, sigma });
    let mut largest_m = 0.0f64;
    let sensitivity = rows.sensitivity(&task.arm.model)?;
    for effect in any(&task.arm.model) {
        let slopes = rows.slopes(&sensitivity, &values_of(effect).collect::<Vec<_>>()).scaled(LIKELY);
        let information = slopes.information() + DMatrix::identity(slopes.n_values(), slopes.n_values());
        let Some(of_values) = information.try_inverse() else { continue };
        largest_m = largest_m.max(NORMAL_975 * slopes.at_frames_m(&of_values));
    }
    Ok(largest_m)
}
