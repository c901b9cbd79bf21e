//! Solver of a few linear equations: LU with partial pivoting, on the stack.
#![allow(clippy::needless_range_loop, reason = "the indices are the mathematics")]

use crate::real::Real;

/// The factors of a square matrix: rows permuted by `order`, L below the diagonal (of ones), U above and on it.
pub(crate) struct Lu<T, const M: usize> {
    factors: [[T; M]; M],
    order: [usize; M],
    /// Its determinant over the product of its largest entries by columns: free of units, 0 where singular.
    pub(crate) determinant: T,
}

impl<T: Real, const M: usize> Lu<T, M> {
    /// Factors of `matrix`. Of a singular one the `determinant` is 0 and solutions are not finite.
    pub(crate) fn new(matrix: [[T; M]; M]) -> Self {
        let mut a = matrix;
        let mut order: [usize; M] = core::array::from_fn(|i| i);
        let mut determinant = T::one();
        for k in 0..M {
            determinant /= (0..M).fold(T::default_epsilon(), |most, i| most.max(matrix[i][k].abs()));
            let mut pivot = k;
            for i in k + 1..M {
                if a[i][k].abs() > a[pivot][k].abs() {
                    pivot = i;
                }
            }
            if pivot != k {
                a.swap(k, pivot);
                order.swap(k, pivot);
                determinant = -determinant;
            }
            determinant *= a[k][k];
            if a[k][k] == T::zero() {
                break;
            }
            let reciprocal = T::one() / a[k][k];
            for i in k + 1..M {
                let factor = a[i][k] * reciprocal;
                a[i][k] = factor;
                for j in k + 1..M {
                    a[i][j] -= factor * a[k][j];
                }
            }
        }
        Self { factors: a, order, determinant }
    }

    /// x of A·x = `right`.
    pub(crate) fn solve(&self, right: &[T; M]) -> [T; M] {
        let a = &self.factors;
        let mut x = [T::zero(); M];
        for i in 0..M {
            x[i] = right[self.order[i]];
            for j in 0..i {
                x[i] -= a[i][j] * x[j];
            }
        }
        for i in (0..M).rev() {
            for j in i + 1..M {
                x[i] -= a[i][j] * x[j];
            }
            x[i] /= a[i][i];
        }
        x
    }

    /// x of Aᵀ·x = `right`.
    pub(crate) fn solve_transposed(&self, right: &[T; M]) -> [T; M] {
        let a = &self.factors;
        let mut y = *right;
        for i in 0..M {
            for j in 0..i {
                y[i] -= a[j][i] * y[j];
            }
            y[i] /= a[i][i];
        }
        for i in (0..M).rev() {
            for j in i + 1..M {
                y[i] -= a[j][i] * y[j];
            }
        }
        let mut x = [T::zero(); M];
        for i in 0..M {
            x[self.order[i]] = y[i];
        }
        x
    }
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
            let lu = Lu::new(core::array::from_fn(|i| core::array::from_fn(|j| matrix[(i, j)])));
            let right_vector = Vector6::from(right);
            let x = Vector6::from(lu.solve(&right));
            prop_assert!((matrix * x - right_vector).norm() < 1e-11);
            let x = Vector6::from(lu.solve_transposed(&right));
            prop_assert!((matrix.transpose() * x - right_vector).norm() < 1e-11);
            let scale: f64 = (0..6).map(|j| matrix.column(j).amax()).product();
            prop_assert!((lu.determinant * scale - matrix.determinant()).abs() < 1e-12);
        }
    }

    #[test]
    fn a_singular_matrix_has_no_determinant() {
        assert_eq!(Lu::new([[1.0, 2.0], [2.0, 4.0]]).determinant, 0.0);
        assert_eq!(Lu::new([[0.0, 0.0], [0.0, 0.0]]).determinant, 0.0);
    }
}
