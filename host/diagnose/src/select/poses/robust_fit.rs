//! Values of an arm's effects fitted to its poses: Gauss–Newton over the model, each step a robust linear fit
//! (`least_squares.rs`); a step that does not lower the loss is halved.

use darm_core::effect::law_name::LawName;
use darm_core::real::Vec3;
use darm_core::se::{Pose, rotation_log};
use nalgebra::{DMatrix, DVector};

use crate::least_squares::{Linear, REWEIGHTINGS, condition_of, losses, normal, solve_determined, weights};
use crate::linearise::sensitivity::Sensitivity;
use crate::prepare::observations::{NoPose, Observations, ValueIndex};
use darm_arm::arm::{ArmModel, ArmScratch};

/// Gauss–Newton steps at most.
const STEPS: usize = 12;

/// The residuals of a model at the values that fit best, and how they change with these values.
#[derive(Clone, Debug)]
pub struct PoseFit {
    /// The model with its values set.
    pub model: ArmModel,
    /// The values that were fitted.
    pub values: Vec<ValueIndex>,
    /// Residuals in units of the noise.
    pub residuals: Vec<f64>,
    /// Their derivatives with respect to the values.
    pub columns: Vec<Vec<f64>>,
}

/// The values of `model`'s effects that fit `observations` best, from their values in the model.
///
/// Values that change nothing in these observations keep what they have, and are not among the fit's.
///
/// # Errors
///
/// The model has no pose for a row, as it is or after a step.
pub fn fit(
    model: &ArmModel,
    observations: &Observations,
    values: &[ValueIndex],
    scratch: &mut ArmScratch,
) -> Result<PoseFit, NoPose> {
    let n_axes = observations.n_axes();
    let all = vec![1.0; observations.rows.len()];
    let mut best = at(registered(model, observations, values, scratch)?, observations, values, scratch)?;
    let mut loss: f64 = losses(&best.residuals, n_axes).iter().sum();
    for _ in 0..if best.values.is_empty() { 0 } else { STEPS } {
        let linear = Linear { columns: &best.columns, residuals: &best.residuals, n_axes };
        let step = linear.step(&all, &all, REWEIGHTINGS);
        let Some((model, lower)) = descend(&best, step, loss, observations, scratch) else {
            break;
        };
        best = at(model, observations, values, scratch)?;
        let gain = loss - lower;
        loss = lower;
        if gain < 1e-3 {
            break;
        }
    }
    Ok(best)
}

/// The model with its base where the predicted poses lie nearest to the measured ones, in closed form; as it is where the
/// place of its base is not fitted, or where that does not lower the loss.
///
/// Residuals are linear in a turn of the base up to some degrees only, and a camera may look at the arm from any side: from 45°
/// on the steps below end where the arm is millimetres away from what they could reach.
fn registered(
    model: &ArmModel,
    observations: &Observations,
    values: &[ValueIndex],
    scratch: &mut ArmScratch,
) -> Result<ArmModel, NoPose> {
    let is_fitted = |effect: usize| values.iter().any(|value| value.0 == effect);
    let effects = model.effects.iter().map(|effect| effect.name());
    let base = effects.enumerate().position(|(k, name)| name == LawName::BaseOffset && is_fitted(k));
    let Some(base) = base else { return Ok(model.clone()) };
    let predicted = observations.predicted(model, scratch)?;
    let motion = observations.nearest_motion(&predicted);
    let mut moved = model.clone();
    if let [rx, ry, rz, x, y, z] = moved.effects[base].values_mut() {
        let place = motion * Pose::new(&Vec3::new(*rx, *ry, *rz), Vec3::new(*x, *y, *z));
        let turn = rotation_log(&place.rotation);
        ([*rx, *ry, *rz], [*x, *y, *z]) = (turn.into(), place.position.into());
    }
    let loss = |residuals: &[f64]| losses(residuals, observations.n_axes()).iter().sum::<f64>();
    let is_nearer = loss(&observations.residuals(&moved, scratch)?) < loss(&observations.residuals_of(&predicted));
    Ok(if is_nearer { moved } else { model.clone() })
}

/// The model after a step that lowers the loss, halved until it does, and that loss.
fn descend(
    fit: &PoseFit,
    mut step: DVector<f64>,
    loss: f64,
    observations: &Observations,
    scratch: &mut ArmScratch,
) -> Option<(ArmModel, f64)> {
    for _ in 0..8 {
        let mut model = fit.model.clone();
        for (&(effect, value), change) in fit.values.iter().zip(step.iter()) {
            model.effects[effect].values_mut()[value] += change;
        }
        if let Ok(residuals) = observations.residuals(&model, scratch) {
            let lower = losses(&residuals, observations.n_axes()).iter().sum();
            if lower < loss {
                return Some((model, lower));
            }
        }
        step *= 0.5;
    }
    None
}

/// Residuals and derivatives of a model at its values.
fn at(
    model: ArmModel,
    observations: &Observations,
    values: &[ValueIndex],
    scratch: &mut ArmScratch,
) -> Result<PoseFit, NoPose> {
    if values.is_empty() {
        let residuals = observations.residuals(&model, scratch)?;
        return Ok(PoseFit { model, values: Vec::new(), residuals, columns: Vec::new() });
    }
    let sensitivity = Sensitivity::new(&model, observations, scratch)?;
    let observed = values.iter().filter_map(|&(effect, value)| {
        let column = sensitivity.column(&model.effects[effect], value)?;
        Some(((effect, value), column))
    });
    let (values, columns) = observed.unzip();
    let residuals = sensitivity.into_residuals();
    Ok(PoseFit { model, values, residuals, columns })
}

/// The covariance of fitted values by the jackknife: how far they go when a group is left out, all its rows together, so
/// that what the rows of a word, or of a run, have in common is not counted as many times. `groups` has the group of each row, less than
/// `n_groups`.
///
/// Source: R. M. Bell, D. F. McCaffrey, Survey Methodology 28 (2002) 169.
pub fn covariance(fit: &PoseFit, groups: &[usize], n_groups: usize) -> DMatrix<f64> {
    let n_axes = fit.residuals.len() / groups.len().max(1);
    let row_weights = weights(&fit.residuals, n_axes);
    let (information, _) = normal(&fit.columns, &fit.residuals, &row_weights);
    let p = fit.columns.len();
    let mut without = vec![information; n_groups];
    let mut scores = vec![DVector::<f64>::zeros(p); n_groups];
    for (index, (&group, weight)) in groups.iter().zip(&row_weights).enumerate() {
        for k in index * n_axes..(index + 1) * n_axes {
            let slopes = DVector::from_iterator(p, fit.columns.iter().map(|column| column[k]));
            without[group].ger(-weight, &slopes, &slopes, 1.0);
            scores[group].axpy(weight * fit.residuals[k], &slopes, 1.0);
        }
    }
    let mut covariance = DMatrix::zeros(p, p);
    for (without, score) in without.iter().zip(&scores) {
        let gone = solve_determined(without, score);
        covariance.ger((n_groups as f64 - 1.0) / n_groups as f64, &gone, &gone, 1.0);
    }
    covariance
}

/// The condition number of the information about the fitted values.
pub fn condition(fit: &PoseFit, observations: &Observations) -> f64 {
    let row_weights = weights(&fit.residuals, observations.n_axes());
    condition_of(&normal(&fit.columns, &fit.residuals, &row_weights).0)
}
