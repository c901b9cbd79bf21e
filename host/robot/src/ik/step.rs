//! One step of each method of any number of joints: motions that take away an error, as far as the linearised arm goes.
//!
//! The formulas and their source are those of [`darm_core::ik`], whose steps have their size at compile time.

use darm_core::real::Vec6;
use darm_core::se::Twist;
use nalgebra::{DMatrix, Matrix6, Matrix6xX};

use crate::svd::svd;

/// Singular values below this part of the largest are rounding.
const RANK: f64 = 64.0 * f64::EPSILON;

/// The error and the Jacobian with their angular and linear rows times these weights: (ℓ, 1) holds one radian equal to ℓ
/// metres, and zero leaves a part out.
pub(super) fn scaled(
    error: &Twist<f64>,
    mut jacobian: Matrix6xX<f64>,
    [angular, linear]: [f64; 2],
) -> (Vec6<f64>, Matrix6xX<f64>) {
    jacobian.fixed_rows_mut::<3>(0).scale_mut(angular);
    jacobian.fixed_rows_mut::<3>(3).scale_mut(linear);
    (Twist { angular: error.angular * angular, linear: error.linear * linear }.to_vector(), jacobian)
}

/// J⁻¹ ε; `None` where J has no inverse. Rows of zeros, which no joint moves or which were left out, do not count.
pub(super) fn inverse(jacobian: &Matrix6xX<f64>, error: &Vec6<f64>) -> Option<Vec<f64>> {
    let rows: Vec<usize> = (0..6).filter(|&row| jacobian.row(row).iter().any(|entry| *entry != 0.0)).collect();
    if rows.len() != jacobian.ncols() {
        return None;
    }
    let square = DMatrix::from_fn(rows.len(), rows.len(), |row, column| jacobian[(rows[row], column)]);
    let factors = square.lu();
    if factors.u().diagonal().iter().any(|pivot| pivot.abs() <= f64::EPSILON) {
        return None;
    }
    factors.solve(&error.select_rows(&rows)).map(|step| step.iter().copied().collect())
}

/// J⁺ ε: of all steps that leave the least error the shortest.
pub(super) fn pseudo_inverse(jacobian: &Matrix6xX<f64>, error: &Vec6<f64>) -> Vec<f64> {
    if jacobian.is_empty() {
        return Vec::new();
    }
    let step = svd(jacobian).and_then(|parts| parts.solve(error, RANK * parts.singular_values.max()).ok());
    step.map_or_else(|| vec![0.0; jacobian.ncols()], |step| step.iter().copied().collect())
}

/// α Jᵀ ε with the α that leaves least of the error.
pub(super) fn transpose(jacobian: &Matrix6xX<f64>, error: &Vec6<f64>) -> Vec<f64> {
    let pull = jacobian.tr_mul(error);
    let moved = jacobian * &pull;
    let square = moved.norm_squared();
    let alpha = if square > 0.0 { error.dot(&moved) / square } else { 0.0 };
    pull.iter().map(|pull| pull * alpha).collect()
}

/// Jᵀ (J Jᵀ + μ 1)⁻¹ ε: the step that makes |J ε_Θ − ε|² + μ |ε_Θ|² least, μ above zero.
pub(super) fn damped(jacobian: &Matrix6xX<f64>, error: &Vec6<f64>, damping: f64) -> Vec<f64> {
    let matrix = jacobian * jacobian.transpose() + Matrix6::from_diagonal_element(damping);
    let Some(factors) = matrix.cholesky() else { return vec![0.0; jacobian.ncols()] };
    jacobian.tr_mul(&factors.solve(error)).iter().copied().collect()
}
