//! Terms that a residual may depend on, and what each of them takes from it.

use darm_core::effect::fitted_term::Variable;
use nalgebra::{DMatrix, DVector};

use crate::least_squares::pseudo_inverse;
use crate::outcome::{Regressor, Shape};
use crate::select::significance::f_test;

/// A term of a dictionary.
pub struct Term {
    /// What the residual may depend on.
    pub regressor: Regressor,
    /// How the residual may depend on it.
    pub shape: Shape,
    /// One number a row in each.
    pub columns: Vec<Vec<f64>>,
    /// What an arm's model may keep of it: variables, and whether their squares. Empty of what does not come again, as a time.
    pub kept: Vec<(Variable<f64>, bool)>,
}

/// A term made ready for regression.
pub struct Design<'a> {
    /// The term.
    pub term: &'a Term,
    /// The rows that a fit sees.
    rows: &'a [usize],
    columns: DMatrix<f64>,
    inverse: DMatrix<f64>,
}

/// What a term takes from some residuals.
pub struct Taken {
    /// Fall of the squares, and what is left of them.
    pub square: f64,
    rest: f64,
    /// Columns, rows, axes.
    size: [usize; 3],
    /// n·ln(share left) + k·ln n: below zero the term is worth its columns.
    pub criterion: f64,
    /// The residuals of all rows without it.
    pub left: Vec<f64>,
}

impl<'a> Design<'a> {
    /// Fitted to these rows; `None` where the columns are constant there or too many.
    pub fn new(term: &'a Term, rows: &'a [usize]) -> Option<Self> {
        let varies = |column: &DVector<f64>| rows.iter().any(|&row| column[row].abs() > 1e-12);
        let centred: Vec<DVector<f64>> = term.columns.iter().map(|c| centred(c, rows)).filter(varies).collect();
        if centred.is_empty() || rows.len() < centred.len() + 2 {
            return None;
        }
        let columns = DMatrix::from_columns(&centred);
        let seen = columns.select_rows(rows);
        let inverse = pseudo_inverse(&seen.tr_mul(&seen));
        Some(Self { term, rows, columns, inverse })
    }

    /// Least squares on each axis of `residuals`, all rows × axes.
    pub fn take(&self, residuals: &[f64]) -> Taken {
        let k = self.columns.ncols();
        let n_axes = residuals.len() / self.columns.nrows();
        let (mut total, mut square, mut left) = (0.0, 0.0, residuals.to_vec());
        for axis in 0..n_axes {
            let y = centred(&of_axis(residuals, n_axes, axis), self.rows);
            let mut along = DVector::zeros(k);
            for &row in self.rows {
                along += self.columns.row(row).transpose() * y[row];
                total += y[row] * y[row];
            }
            let slopes = &self.inverse * &along;
            square += along.dot(&slopes);
            let fitted = &self.columns * slopes;
            left.iter_mut().skip(axis).step_by(n_axes).zip(fitted.iter()).for_each(|(left, fitted)| *left -= fitted);
        }
        let rest = (total - square).max(f64::MIN_POSITIVE);
        let (n, dof) = ((self.rows.len() * n_axes) as f64, (k * n_axes) as f64);
        let criterion = n * (rest / total.max(f64::MIN_POSITIVE)).ln() + dof * n.ln();
        Taken { square, rest, size: [k, self.rows.len(), n_axes], criterion, left }
    }
}

impl Taken {
    /// Chance of such a reduction where there is none, with this autocorrelation time of the rows.
    pub fn p(&self, repeats: f64) -> f64 {
        let [columns, rows, axes] = self.size;
        let n = (rows as f64 / repeats) as usize;
        let (dof, rest_dof) = (columns * axes, n.saturating_sub(1 + columns) * axes);
        f_test(self.square / dof as f64 / (self.rest / rest_dof as f64), dof, rest_dof)
    }
}

/// One axis of rows × axes.
pub fn of_axis(numbers: &[f64], n_axes: usize, axis: usize) -> Vec<f64> {
    numbers.iter().skip(axis).step_by(n_axes).copied().collect()
}

/// The sum of the squares of some rows about their mean.
pub fn squares(numbers: &[f64], rows: &[usize]) -> f64 {
    let centred = centred(numbers, rows);
    rows.iter().map(|&row| centred[row].powi(2)).sum()
}

/// Numbers less their mean over some rows.
pub fn centred(values: &[f64], rows: &[usize]) -> DVector<f64> {
    let mean = rows.iter().map(|&row| values[row]).sum::<f64>() / rows.len().max(1) as f64;
    DVector::from_iterator(values.len(), values.iter().map(|value| value - mean))
}
