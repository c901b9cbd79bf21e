//! The moment of a step in time, chosen by the rows that a fit sees: a fold is predicted by the moment that the other folds
//! give, so that the choice of a moment proves nothing by itself.

use std::collections::BTreeMap;

use super::robust_fit::weights;
use crate::prepare::observations::Observations;

/// Different words that are measured before a step, and after it.
const MIN_WORDS: usize = 8;

/// A step of a model: which of the values that are fitted it is, and what it does.
#[derive(Clone)]
pub(super) struct Step {
    pub(super) value: usize,
    /// Derivative of the residuals for a step that is there from the start.
    pub(super) always: Vec<f64>,
    /// Its size, m.
    pub(super) shift_m: f64,
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

/// The moment t₀ for which a column that acts from then on takes most from the residuals of the rows that `counts` has: the
/// largest (Σ w·c·r)² / Σ w·c², the sums over all rows from t₀ on. `None` where too few words are before or after any moment.
pub(super) fn change_point(
    observations: &Observations,
    always: &[f64],
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
    let (mut along, mut square, mut best) = (0.0, 0.0, (0.0, None));
    for (position, &row) in order.iter().enumerate() {
        for k in row * n_axes..(row + 1) * n_axes {
            along += row_weights[row] * always[k] * residuals[k];
            square += row_weights[row] * always[k] * always[k];
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
        let gain = along * along / square;
        if !goes_on && before.len() >= MIN_WORDS && after.len() >= MIN_WORDS && gain > best.0 {
            best = (gain, Some(time_s));
        }
    }
    best.1
}
