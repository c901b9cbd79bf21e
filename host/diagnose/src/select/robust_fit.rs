//! Values fitted to residuals: robust least squares in one step, and Gauss–Newton over the model.
//!
//! # Method
//!
//! A row counts by the size s of its residual, all axes together, in units of the noise: ρ(s) = s²/2 up to c, and
//! c·s − c²/2 beyond (Huber), with c² the 95 % quantile of χ² with as many degrees of freedom as axes. So a row that is
//! far off pulls with a bounded force. Minimised by re-weighted least squares (w = min(1, c/s)) within each
//! Gauss–Newton step; a step that does not lower the loss is halved.

use darm_core::effect::law_name::LawName;
use darm_core::real::Vec3;
use darm_core::se::{Pose, rotation_log};
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::linearise::sensitivity::Sensitivity;
use crate::prepare::observations::{NoPose, Observations, Value};
use darm_arm::arm::{ArmModel, ArmScratch};

/// Re-weightings within one linear fit.
pub(super) const REWEIGHTINGS: usize = 6;
/// Gauss–Newton steps at most.
const STEPS: usize = 12;
/// Directions with less than this share of the largest eigenvalue of the scaled information are left alone.
const MIN_EIGENVALUE: f64 = 1e-10;

/// The residuals of a model at the values that fit best, and how they change with these values.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model with its values set.
    pub model: ArmModel,
    /// The values that were fitted.
    pub values: Vec<Value>,
    /// Residuals in units of the noise.
    pub residuals: Vec<f64>,
    /// Their derivatives with respect to the values.
    pub columns: Vec<Vec<f64>>,
}

/// The size of a residual up to which it counts by its square.
pub fn threshold(n_axes: usize) -> f64 {
    ChiSquared::new(n_axes as f64).map_or(3.0, |chi| chi.inverse_cdf(0.95)).sqrt()
}

/// ρ of each row.
pub fn losses(residuals: &[f64], n_axes: usize) -> Vec<f64> {
    let c = threshold(n_axes);
    residuals.chunks(n_axes).map(|row| rho(size(row), c)).collect()
}

/// ρ of a residual of size s with the threshold c.
pub fn rho(s: f64, c: f64) -> f64 {
    if s <= c { 0.5 * s * s } else { c * s - 0.5 * c * c }
}

/// The weight of each row.
pub fn weights(residuals: &[f64], n_axes: usize) -> Vec<f64> {
    let c = threshold(n_axes);
    residuals.chunks(n_axes).map(|row| (c / size(row)).min(1.0)).collect()
}

/// The size of one residual.
pub fn size(row: &[f64]) -> f64 {
    row.iter().map(|r| r * r).sum::<f64>().sqrt()
}

/// JᵀWJ and JᵀWr.
pub fn normal(columns: &[Vec<f64>], residuals: &[f64], weights: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
    let (n_axes, p) = (residuals.len() / weights.len().max(1), columns.len());
    let mut information = DMatrix::zeros(p, p);
    let mut gradient = DVector::zeros(p);
    let mut weighted = vec![0.0; residuals.len()];
    for (a, column) in columns.iter().enumerate() {
        for (row, &weight) in weights.iter().enumerate() {
            for k in row * n_axes..(row + 1) * n_axes {
                weighted[k] = weight * column[k];
            }
        }
        gradient[a] = dot(&weighted, residuals);
        for (b, other) in columns.iter().enumerate().take(a + 1) {
            information[(a, b)] = dot(&weighted, other);
            information[(b, a)] = information[(a, b)];
        }
    }
    (information, gradient)
}

/// In eight sums side by side, which a processor adds at once.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, a_rest) = a.as_chunks::<8>();
    let (b, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        (0..8).for_each(|k| sums[k] += a[k] * b[k]);
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

/// x with A·x = b for an information matrix A, zero along directions that A does not determine.
pub fn solve(information: &DMatrix<f64>, gradient: &DVector<f64>) -> DVector<f64> {
    &pseudo_inverse(information) * gradient
}

/// The inverse of an information matrix, zero along directions that it does not determine; scaled first, so that units do not matter.
pub fn pseudo_inverse(information: &DMatrix<f64>) -> DMatrix<f64> {
    if information.is_empty() {
        return information.clone();
    }
    let scale = information.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(scale.len(), scale.len(), |a, b| information[(a, b)] * scale[a] * scale[b]);
    let eigen = scaled.symmetric_eigen();
    let smallest = MIN_EIGENVALUE * eigen.eigenvalues.max();
    let inverted = eigen.eigenvalues.map(|l| if l > smallest && l > 0.0 { 1.0 / l } else { 0.0 });
    let inverse = &eigen.eigenvectors * DMatrix::from_diagonal(&inverted) * eigen.eigenvectors.transpose();
    DMatrix::from_fn(scale.len(), scale.len(), |a, b| inverse[(a, b)] * scale[a] * scale[b])
}

/// Residuals near a model, and how each value moves them.
pub(crate) struct Linear<'a> {
    pub(crate) columns: &'a [Vec<f64>],
    pub(crate) residuals: &'a [f64],
    pub(crate) n_axes: usize,
}

