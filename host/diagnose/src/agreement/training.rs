//! The training rows of signals: what was predicted and measured, and the size of an error as a share of it.

use super::trimmed_root_mean_square;
use crate::linearise::experiment::Experiment;
use darm_measure::{median, root_mean_square};

/// Least variation of what is predicted, as a share of that of the error, with which an error says that a model is wrong.
const MIN_VARIATION: f64 = 0.25;
/// Error under another reading as a share of what was measured, at the most.
pub(super) const AGREES: f64 = 0.5;
/// What remains of the variation of a log in another unit, as a share, at the most.
pub(super) const FOLLOWS: f64 = 0.9;
/// Factor between measured and predicted signals from which on they are in different units.
pub(super) const OTHER_UNIT: f64 = 20.0;

/// The rows that fits see of what was predicted and measured: rows × axes, one row at least.
pub(super) struct Training {
    pub(super) residuals: Vec<f64>,
    pub(super) measured: Vec<f64>,
}

impl Training {
    /// Those of an experiment; `None` where nothing but differences is measured.
    pub(super) fn of(experiment: &Experiment) -> Option<Self> {
        let residuals = experiment.training_rows(&experiment.residuals);
        let measured = experiment.training_rows(experiment.measured.as_ref()?);
        (!residuals.is_empty()).then_some(Self { residuals, measured })
    }

    /// The error of the norm.
    pub(super) fn error(&self, experiment: &Experiment) -> f64 {
        experiment.norm(&self.residuals).expect("there are training rows")
    }

    /// Whether what is predicted varies enough beside the error to say that the model is wrong: at rest it does not.
    pub(super) fn tests_the_model(&self, experiment: &Experiment) -> bool {
        let predicted: Vec<f64> = self.residuals.iter().zip(&self.measured).map(|(r, measured)| r + measured).collect();
        varies(experiment, &predicted) > MIN_VARIATION * varies(experiment, &self.residuals)
    }

    /// Share of the variance that a model explains which leaves these residuals.
    pub(super) fn explained(&self, experiment: &Experiment, residuals: &[f64]) -> f64 {
        1.0 - (size(experiment, residuals) / varies(experiment, &self.measured).max(f64::MIN_POSITIVE)).powi(2)
    }

    /// The error of an axis as a share of how much it varies.
    pub(super) fn share(&self, experiment: &Experiment, axis: usize) -> f64 {
        let of = |rows: &[f64]| trimmed_of_axis(rows, axis, experiment.axes.len());
        of(&self.residuals) / of(&variation(experiment, &self.measured))
    }

    /// How many times larger the numbers of the log are where it is in another unit, and the error without that; most of what
    /// was measured must be explained then, and some of what varies.
    pub(super) fn other_unit(&self, experiment: &Experiment) -> Option<(f64, f64)> {
        let factor = self.ratio(experiment).filter(|factor| factor.ln().abs() > OTHER_UNIT.ln())?;
        let pairs = self.residuals.iter().zip(&self.measured);
        let residuals = pairs.map(|(residual, measured)| residual + measured * (1.0 - 1.0 / factor)).collect();
        let measured = self.measured.iter().map(|measured| measured / factor).collect();
        let read = Self { residuals, measured };
        let is_near = size(experiment, &read.residuals) < AGREES * size(experiment, &read.measured);
        let follows = varies(experiment, &read.residuals) < FOLLOWS * varies(experiment, &read.measured);
        (is_near && follows).then(|| (factor, read.error(experiment)))
    }

    /// How many times what is predicted was measured, axes of the norm together, by the median of large numbers.
    fn ratio(&self, experiment: &Experiment) -> Option<f64> {
        let n_axes = experiment.axes.len();
        let pairs =
            self.residuals.iter().zip(&self.measured).map(|(r, measured)| [r + measured, *measured]).enumerate();
        let pairs: Vec<[f64; 2]> =
            pairs.filter(|(k, _)| k % n_axes < experiment.n_norm).map(|(_, pair)| pair).collect();
        let usual = root_mean_square(&pairs.iter().map(|pair| pair[0]).collect::<Vec<f64>>());
        let large = pairs.iter().filter(|[predicted, _]| predicted.abs() > 0.5 * usual);
        median(large.map(|[predicted, measured]| measured / predicted)).filter(|ratio| *ratio > 0.0)
    }
}

/// Rows × axes less the mean of each axis.
pub(super) fn variation(experiment: &Experiment, rows: &[f64]) -> Vec<f64> {
    let n_axes = experiment.axes.len();
    let n_rows = (rows.len() / n_axes).max(1) as f64;
    let mean: Vec<f64> = (0..n_axes).map(|axis| rows.iter().skip(axis).step_by(n_axes).sum::<f64>() / n_rows).collect();
    rows.iter().enumerate().map(|(k, number)| number - mean[k % n_axes]).collect()
}

/// How much rows × axes vary.
fn varies(experiment: &Experiment, rows: &[f64]) -> f64 {
    size(experiment, &variation(experiment, rows))
}

/// Root mean square of the norm of rows × axes, without what is far off on each axis.
pub(crate) fn size(experiment: &Experiment, rows: &[f64]) -> f64 {
    let n_axes = experiment.axes.len();
    (0..experiment.n_norm).map(|axis| trimmed_of_axis(rows, axis, n_axes).powi(2)).sum::<f64>().sqrt()
}

/// Root mean square of one axis of rows × axes, without what is far off.
pub(super) fn trimmed_of_axis(rows: &[f64], axis: usize, n_axes: usize) -> f64 {
    trimmed_root_mean_square(rows.iter().skip(axis).step_by(n_axes).copied().collect())
}
