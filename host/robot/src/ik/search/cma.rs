//! Covariance matrix adaptation, (μ/μ_w, λ): Hansen, The CMA Evolution Strategy: A Tutorial, arXiv 1604.00772.
//!
//! Constants are the tutorial's defaults, variables are scaled to their ranges, σ begins at 0.3. A point outside its
//! bounds is folded back at them, as a mirror would. A strategy whose steps or values no longer differ starts again
//! elsewhere with twice as many points (Auger, Hansen 2005).
//!
//! Written here because the crate `cmaes` 0.2 would bring second, older copies of nalgebra, rand and statrs.

use nalgebra::{DMatrix, DVector};
use rand::RngExt as _;
use rand_distr::StandardNormal;

use super::Search;

/// σ at the start, over the range of each variable.
const STEP: f64 = 0.3;
/// A strategy has ended when σ times the longest axis is below this, or its values differ by less than it.
const MIN_SPREAD: f64 = 1e-15;
/// Most doublings of the number of points.
const DOUBLINGS: u32 = 8;

/// Searches, with restarts until it is stopped.
pub(super) fn search(search: &mut Search<'_>) {
    let first = 4 + (3.0 * (search.bounds.len() as f64).ln()) as usize;
    let x = search.draw();
    search.evaluate(x);
    for restart in 0.. {
        let mut strategy = Strategy::new(search, first << restart.min(DOUBLINGS));
        loop {
            if !search.goes_on() {
                return;
            }
            if strategy.has_ended() {
                break;
            }
            strategy.advance(search);
        }
    }
}

/// The tutorial's state and constants, by its names.
struct Strategy {
    weights: Vec<f64>,
    mu_eff: f64,
    points: usize,
    c_sigma: f64,
    d_sigma: f64,
    c_c: f64,
    c_1: f64,
    c_mu: f64,
    /// E|N(0, 1)|.
    chi: f64,
    mean: DVector<f64>,
    sigma: f64,
    covariance: DMatrix<f64>,
    /// Its eigenvectors, and the square roots of its eigenvalues.
    axes: DMatrix<f64>,
    lengths: DVector<f64>,
    path_sigma: DVector<f64>,
    path_c: DVector<f64>,
    generation: i32,
    /// By how much the values of the last generation differed.
    spread: f64,
}

impl Strategy {
    fn new(search: &mut Search<'_>, points: usize) -> Self {
        let n = search.bounds.len();
        let size = n as f64;
        let half = (points as f64 + 1.0) / 2.0;
        let raw: Vec<f64> = (1..=points / 2).map(|rank| half.ln() - (rank as f64).ln()).collect();
        let sum: f64 = raw.iter().sum();
        let weights: Vec<f64> = raw.iter().map(|weight| weight / sum).collect();
        let mu_eff = 1.0 / weights.iter().map(|weight| weight * weight).sum::<f64>();
        let c_sigma = (mu_eff + 2.0) / (size + mu_eff + 5.0);
        let c_1 = 2.0 / ((size + 1.3).powi(2) + mu_eff);
        let c_mu = (2.0 * (0.25 + mu_eff + 1.0 / mu_eff - 2.0) / ((size + 2.0).powi(2) + mu_eff)).min(1.0 - c_1);
        Self {
            weights,
            mu_eff,
            points,
            c_sigma,
            d_sigma: 1.0 + 2.0 * (((mu_eff - 1.0) / (size + 1.0)).sqrt() - 1.0).max(0.0) + c_sigma,
            c_c: (4.0 + mu_eff / size) / (size + 4.0 + 2.0 * mu_eff / size),
            c_1,
            c_mu,
            chi: size.sqrt() * (1.0 - 1.0 / (4.0 * size) + 1.0 / (21.0 * size * size)),
            mean: DVector::from_fn(n, |_, _| search.random.random::<f64>()),
            sigma: STEP,
            covariance: DMatrix::identity(n, n),
            axes: DMatrix::identity(n, n),
            lengths: DVector::repeat(n, 1.0),
            path_sigma: DVector::zeros(n),
            path_c: DVector::zeros(n),
            generation: 0,
            spread: f64::INFINITY,
        }
    }

