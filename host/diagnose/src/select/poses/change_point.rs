//! The moment of a step in time, chosen by the rows that a fit sees: a fold is predicted by the moment that the other folds
//! give, so that the choice of a moment proves nothing by itself.

use std::collections::BTreeMap;

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::least_squares::{moved, weights};
use crate::prepare::observations::Observations;

/// Different words that are measured before a step, and after it.
const MIN_WORDS: usize = 8;

/// A step of a model: which of the values that are fitted are its own, and what it does.
#[derive(Clone)]
pub(super) struct FittedStep {
    pub(super) values: Vec<usize>,
    /// Derivatives of the residuals by these values for a step that is there from the start.
    pub(super) always: Vec<Vec<f64>>,
    /// The values.
    pub(super) sizes: Vec<f64>,
}

impl FittedStep {
    /// Residuals without the step; `columns` are those of the fit.
    pub(super) fn taken_from(&self, columns: &[Vec<f64>], residuals: &[f64]) -> Vec<f64> {
        let own: Vec<Vec<f64>> = self.values.iter().map(|&value| columns[value].clone()).collect();
        moved(&own, residuals, &-DVector::from_column_slice(&self.sizes))
    }
}

/// The column of a step from a moment on.
pub(super) fn since(observations: &Observations, always: &[f64], since_s: f64) -> Vec<f64> {
    let n_axes = observations.n_axes();
    let mut column = always.to_vec();
    for (row, slopes) in observations.rows.iter().zip(column.chunks_mut(n_axes)) {
        if row.time_s < since_s {
            slopes.fill(0.0);
        }
    }
    column
}

/// The moment t₀ for which columns that act from then on take most from the residuals of the rows that `counts` has: the
/// largest bᵀA⁻¹b with b = Σ w·r·c and A = Σ w·c·cᵀ, the sums over all rows from t₀ on. `None` where too few words are before
/// or after any moment.
pub(super) fn change_point(
    observations: &Observations,
    always: &[Vec<f64>],
    residuals: &[f64],
    counts: &[f64],
) -> Option<f64> {
    let n_axes = observations.n_axes();
    let row_weights = weights(residuals, n_axes);
    let mut order: Vec<usize> = (0..counts.len()).filter(|&row| counts[row] > 0.0).collect();
    order.sort_by(|&a, &b| observations.rows[b].time_s.total_cmp(&observations.rows[a].time_s));
    let mut before: BTreeMap<usize, usize> = BTreeMap::new();
    for &row in &order {
        *before.entry(observations.rows[row].group).or_default() += 1;
    }
    let mut after: Vec<usize> = Vec::new();
    let p = always.len();
    let (mut gradient, mut information) = (DVector::zeros(p), DMatrix::zeros(p, p));
    let mut best = (0.0, None);
    for (position, &row) in order.iter().enumerate() {
        for k in row * n_axes..(row + 1) * n_axes {
            for (a, column) in always.iter().enumerate() {
                let weighted = row_weights[row] * column[k];
                gradient[a] += weighted * residuals[k];
                always[..=a].iter().enumerate().for_each(|(b, other)| information[(a, b)] += weighted * other[k]);
            }
        }
        let group = observations.rows[row].group;
        let left = before.entry(group).or_default();
        *left -= 1;
        if *left == 0 {
            before.remove(&group);
        }
        if let Err(place) = after.binary_search(&group) {
            after.insert(place, group);
        }
        // Rows of one moment belong together.
        let time_s = observations.rows[row].time_s;
        let goes_on = order.get(position + 1).is_some_and(|&next| observations.rows[next].time_s == time_s);
        if goes_on || before.len() < MIN_WORDS || after.len() < MIN_WORDS {
            continue;
        }
        // Of the information only the lower triangle is there, which is what Cholesky reads.
        let Some(cholesky) = Cholesky::new(information.clone()) else { continue };
        let gain = gradient.dot(&cholesky.solve(&gradient));
        if gain > best.0 {
            best = (gain, Some(time_s));
        }
    }
    best.1
}
