//! The columns of all values over the rows that a fit sees, fold by fold and axis by axis.
//!
//! Most values move few axes (a joint's friction moves its own torque alone), so that an axis holds only the columns that
//! are not zero on it. Sums of products and predictions are products of these matrices.

use nalgebra::{DMatrix, DVector};

use crate::prepare::groups::Groups;
use crate::progress::{Cancelled, Progress};

/// The columns of an experiment.
#[derive(Debug)]
pub(super) struct DesignMatrix {
    n_values: usize,
    /// Rows of each fold, among those that a fit sees.
    rows: Vec<Vec<usize>>,
    /// The values that move each axis.
    values: Vec<Vec<usize>>,
    /// By fold and axis: rows of the fold × values of the axis, in the axis's unit.
    blocks: Vec<Vec<DMatrix<f64>>>,
}

impl DesignMatrix {
    /// That of columns with a number for each row (all rows, also those that are held out) and axis.
    pub(super) fn new(groups: &Groups, n_axes: usize, columns: &[&[f64]]) -> Self {
        let of_fold = |fold: usize| (0..groups.folds.len()).filter(|&row| groups.folds[row] == fold).collect();
        let rows: Vec<Vec<usize>> = (0..groups.n_folds).map(of_fold).collect();
        let is_moved =
            |axis: usize, column: &[f64]| groups.training.iter().any(|row| column[row * n_axes + axis] != 0.0);
        let of_axis = |axis: usize| (0..columns.len()).filter(|&value| is_moved(axis, columns[value])).collect();
        let values: Vec<Vec<usize>> = (0..n_axes).map(of_axis).collect();
        let block = |rows: &[usize], axis: usize| {
            let values = &values[axis];
            DMatrix::from_fn(rows.len(), values.len(), |row, value| {
                columns[values[value]][groups.training[rows[row]] * n_axes + axis]
            })
        };
        let blocks = rows.iter().map(|rows| (0..n_axes).map(|axis| block(rows, axis)).collect()).collect();
        Self { n_values: columns.len(), rows, values, blocks }
    }

    /// How many values there are.
    pub(super) fn n_values(&self) -> usize {
        self.n_values
    }

    /// Σ x·number over the rows of a fold, for numbers of each row that a fit sees and axis.
    pub(super) fn products(&self, fold: usize, numbers: &[f64]) -> DVector<f64> {
        let n_axes = self.values.len();
        let mut products = DVector::zeros(self.n_values);
        for (axis, (values, columns)) in self.values.iter().zip(&self.blocks[fold]).enumerate() {
            let own =
                DVector::from_iterator(columns.nrows(), self.rows[fold].iter().map(|row| numbers[row * n_axes + axis]));
            values.iter().zip(columns.tr_mul(&own).iter()).for_each(|(&value, product)| products[value] += product);
        }
        products
    }

    /// How many folds there are.
    pub(super) fn n_folds(&self) -> usize {
        self.rows.len()
    }

    /// The lower triangle of Σ w·x·xᵀ over the rows of a fold, with the column `last` after those of all values; weights and `last` have a
    /// number for each row that a fit sees and axis.
    pub(super) fn sums(
        &self,
        fold: usize,
        weights: &[f64],
        last: &[f64],
        progress: &Progress,
    ) -> Result<DMatrix<f64>, Cancelled> {
        let (p, n_axes) = (self.n_values, self.values.len());
        let mut sums = DMatrix::zeros(p + 1, p + 1);
        for (axis, (values, columns)) in self.values.iter().zip(&self.blocks[fold]).enumerate() {
            progress.check()?;
            let (n, rows) = (values.len(), &self.rows[fold]);
            let of = |numbers: &[f64]| {
                DVector::from_iterator(rows.len(), rows.iter().map(|row| numbers[row * n_axes + axis]))
            };
            let roots = of(weights).map(f64::sqrt);
            let mut weighted = DMatrix::zeros(rows.len(), n + 1);
            for (mut to, from) in weighted.column_iter_mut().zip(columns.column_iter()) {
                to.cmpy(1.0, &from, &roots, 0.0);
            }
            weighted.column_mut(n).cmpy(1.0, &of(last), &roots, 0.0);
            let products = weighted.transpose() * &weighted;
            let place = |k: usize| values.get(k).copied().unwrap_or(p);
            for b in 0..=n {
                let mut column = sums.column_mut(place(b));
                (b..=n).for_each(|a| column[place(a)] += products[(a, b)]);
            }
        }
        Ok(sums)
    }

    /// What values of these sizes add in the rows of a fold, row by row, each with all its axes.
    pub(super) fn moved(&self, fold: usize, sizes: &[f64]) -> Vec<f64> {
        let n_axes = self.values.len();
        let mut moved = vec![0.0; self.rows[fold].len() * n_axes];
        for (axis, (values, columns)) in self.values.iter().zip(&self.blocks[fold]).enumerate() {
            let mut own = DVector::zeros(columns.nrows());
            for (k, &value) in values.iter().enumerate().filter(|(_, value)| sizes[**value] != 0.0) {
                own.axpy(sizes[value], &columns.column(k), 1.0);
            }
            moved.iter_mut().skip(axis).step_by(n_axes).zip(own.iter()).for_each(|(sum, own)| *sum = *own);
        }
        moved
    }

    /// What values of these sizes add in all rows that a fit sees.
    pub(super) fn moved_all(&self, sizes: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.rows.iter().map(Vec::len).sum::<usize>() * self.values.len()];
        (0..self.n_folds()).for_each(|fold| self.put(fold, &self.moved(fold, sizes), &mut all));
        all
    }

    /// What the values add in the rows of a fold for each column of `sizes`, axis by axis: rows of the fold × columns.
    pub(super) fn moved_by_each(
        &self,
        fold: usize,
        sizes: &DMatrix<f64>,
        progress: &Progress,
    ) -> Result<Vec<DMatrix<f64>>, Cancelled> {
        let of_axis = |(values, columns): (&Vec<usize>, &DMatrix<f64>)| {
            progress.check()?;
            Ok(columns * sizes.select_rows(values))
        };
        self.values.iter().zip(&self.blocks[fold]).map(of_axis).collect()
    }

    /// Puts the numbers of a fold's rows at their places among those of all rows that a fit sees.
    pub(super) fn put(&self, fold: usize, of_fold: &[f64], all: &mut [f64]) {
        let n_axes = self.values.len();
        for (row, numbers) in self.rows[fold].iter().zip(of_fold.chunks(n_axes)) {
            all[row * n_axes..(row + 1) * n_axes].copy_from_slice(numbers);
        }
    }

    /// The column of one value over the rows that a fit sees.
    pub(super) fn column(&self, value: usize) -> Vec<f64> {
        let n_axes = self.values.len();
        let mut column = vec![0.0; self.rows.iter().map(Vec::len).sum::<usize>() * n_axes];
        for (axis, values) in self.values.iter().enumerate() {
            let Ok(k) = values.binary_search(&value) else { continue };
            for (rows, blocks) in self.rows.iter().zip(&self.blocks) {
                rows.iter()
                    .zip(blocks[axis].column(k).iter())
                    .for_each(|(row, slope)| column[row * n_axes + axis] = *slope);
            }
        }
        column
    }
}