impl Linear<'_> {
    /// The change of the values that fits the residuals best; `counts` says which rows count, `first` how much at first.
    pub(crate) fn step(&self, counts: &[f64], first: &[f64], reweightings: usize) -> DVector<f64> {
        let &Self { columns, residuals, n_axes } = self;
        let mut row_weights: Vec<f64> = first.iter().zip(counts).map(|(w, c)| w * c).collect();
        let mut step = DVector::zeros(columns.len());
        for _ in 0..reweightings {
            let (information, gradient) = normal(columns, residuals, &row_weights);
            let next = -solve(&information, &gradient);
            let change = (&next - &step).component_mul(&information.diagonal().map(f64::sqrt)).amax();
            step = next;
            let after = moved(columns, residuals, &step);
            row_weights = weights(&after, n_axes).iter().zip(counts).map(|(w, c)| w * c).collect();
            if change < 0.02 {
                break;
            }
        }
        step
    }
}

/// The residuals after a step, as far as they are linear.
pub fn moved(columns: &[Vec<f64>], residuals: &[f64], step: &DVector<f64>) -> Vec<f64> {
    let mut after = residuals.to_vec();
    for (column, &step) in columns.iter().zip(step.iter()) {
        after.iter_mut().zip(column).for_each(|(after, slope)| *after += slope * step);
    }
    after
}

/// The values of `model`'s effects that fit `observations` best, from where they stand.
///
/// Values that change nothing in these observations keep what they have, and are not among the fit's.
///
/// # Errors
///
/// The model has no pose for a row, as it is or after a step.
pub fn fit(
    model: &ArmModel,
    observations: &Observations,
    values: &[Value],
    scratch: &mut ArmScratch,
) -> Result<Fit, NoPose> {
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
    values: &[Value],
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
    fit: &Fit,
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
fn at(model: ArmModel, observations: &Observations, values: &[Value], scratch: &mut ArmScratch) -> Result<Fit, NoPose> {
    if values.is_empty() {
        let residuals = observations.residuals(&model, scratch)?;
        return Ok(Fit { model, values: Vec::new(), residuals, columns: Vec::new() });
    }
    let sensitivity = Sensitivity::new(&model, observations, scratch)?;
    let observed = values.iter().filter_map(|&(effect, value)| {
        let column = sensitivity.column(&model.effects[effect], value)?;
        Some(((effect, value), column))
    });
    let (values, columns) = observed.unzip();
    let residuals = sensitivity.into_residuals();
    Ok(Fit { model, values, residuals, columns })
}

/// The covariance of fitted values by the jackknife: how far they go when a group is left out, all its rows together, so
/// that what the rows of a word, or of a run, have in common is not counted as many times. `groups` has the group of each row, less than
/// `n_groups`.
///
/// Source: R. M. Bell, D. F. McCaffrey, Survey Methodology 28 (2002) 169.
pub fn covariance(fit: &Fit, groups: &[usize], n_groups: usize) -> DMatrix<f64> {
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
        let gone = solve(without, score);
        covariance.ger((n_groups as f64 - 1.0) / n_groups as f64, &gone, &gone, 1.0);
    }
    covariance
}

/// The condition number of the information about the fitted values.
pub fn condition(fit: &Fit, observations: &Observations) -> f64 {
    let row_weights = weights(&fit.residuals, observations.n_axes());
    condition_of(&normal(&fit.columns, &fit.residuals, &row_weights).0)
}

/// The condition number of an information matrix, each value scaled to its own.
pub fn condition_of(information: &DMatrix<f64>) -> f64 {
    if information.is_empty() {
        return 1.0;
    }
    let scale = information.diagonal().map(|d| d.max(f64::MIN_POSITIVE).sqrt());
    let scaled = DMatrix::from_fn(scale.len(), scale.len(), |a, b| information[(a, b)] / (scale[a] * scale[b]));
    let eigenvalues = scaled.symmetric_eigenvalues();
    eigenvalues.max() / eigenvalues.min().max(f64::MIN_POSITIVE)
}
