//! Normal equations of all values of an experiment, and of any information matrix.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

/// Share of the information that is added to each value's own, so that what is not determined stays small.
const RIDGE: f64 = 1e-9;

/// The normal equations A·x = −g of all values, each scaled by its own information and made safe by a share of [`RIDGE`].
///
/// Most models have few of the values, so that the entries of A are computed where they are needed.
#[derive(Clone, Debug)]
pub(super) struct System {
    /// Sums over all rows, and over those that are left out: their lower triangles.
    all: Arc<DMatrix<f64>>,
    left_out: Option<Arc<DMatrix<f64>>>,
    autocorrelation_time: f64,
    priors: Arc<[f64]>,
    /// g.
    pub(super) gradient: DVector<f64>,
    /// What x is multiplied by to be in the values' units.
    pub(super) scale: DVector<f64>,
}

impl System {
    /// The equations of sums of products of columns over all rows, the residual last, less those over the rows that are left out.
    pub(super) fn new(
        all: &Arc<DMatrix<f64>>,
        left_out: Option<Arc<DMatrix<f64>>>,
        autocorrelation_time: f64,
        priors: &Arc<[f64]>,
    ) -> Self {
        let n = priors.len();
        let mut system = Self {
            all: Arc::clone(all),
            left_out,
            autocorrelation_time,
            priors: Arc::clone(priors),
            gradient: DVector::zeros(n),
            scale: DVector::zeros(n),
        };
        let scale = |own: f64| if own > 0.0 { own.sqrt().recip() } else { 0.0 };
        system.scale = DVector::from_fn(n, |k, _| scale(system.sum(k, k)));
        system.gradient = DVector::from_fn(n, |k, _| system.sum(n, k) * system.scale[k]);
        system
    }

    fn sum(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (a.max(b), a.min(b));
        let sum = self.all[(a, b)] - self.left_out.as_ref().map_or(0.0, |left_out| left_out[(a, b)]);
        sum / self.autocorrelation_time + if a == b { self.priors[a] } else { 0.0 }
    }

    /// A, its diagonal about 1.
    pub(super) fn entry(&self, a: usize, b: usize) -> f64 {
        let ridge = match self.scale[a] {
            _ if a != b => 0.0,
            scale if scale > 0.0 => RIDGE,
            _ => 1.0,
        };
        self.sum(a, b) * self.scale[a] * self.scale[b] + ridge
    }

    /// Adds `more`, in the values' units, to the sums of g.
    pub(super) fn with(&self, more: &DVector<f64>) -> Self {
        let gradient = &self.gradient + more.component_mul(&self.scale) / self.autocorrelation_time;
        Self { gradient, ..self.clone() }
    }

    /// All values in their units, from those with these numbers.
    pub(super) fn unscaled(&self, indices: &[usize], values: &DVector<f64>) -> Vec<f64> {
        let mut all = vec![0.0; self.scale.len()];
        indices.iter().zip(values.iter()).for_each(|(&k, value)| all[k] = value * self.scale[k]);
        all
    }
}

/// x with A·x = b for an information matrix A scaled to its diagonal, by Cholesky after a share of [`RIDGE`] is added to the
/// diagonal; zero where that is not positive definite.
pub(super) fn solve_with_ridge(mut information: DMatrix<f64>, gradient: &DVector<f64>) -> DVector<f64> {
    let scale = information.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    for (column, by) in scale.iter().enumerate() {
        for (row, other) in scale.iter().enumerate() {
            information[(row, column)] *= by * other;
        }
        information[(column, column)] += if *by > 0.0 { RIDGE } else { 1.0 };
    }
    match information.cholesky() {
        Some(root) => root.solve(&gradient.component_mul(&scale)).component_mul(&scale),
        None => DVector::zeros(gradient.len()),
    }
}
