//! Rows that are farther off than noise ever is.

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use crate::judge::selected::SelectedPoses;
use crate::least_squares::size;
use darm_measure::median;

/// Chance that any row of a run without outliers is called one.
const OUTLIER_LEVEL: f64 = 0.01;
/// Share of the rows from which on they are no blunders of a camera: an effect that acts now and then, or a log that is wrong
/// in part.
const MAX_SHARE: f64 = 0.125;

/// Rows of signals that are as many times farther off than usual.
const FAR: f64 = 8.0;

/// Rows that are farther off the model selected than the noise, itself known by limited degrees of freedom, would ever be: their
/// numbers and how far, in units of the noise.
pub(crate) fn far_rows(selected: &SelectedPoses) -> Vec<(usize, f64)> {
    let training = &selected.problem.training;
    let n_axes = training.n_axes();
    let per_axis = selected.repeats().map_or(training.rows.len(), |noise| noise.dof);
    let noise_dof = (per_axis * n_axes) as f64;
    let (Ok(chi), Ok(f)) = (ChiSquared::new(n_axes as f64), FisherSnedecor::new(n_axes as f64, noise_dof)) else {
        return Vec::new();
    };
    let squares: Vec<f64> = selected.best.fit.residuals.chunks(n_axes).map(|row| size(row).powi(2)).collect();
    let usual = median(squares.iter().copied()).unwrap_or(1.0) / chi.inverse_cdf(0.5);
    let rare = 1.0 - OUTLIER_LEVEL / squares.len().max(1) as f64;
    let limit = n_axes as f64 * f.inverse_cdf(rare) * usual.max(1.0);
    let far = squares.iter().enumerate().filter(|(_, square)| **square > limit);
    far.map(|(row, square)| (row, square.sqrt())).collect()
}

/// Rows of signals, as their weighted residuals say, that are far off: their numbers and how far, in units of what is usual.
pub(crate) fn far_rows_of_signals(residuals: &[f64], n_axes: usize) -> Vec<(usize, f64)> {
    let sigmas = residuals.chunks(n_axes).map(|row| size(row) / (n_axes as f64).sqrt());
    sigmas.enumerate().filter(|(_, sigmas)| *sigmas > FAR).collect()
}

/// Whether this number of rows, out of all, is more than blunders.
pub(crate) fn are_too_many(far: usize, rows: usize) -> bool {
    far as f64 > MAX_SHARE * rows as f64
}