    fn has_ended(&self) -> bool {
        let longest = self.sigma * self.lengths.max();
        !(longest > MIN_SPREAD && longest.is_finite() && self.spread > MIN_SPREAD)
    }

    /// One generation.
    fn advance(&mut self, search: &mut Search<'_>) {
        let n = self.mean.len();
        let mut drawn: Vec<(DVector<f64>, f64)> = Vec::with_capacity(self.points);
        for _ in 0..self.points {
            let normal = DVector::from_fn(n, |_, _| search.random.sample::<f64, _>(StandardNormal));
            let step = &self.axes * normal.component_mul(&self.lengths);
            let place = &self.mean + self.sigma * &step;
            let scaled = place.iter().zip(search.bounds).map(|(x, [low, high])| low + (high - low) * folded(*x));
            let value = search.evaluate(scaled.collect()).value;
            drawn.push((step, value));
        }
        drawn.sort_by(|a, b| a.1.total_cmp(&b.1));
        self.spread = drawn.last().map_or(0.0, |(_, worst)| worst - drawn[0].1);
        self.adapt(&drawn);
    }

    /// Equations (41) to (47) of the tutorial, without negative weights.
    fn adapt(&mut self, drawn: &[(DVector<f64>, f64)]) {
        let n = self.mean.len();
        let mut step = DVector::zeros(n);
        self.weights.iter().zip(drawn).for_each(|(weight, (y, _))| step.axpy(*weight, y, 1.0));
        self.mean.axpy(self.sigma, &step, 1.0);
        self.generation += 1;
        let whitened = &self.axes * self.axes.tr_mul(&step).component_div(&self.lengths);
        let keep = (self.c_sigma * (2.0 - self.c_sigma) * self.mu_eff).sqrt();
        self.path_sigma = (1.0 - self.c_sigma) * &self.path_sigma + keep * whitened;
        let length = self.path_sigma.norm();
        let settled = (1.0 - (1.0 - self.c_sigma).powi(2 * self.generation)).sqrt();
        let is_slow = length / settled < (1.4 + 2.0 / (n as f64 + 1.0)) * self.chi;
        let along = if is_slow { (self.c_c * (2.0 - self.c_c) * self.mu_eff).sqrt() } else { 0.0 };
        self.path_c = (1.0 - self.c_c) * &self.path_c + along * &step;
        let lost = if is_slow { 0.0 } else { self.c_c * (2.0 - self.c_c) };
        self.covariance *= 1.0 - self.c_1 - self.c_mu + self.c_1 * lost;
        self.covariance.ger(self.c_1, &self.path_c, &self.path_c, 1.0);
        for (weight, (y, _)) in self.weights.iter().zip(drawn) {
            self.covariance.ger(self.c_mu * weight, y, y, 1.0);
        }
        self.sigma *= ((self.c_sigma / self.d_sigma) * (length / self.chi - 1.0)).exp();
        if self.covariance.iter().all(|entry| entry.is_finite()) {
            let eigen = self.covariance.clone().symmetric_eigen();
            self.lengths = eigen.eigenvalues.map(|value| value.max(1e-300).sqrt());
            self.axes = eigen.eigenvectors;
        } else {
            self.spread = 0.0;
        }
    }
}

/// A number folded into 0 to 1 by mirrors at both ends.
fn folded(x: f64) -> f64 {
    let period = x.rem_euclid(2.0);
    period.min(2.0 - period)
}

#[cfg(test)]
mod tests {
    use super::folded;

    #[test]
    fn mirrors_fold() {
        for (x, inside) in [(0.25, 0.25), (-0.25, 0.25), (1.25, 0.75), (2.25, 0.25), (-1.25, 0.75)] {
            assert_eq!(folded(x), inside);
        }
    }
}
