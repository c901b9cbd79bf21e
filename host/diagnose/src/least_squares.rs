//! Robust linear least squares: how much each residual counts, normal equations and their solution.
//!
//! # Method
//!
//! A row counts by the size s of its residual, all axes together, in units of the noise: ρ(s) = s²/2 up to c, and
//! c·s − c²/2 beyond (Huber), with c² the 95 % quantile of χ² with as many degrees of freedom as axes. So a row that is
//! far off pulls with a bounded force. Minimised by re-weighted least squares, w = min(1, c/s).

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Re-weightings within one linear fit.
pub(crate) const REWEIGHTINGS: usize = 6;
/// Directions with less than this share of the largest eigenvalue of the scaled information are left alone.
const MIN_EIGENVALUE: f64 = 1e-10;

/// The size of a residual up to which it counts by its square.
pub(crate) fn threshold(n_axes: usize) -> f64 {
    ChiSquared::new(n_axes as f64).map_or(3.0, |chi| chi.inverse_cdf(0.95)).sqrt()
}

/// ρ of each row.
pub(crate) fn losses(residuals: &[f64], n_axes: usize) -> Vec<f64> {
    let c = threshold(n_axes);
    residuals.chunks(n_axes).map(|row| rho(size(row), c)).collect()
}

/// ρ of a residual of size s with the threshold c.
pub(crate) fn rho(s: f64, c: f64) -> f64 {
    if s <= c { 0.5 * s * s } else { c * s - 0.5 * c * c }
}

/// The weight of each row.
pub(crate) fn weights(residuals: &[f64], n_axes: usize) -> Vec<f64> {
    let c = threshold(n_axes);
    residuals.chunks(n_axes).map(|row| (c / size(row)).min(1.0)).collect()
}

/// The size of one residual.
pub(crate) fn size(row: &[f64]) -> f64 {
    row.iter().map(|r| r * r).sum::<f64>().sqrt()
}

/// JᵀWJ and JᵀWr.
pub(crate) fn normal(columns: &[Vec<f64>], residuals: &[f64], weights: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
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

/// x with A·x = b for an information matrix A, by its pseudo-inverse: zero along directions that A does not determine.
pub(crate) fn solve_determined(information: &DMatrix<f64>, gradient: &DVector<f64>) -> DVector<f64> {
    &pseudo_inverse(information) * gradient
}

/// The inverse of an information matrix, zero along directions that it does not determine; scaled first, so that units do not matter.
pub(crate) fn pseudo_inverse(information: &DMatrix<f64>) -> DMatrix<f64> {
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
            let next = -solve_determined(&information, &gradient);
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
pub(crate) fn moved(columns: &[Vec<f64>], residuals: &[f64], step: &DVector<f64>) -> Vec<f64> {
    let mut after = residuals.to_vec();
    for (column, &step) in columns.iter().zip(step.iter()) {
        after.iter_mut().zip(column).for_each(|(after, slope)| *after += slope * step);
    }
    after
}

/// The condition number of an information matrix, each value scaled to its own.
pub(crate) fn condition_of(information: &DMatrix<f64>) -> f64 {
    if information.is_empty() {
        return 1.0;
    }
    let scale = information.diagonal().map(|d| d.max(f64::MIN_POSITIVE).sqrt());
    let scaled = DMatrix::from_fn(scale.len(), scale.len(), |a, b| information[(a, b)] / (scale[a] * scale[b]));
    let eigenvalues = scaled.symmetric_eigenvalues();
    eigenvalues.max() / eigenvalues.min().max(f64::MIN_POSITIVE)
}
