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
    let mut gains: Vec<(f64, usize)> = vec![(f64::INFINITY, 0); measurements.len()];
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

/// log det(I + J·P·Jᵀ).
fn gain(covariance: &DMatrix<f64>, jacobian: &DMatrix<f64>) -> f64 {
    let n = jacobian.nrows();
    (DMatrix::identity(n, n) + jacobian * covariance * jacobian.transpose()).determinant().ln()
}

/// P becomes (P⁻¹ + JᵀJ)⁻¹.
fn update(covariance: &mut DMatrix<f64>, jacobian: &DMatrix<f64>) {
    let n = jacobian.nrows();
    let across = jacobian * &*covariance;
    if let Some(inner) = (DMatrix::identity(n, n) + &across * jacobian.transpose()).try_inverse() {
        covariance.gemm_tr(-1.0, &across, &(inner * &across), 1.0);
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
