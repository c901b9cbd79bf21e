//! Measurements chosen for information: D-optimal design.
//!
//! A measurement with the derivatives J of its residual with respect to all values adds JᵀJ to the information M; the
//! set with the largest det M makes the confidence ellipsoid of the values smallest. Chosen one after the other, the
//! largest gain log det(I + J·M⁻¹·Jᵀ) first; a gain only falls while others are chosen, so most of them need not be
//! computed again.
//!
//! Of one measurement, I + J·M⁻¹·Jᵀ is its block of I + J·P·Jᵀ of all measurements, with P = M⁻¹ before any is chosen, without
//! what those that were chosen leave of it: the Schur complement, computed row by row as in a Cholesky factorisation.
//!
//! Sources: Fedorov, Theory of Optimal Experiments, Academic Press, 1972; G. H. Golub, C. F. Van Loan, Matrix
//! Computations, 4th ed., 2013, §4.2.9.

use nalgebra::{Cholesky, DMatrix, Dyn};

/// The numbers of `n` measurements, the most informative first; `covariance` is the inverse of the information that
/// there is before.
pub fn informative_first(covariance: DMatrix<f64>, measurements: &[DMatrix<f64>], n: usize) -> Vec<usize> {
    let mut all = of_all(&covariance, measurements);
    let mut open: Vec<usize> = (0..all.len()).collect();
    let mut chosen: Vec<Chosen> = Vec::new();
    let mut n_rows = 0;
    while chosen.len() < n && !open.is_empty() {
        let best = loop {
            let position =
                (0..open.len()).max_by(|&a, &b| all[open[a]].gain.total_cmp(&all[open[b]].gain)).unwrap_or(0);
            let measurement = &mut all[open[position]];
            if measurement.n_known == chosen.len() {
                break open.swap_remove(position);
            }
            measurement.learn(&chosen, n_rows);
        };
        let next = Chosen::new(&mut all[best], best, n_rows);
        n_rows += next.rows();
        chosen.push(next);
    }
    chosen.into_iter().map(|one| one.number).collect()
}

/// A measurement beside those that were chosen.
struct Measurement<'a> {
    /// J, rows × values.
    slopes: &'a DMatrix<f64>,
    /// P·Jᵀ.
    spread: DMatrix<f64>,
    /// Its columns of the factorisation: rows that were chosen × its own rows.
    factor: DMatrix<f64>,
    /// I + J·P·Jᵀ, less what the chosen ones that it knows leave of it.
    left: DMatrix<f64>,
    /// How many of them it knows.
    n_known: usize,
    /// log det of what is left.
    gain: f64,
}

/// A measurement that was chosen.
struct Chosen<'a> {
    number: usize,
    slopes: &'a DMatrix<f64>,
    factor: DMatrix<f64>,
    root: Cholesky<f64, Dyn>,
}

/// All measurements, before any is chosen; what they spread in one product.
fn of_all<'a>(covariance: &DMatrix<f64>, measurements: &'a [DMatrix<f64>]) -> Vec<Measurement<'a>> {
    let n_rows = measurements.iter().map(DMatrix::nrows).sum();
    let mut all = DMatrix::zeros(covariance.nrows(), n_rows);
    let mut first = 0;
    for measurement in measurements {
        all.columns_mut(first, measurement.nrows()).copy_from(&measurement.transpose());
        first += measurement.nrows();
    }
    let spread = covariance * all;
    let mut first = 0;
    let measurement = |slopes: &'a DMatrix<f64>| {
        first += slopes.nrows();
        Measurement::new(slopes, spread.columns(first - slopes.nrows(), slopes.nrows()).into_owned())
    };
    measurements.iter().map(measurement).collect()
}

impl<'a> Measurement<'a> {
    /// Before any is chosen.
    fn new(slopes: &'a DMatrix<f64>, spread: DMatrix<f64>) -> Self {
        let n = slopes.nrows();
        let left = DMatrix::identity(n, n) + slopes * &spread;
        let gain = left.determinant().ln();
        Self { slopes, spread, factor: DMatrix::zeros(0, n), left, n_known: 0, gain }
    }

    /// Takes in those chosen ones, of `n_rows` together, that it does not know yet.
    fn learn(&mut self, chosen: &[Chosen], n_rows: usize) {
        let mut factor = self.take_factor(n_rows);
        for one in &chosen[self.n_known..] {
            let before = one.factor.nrows();
            let mut cross = one.slopes * &self.spread - one.factor.tr_mul(&factor.rows(0, before));
            one.root.l_dirty().solve_lower_triangular_mut(&mut cross);
            self.left -= cross.tr_mul(&cross);
            factor.rows_mut(before, one.rows()).copy_from(&cross);
        }
        (self.factor, self.n_known, self.gain) = (factor, chosen.len(), self.left.determinant().ln());
    }

    /// Its columns of the factorisation, with room for this number of rows.
    fn take_factor(&mut self, n_rows: usize) -> DMatrix<f64> {
        std::mem::replace(&mut self.factor, DMatrix::zeros(0, 0)).resize_vertically(n_rows, 0.0)
    }
}

impl<'a> Chosen<'a> {
    /// A measurement that knows all that were chosen before, of `n_rows` together, and is open no longer.
    fn new(measurement: &mut Measurement<'a>, number: usize, n_rows: usize) -> Self {
        let n = measurement.left.nrows();
        // What is left is at least the identity.
        let root =
            Cholesky::new(measurement.left.clone()).unwrap_or_else(|| Cholesky::pack_dirty(DMatrix::identity(n, n)));
        Self { number, slopes: measurement.slopes, factor: measurement.take_factor(n_rows), root }
    }

    fn rows(&self) -> usize {
        self.slopes.nrows()
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Each choice by det M itself, of all measurements that are open.
    #[test]
    fn each_choice_makes_the_information_largest() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut matrix = |rows: usize| DMatrix::from_fn(rows, 6, |_, _| random.random_range(-2.0..2.0));
        let measurements: Vec<DMatrix<f64>> = (0..40).map(|k| matrix(1 + k % 3)).collect();
        let mut information = matrix(8);
        information = information.tr_mul(&information);
        let with = |information: &DMatrix<f64>, k: usize| information + measurements[k].tr_mul(&measurements[k]);
        let covariance = information.clone().try_inverse().expect("eight rows determine six values");
        let order = informative_first(covariance, &measurements, 30);
        let mut open: Vec<usize> = (0..measurements.len()).collect();
        for chosen in order {
            let largest = open.iter().map(|&k| with(&information, k).determinant()).fold(0.0, f64::max);
            information = with(&information, chosen);
            assert!(information.determinant() >= largest * (1.0 - 1e-9));
            assert!(open.contains(&chosen), "each is chosen once");
            open.retain(|&k| k != chosen);
        }
    }

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
