//! The same search many times, and what its runs have in common.

use std::time::Instant;

use darm_core::ik::Options;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use super::arm::Problem;
use super::method::{Method, solve};
use super::objective::{Distance, Objective as _};
use super::search::{Mark, Run, Settings, minimise};

/// Runs that differ by their seeds alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trials {
    /// In the order of their seeds.
    pub runs: Vec<Run>,
}

/// Runs of one method, each from a random start.
#[derive(Clone, Copy, Debug)]
pub struct Experiment<'a> {
    /// The method.
    pub method: Method,
    /// Tolerances, and the steps of a method that linearises.
    pub options: &'a Options<f64>,
    /// The population of a search, and the first of the seeds.
    pub settings: &'a Settings,
    /// How many runs.
    pub runs: usize,
}

/// What runs came to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The least value.
    pub best: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation, with n − 1.
    pub deviation: f64,
    /// Median.
    pub median: f64,
    /// The greatest value.
    pub worst: f64,
    /// Evaluations of a run, mean.
    pub evaluations: f64,
    /// Time of a run, s, mean.
    pub time_s: f64,
}

impl Trials {
    /// As many runs, on all cores, with the seeds `seed`, `seed` + 1, …
    pub fn new(runs: usize, seed: u64, run: impl Fn(u64) -> Run + Sync) -> Self {
        Self { runs: (0..runs as u64).into_par_iter().map(|index| run(seed.wrapping_add(index))).collect() }
    }

    /// The values in order, the least first.
    pub fn values(&self) -> Vec<f64> {
        let mut values: Vec<_> = self.runs.iter().map(|run| run.value).collect();
        values.sort_by(f64::total_cmp);
        values
    }

    /// How many runs came to `value` or below.
    pub fn within(&self, value: f64) -> usize {
        self.runs.iter().filter(|run| run.value <= value).count()
    }

    /// What they came to; not a number where there is none.
    pub fn summary(&self) -> Summary {
        let values = self.values();
        let mean_of = |of: fn(&Run) -> f64| self.runs.iter().map(of).sum::<f64>() / self.runs.len() as f64;
        let mean = mean_of(|run| run.value);
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let at = |index: usize| values.get(index).copied().unwrap_or(f64::NAN);
        Summary {
            best: at(0),
            mean,
            deviation: (squares / values.len().saturating_sub(1) as f64).sqrt(),
            median: 0.5 * (at(values.len() / 2) + at(values.len().saturating_sub(1) / 2)),
            worst: at(values.len().saturating_sub(1)),
            evaluations: mean_of(|run| run.evaluations as f64),
            time_s: mean_of(|run| run.time_s),
        }
    }
}

/// One run of any method to a target: a search by `settings`, or steps by `options` from a start drawn within the
/// limits.
///
/// A linearisation gives the pose and one column of the Jacobian for each joint: of n joints it counts as 1 + n
/// evaluations.
pub fn run(method: Method, problem: Problem<'_>, settings: &Settings) -> Run {
    let distance = Distance::new(problem);
    if let Method::Population(algorithm) = method {
        return minimise(algorithm, &distance, settings);
    }
    let begin = Instant::now();
    let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
    let start: Vec<_> =
        distance.bounds().iter().map(|[low, high]| low + (high - low) * random.random::<f64>()).collect();
    let options = &Options { seed: settings.seed, ..*problem.options };
    let mut values = Vec::new();
    let found = solve(method, Problem { options, ..problem }, &start, |_, error| values.push(distance.of(error)));
    let each = 1 + distance.bounds().len();
    let mut lowest = f64::INFINITY;
    let history = values.iter().enumerate().map(|(index, value)| {
        lowest = lowest.min(*value);
        Mark { evaluations: each * (index + 1), value: lowest }
    });
    let history: Vec<_> = history.collect();
    Run { x: found.x, value: lowest, evaluations: each * history.len(), time_s: begin.elapsed().as_secs_f64(), history }
}

#[cfg(test)]
mod tests {
    use super::{Run, Trials};

    #[test]
    fn runs_are_summed_up() {
        let run = |seed| Run { x: vec![], value: seed as f64, evaluations: 10, time_s: 0.5, history: vec![] };
        let trials = Trials::new(4, 1, run);
        let summary = trials.summary();
        assert_eq!((summary.best, summary.mean, summary.median, summary.worst), (1.0, 2.5, 2.5, 4.0));
        // (1.5² + 0.5² + 0.5² + 1.5²) / 3
        assert!((summary.deviation.powi(2) - 5.0 / 3.0).abs() < 1e-15);
        assert_eq!((trials.within(2.0), summary.evaluations, summary.time_s), (2, 10.0, 0.5));
        assert!(Trials::new(0, 1, run).summary().mean.is_nan());
    }
}
