//! Measurements chosen for information: D-optimal design.
//!
//! A measurement with the derivatives J of its residual with respect to all values adds JᵀJ to the information M; the
//! set with the largest det M makes the confidence ellipsoid of the values smallest. Chosen one after the other, the
//! largest gain log det(I + J·M⁻¹·Jᵀ) first; a gain only falls while others are chosen, so most of them need not be
//! computed again.
//!
//! Source: Fedorov, Theory of Optimal Experiments, Academic Press, 1972.

use nalgebra::DMatrix;

/// The numbers of `n` measurements, the most informative first; `covariance` is the inverse of the information that
/// there is before.
pub fn informative_first(mut covariance: DMatrix<f64>, measurements: &[DMatrix<f64>], n: usize) -> Vec<usize> {
    let mut chosen = Vec::new();
    let mut gains: Vec<(f64, usize)> =
        first_gains(&covariance, measurements).into_iter().map(|gain| (gain, 1)).collect();
    let mut open: Vec<usize> = (0..measurements.len()).collect();
    while chosen.len() < n && !open.is_empty() {
        let round = chosen.len() + 1;
        let best = loop {
            let position = (0..open.len()).max_by(|&a, &b| gains[open[a]].0.total_cmp(&gains[open[b]].0)).unwrap_or(0);
            let best = open[position];
            if gains[best].1 == round {
                open.swap_remove(position);
                break best;
            }
            gains[best] = (gain(&covariance, &measurements[best]), round);
        };
        update(&mut covariance, &measurements[best]);
        chosen.push(best);
    }
    chosen
}

/// The gain of each measurement before any is chosen, all in one product.
fn first_gains(covariance: &DMatrix<f64>, measurements: &[DMatrix<f64>]) -> Vec<f64> {
    let n_rows = measurements.iter().map(DMatrix::nrows).sum();
    let mut all = DMatrix::zeros(covariance.nrows(), n_rows);
    let mut first = 0;
    for measurement in measurements {
        all.columns_mut(first, measurement.nrows()).copy_from(&measurement.transpose());
        first += measurement.nrows();
    }
    let across = covariance * all;
    let mut first = 0;
    let gain = |measurement: &DMatrix<f64>| {
        let n = measurement.nrows();
        first += n;
        log_det(measurement * across.columns(first - n, n))
    };
    measurements.iter().map(gain).collect()
}

/// log det(I + J·P·Jᵀ).
fn gain(covariance: &DMatrix<f64>, jacobian: &DMatrix<f64>) -> f64 {
    log_det(jacobian * across(covariance, jacobian))
}

/// P·Jᵀ, column by column: products of few columns are slow otherwise.
fn across(covariance: &DMatrix<f64>, jacobian: &DMatrix<f64>) -> DMatrix<f64> {
    let mut across = DMatrix::zeros(covariance.nrows(), jacobian.nrows());
    for (row, mut column) in across.column_iter_mut().enumerate() {
        column.gemv(1.0, covariance, &jacobian.row(row).transpose(), 0.0);
    }
    across
}

/// log det(I + M).
fn log_det(square: DMatrix<f64>) -> f64 {
    let n = square.nrows();
    (DMatrix::identity(n, n) + square).determinant().ln()
}

/// P becomes (P⁻¹ + JᵀJ)⁻¹.
fn update(covariance: &mut DMatrix<f64>, jacobian: &DMatrix<f64>) {
    let n = jacobian.nrows();
    let across = across(covariance, jacobian);
    if let Some(inner) = (DMatrix::identity(n, n) + jacobian * &across).try_inverse() {
        let scaled = &across * inner;
        for (left, right) in across.column_iter().zip(scaled.column_iter()) {
            covariance.ger(-1.0, &left, &right, 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_already_is_chosen_last() {
        let measurement = |a: f64, b: f64| DMatrix::from_row_slice(1, 2, &[a, b]);
        let known = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![0.01, 1.0]));
        let order = informative_first(known, &[measurement(1.0, 0.0), measurement(0.0, 1.0), measurement(0.0, 0.9)], 3);
        assert_eq!(order, [1, 2, 0]);
    }

    #[test]
    fn one_measurement_of_each_value_comes_before_repeats() {
        let units: Vec<_> =
            (0..3).flat_map(|k| [k, k]).map(|k| DMatrix::from_fn(1, 3, |_, c| f64::from(u8::from(c == k)))).collect();
        let mut first: Vec<usize> =
            informative_first(DMatrix::identity(3, 3), &units, 3).into_iter().map(|k| k / 2).collect();
        first.sort();
        assert_eq!(first, [0, 1, 2]);
    }
}
