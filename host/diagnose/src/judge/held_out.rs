//! Rows of signals that no fit has seen: their residuals before and after, and whether the error on them falls.

use super::selected::SelectedSignals;
use crate::agreement::trimmed_root_mean_square;
use crate::least_squares::losses;
use crate::select::significance::{CONFIRMATION_LEVEL, paired_t_test};

/// Pieces of successive rows that the fall is judged by.
const PIECES: usize = 24;

/// Held-out residuals, rows × axes, of one search or of several that each held out other rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeldOut {
    pub(crate) before: Vec<f64>,
    pub(crate) after: Vec<f64>,
}

impl HeldOut {
    /// Those of one search.
    pub(crate) fn of(selected: &SelectedSignals) -> Self {
        let mut own = Self::default();
        own.add(selected);
        own
    }

    /// Adds the rows that a search has not seen.
    pub(crate) fn add(&mut self, selected: &SelectedSignals) {
        let experiment = &selected.problem.experiment;
        self.before.extend(experiment.held_out_rows(&experiment.residuals));
        self.after.extend(experiment.held_out_rows(&experiment.at(&selected.best.fit.values)));
    }

    /// The rows that a search has not seen, with other values before.
    pub(crate) fn from(selected: &SelectedSignals, before: &[f64]) -> Self {
        let experiment = &selected.problem.experiment;
        let of = |values: &[f64]| experiment.held_out_rows(&experiment.at(values));
        Self { before: of(before), after: of(&selected.best.fit.values) }
    }

    /// Whether the error falls by more than its uncertainty, each axis in units of its noise, and that of the norm, the first
    /// `n_norm` axes, without rows that are far off, does not rise. Without rows the selection has shown as much by
    /// cross-validation.
    pub(crate) fn falls(&self, sigma: &[f64], n_norm: usize) -> bool {
        let n_axes = sigma.len();
        if self.before.is_empty() {
            return true;
        }
        if trimmed_norm(&self.after, n_axes, n_norm) > trimmed_norm(&self.before, n_axes, n_norm) {
            return false;
        }
        let scaled = |residuals: &[f64]| {
            let of = |(k, residual): (usize, &f64)| residual / sigma[k % n_axes];
            losses(&residuals.iter().enumerate().map(of).collect::<Vec<f64>>(), 1)
        };
        let (before, after) = (scaled(&self.before), scaled(&self.after));
        let length = (before.len() / n_axes).div_ceil(PIECES) * n_axes;
        let pieces = before.chunks(length).zip(after.chunks(length));
        let cells: Vec<[f64; 2]> = pieces.map(|(before, after)| [before.iter().sum(), after.iter().sum()]).collect();
        paired_t_test(&cells).p < CONFIRMATION_LEVEL
    }
}

/// Root mean square of the norms of rows × axes, without rows that are far off.
fn trimmed_norm(residuals: &[f64], n_axes: usize, n_norm: usize) -> f64 {
    let square = |row: &[f64]| row[..n_norm].iter().map(|r| r * r).sum::<f64>();
    trimmed_root_mean_square(residuals.chunks(n_axes).map(|row| square(row).sqrt()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_whose_norm_rises_does_not_fall() {
        let rows = |size: [f64; 2]| (0..96).flat_map(|k| size.map(|size| size * f64::from(k % 5 - 2))).collect();
        let held_out = |after| HeldOut { before: rows([3.0, 1.0]), after: rows(after) };
        // In units of its noise the second axis falls by far more than the first one rises.
        assert!(held_out([2.9, 0.1]).falls(&[1.0, 0.01], 2));
        assert!(!held_out([4.0, 0.1]).falls(&[1.0, 0.01], 2));
        assert!(held_out([4.0, 0.1]).falls(&[1.0, 0.01], 0), "axes outside of the norm");
    }
}
