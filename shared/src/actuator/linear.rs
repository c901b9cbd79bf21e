//! Solver of a few linear equations: Gaussian elimination with partial pivoting, on the stack.
#![allow(clippy::needless_range_loop, reason = "the indices are the mathematics")]

use crate::real::Real;

/// x of A·x = b, and the determinant of A: where that is 0, x means nothing.
#[inline]
pub(crate) fn solve<T: Real, const M: usize>(matrix: &[[T; M]; M], right: &[T; M]) -> ([T; M], T) {
    let (mut a, mut x) = (*matrix, *right);
    let mut determinant = T::one();
    for k in 0..M {
        let pivot = (k + 1..M).fold(k, |best, i| if a[i][k].abs() > a[best][k].abs() { i } else { best });
        if pivot != k {
            a.swap(k, pivot);
            x.swap(k, pivot);
            determinant = -determinant;
        }
        determinant *= a[k][k];
        if a[k][k] == T::zero() {
            break;
        }
        a[k][k] = T::one() / a[k][k];
        for i in k + 1..M {
            let factor = a[i][k] * a[k][k];
            for j in k + 1..M {
                a[i][j] -= factor * a[k][j];
            }
            x[i] -= factor * x[k];
        }
    }
    for k in (0..M).rev() {
        for j in k + 1..M {
            x[k] -= a[k][j] * x[j];
        }
        x[k] *= a[k][k];
    }
    (x, determinant)
}

/// Aᵀ.
pub(crate) fn transposed<T: Real, const M: usize>(matrix: &[[T; M]; M]) -> [[T; M]; M] {
    core::array::from_fn(|i| core::array::from_fn(|j| matrix[j][i]))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Vector6};
    use proptest::prelude::*;

    use super::*;
    use crate::arms::seeded;

    proptest! {
        #![proptest_config(seeded(256))]

        #[test]
        fn solves_both_ways(entries in prop::collection::vec(-1.0..1.0, 36), right in prop::array::uniform6(-1.0..1.0)) {
            let matrix = Matrix6::<f64>::from_row_slice(&entries);
            prop_assume!(matrix.determinant().abs() > 1e-3);
            let rows = core::array::from_fn(|i| core::array::from_fn(|j| matrix[(i, j)]));
            let (x, determinant) = solve(&rows, &right);
            prop_assert!((matrix * Vector6::from(x) - Vector6::from(right)).norm() < 1e-11);
            prop_assert!((determinant - matrix.determinant()).abs() < 1e-12);
            let (x, _) = solve(&transposed(&rows), &right);
            prop_assert!((matrix.transpose() * Vector6::from(x) - Vector6::from(right)).norm() < 1e-11);
        }
    }

    #[test]
    fn a_singular_matrix_has_no_determinant() {
        assert_eq!(solve(&[[1.0, 2.0], [2.0, 4.0]], &[1.0, 1.0]).1, 0.0);
        assert_eq!(solve(&[[0.0, 0.0], [0.0, 0.0]], &[1.0, 1.0]).1, 0.0);
    }
}
