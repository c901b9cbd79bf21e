//! Residuals of rows as fits to the other rows leave them.
//!
//! Cross-validation leaves complete words out: the rows of one word repeat each other, so any of them would give the
//! others away. Each tenth of the words is predicted by the values that the other nine tenths give. Where the user says so
//! it leaves out each value of a column in turn.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::change_point::{FittedStep, change_point, since};
use crate::least_squares::{Linear, REWEIGHTINGS, moved, weights};
use crate::prepare::groups::FOLDS;
use crate::prepare::observations::Observations;

/// Re-weightings within a linear fit where the weights are nearly known.
const FEW_REWEIGHTINGS: usize = 2;

/// Which fold each row belongs to: that of its group, which is a matter of chance.
pub fn folds(groups: &[usize], seed: u64) -> Vec<usize> {
    let n_groups = groups.iter().max().map_or(0, |last| last + 1);
    let mut folds: Vec<usize> = (0..n_groups).map(|group| group % FOLDS).collect();
    folds.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    groups.iter().map(|&group| folds[group]).collect()
}

/// The residuals of each row as the fit to the other folds leaves them; of `steps` the other folds give the moments too.
pub(super) fn cross_validated(
    columns: &[Vec<f64>],
    residuals: &[f64],
    observations: &Observations,
    folds: &[usize],
    steps: &[FittedStep],
) -> Vec<f64> {
    let n_axes = observations.n_axes();
    if columns.is_empty() {
        return residuals.to_vec();
    }
    let all = vec![1.0; observations.rows.len()];
    let linear = Linear { columns, residuals, n_axes };
    let full = linear.step(&all, &all, REWEIGHTINGS);
    let first = weights(&moved(columns, residuals, &full), n_axes);
    let mut unseen = residuals.to_vec();
    for fold in 0..=folds.iter().copied().max().unwrap_or_default() {
        let counts: Vec<f64> = folds.iter().map(|own| if *own == fold { 0.0 } else { 1.0 }).collect();
        let after = match steps {
            [] => moved(columns, residuals, &linear.step(&counts, &first, FEW_REWEIGHTINGS)),
            steps => {
                let (columns, residuals) = with_moments(&linear, observations, steps, &counts);
                let linear = Linear { columns: &columns, residuals: &residuals, n_axes };
                moved(&columns, &residuals, &linear.step(&counts, &first, FEW_REWEIGHTINGS))
            }
        };
        for (row, _) in counts.iter().enumerate().filter(|(_, counts)| **counts == 0.0) {
            let range = row * n_axes..(row + 1) * n_axes;
            unseen[range.clone()].copy_from_slice(&after[range]);
        }
    }
    unseen
}

/// The columns of a model with its steps at the moments that some of the rows give, and residuals without these steps.
fn with_moments(
    linear: &Linear,
    observations: &Observations,
    steps: &[FittedStep],
    counts: &[f64],
) -> (Vec<Vec<f64>>, Vec<f64>) {
    let mut columns = linear.columns.to_vec();
    let mut residuals = linear.residuals.to_vec();
    for step in steps {
        residuals = step.taken_from(linear.columns, &residuals);
        let without = step.taken_from(linear.columns, linear.residuals);
        let since_s = change_point(observations, &step.always, &without, counts).unwrap_or(f64::INFINITY);
        for (&value, always) in step.values.iter().zip(&step.always) {
            columns[value] = since(observations, always, since_s);
        }
    }
    (columns, residuals)
}
