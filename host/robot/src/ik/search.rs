//! Searches of a bounded function by a population of points: what they are given, what they keep, what stops them.
//!
//! | algorithm | file | source |
//! | --- | --- | --- |
//! | [`Algorithm::Em`], [`Algorithm::Memr`] | `em`, `memr` | Abed, Koh, Sahari, Tiong, Tan; Birbil, Fang 2003 |
//! | [`Algorithm::Genetic`] | `genetic` | the same paper's settings |
//! | [`Algorithm::DifferentialEvolution`] | `differential` | Storn, Price 1997 |
//! | [`Algorithm::CmaEs`] | `cma` | Hansen, The CMA Evolution Strategy: A Tutorial, arXiv 1604.00772 |
//!
//! The same seed gives the same run, save where time stops it. For the pose of a tool none of them is the one to
//! take: [`method::solve`](super::method::solve) with [`Method::LevenbergMarquardt`](super::Method) needs less than a hundredth
//! of their evaluations.
//!
//! ```
//! use darm_robot::ik::objective::Function;
//! use darm_robot::ik::search::{Algorithm, Settings, minimise};
//! let settings = Settings { iterations: 100, deviation: 0.01, ..Settings::default() };
//! let run = minimise(Algorithm::Memr, &Function::de_jong(4), &settings);
//! assert!(run.value < 1e-3 && run.history.len() == 101);
//! ```

mod cma;
mod differential;
mod em;
mod genetic;
mod memr;

use std::fmt;
use std::str::FromStr;
use std::time::{Duration, Instant};

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::objective::Objective;

/// A way to search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(into = "&'static str")]
pub enum Algorithm {
    /// Electromagnetism-like, without local search: the paper's EMW.
    Em,
    /// Electromagnetism-like with record-to-record travel: the paper's MEMR.
    Memr,
    /// Real-coded genetic algorithm: the paper's GA.
    Genetic,
    /// Differential evolution, rand/1/bin.
    DifferentialEvolution,
    /// Covariance matrix adaptation with restarts.
    CmaEs,
}

/// What a search is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Points; fewer than 4 are taken as 4. Covariance matrix adaptation has another number.
    pub population: usize,
    /// Iterations.
    pub iterations: usize,
    /// DV of MEMR in the unit of the objective: how much worse than the record a neighbour may be.
    pub deviation: f64,
    /// No iteration begins after this many evaluations.
    pub evaluations: usize,
    /// No iteration begins after this time.
    pub time: Duration,
    /// A value up to this ends the search.
    pub enough: f64,
    /// Draws everything that is drawn.
    pub seed: u64,
}

/// How far a search had come.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mark {
    /// Evaluations up to here.
    pub evaluations: usize,
    /// The least value up to here.
    pub value: f64,
}

/// What one search found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Run {
    /// The best point, within the bounds.
    pub x: Vec<f64>,
    /// Its value.
    pub value: f64,
    /// Evaluations of the objective.
    pub evaluations: usize,
    /// What it took, s.
    pub time_s: f64,
    /// The first population, and each iteration.
    pub history: Vec<Mark>,
}

impl Default for Settings {
    /// The paper's for arms, DV in metres: 50 points, 1000 iterations, DV = 2 cm; nothing else stops it.
    fn default() -> Self {
        Self {
            population: 50,
            iterations: 1000,
            deviation: 0.02,
            evaluations: usize::MAX,
            time: Duration::MAX,
            enough: f64::NEG_INFINITY,
            seed: 1,
        }
    }
}

impl Algorithm {
    /// All, those of the paper first.
    pub const ALL: [Self; 5] = [Self::Em, Self::Memr, Self::Genetic, Self::DifferentialEvolution, Self::CmaEs];

    /// The name that a person types.
    pub fn name(self) -> &'static str {
        match self {
            Self::Em => "em",
            Self::Memr => "memr",
            Self::Genetic => "ga",
            Self::DifferentialEvolution => "de",
            Self::CmaEs => "cma-es",
        }
    }
}

impl fmt::Display for Algorithm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl From<Algorithm> for &'static str {
    fn from(algorithm: Algorithm) -> Self {
        algorithm.name()
    }
}

impl FromStr for Algorithm {
    type Err = ();

    fn from_str(name: &str) -> Result<Self, ()> {
        Self::ALL.into_iter().find(|algorithm| algorithm.name() == name).ok_or(())
    }
}

/// The least value of a bounded function that a search finds, and the way there.
pub fn minimise(algorithm: Algorithm, objective: &dyn Objective, settings: &Settings) -> Run {
    let mut search = Search::new(objective, settings);
    if objective.bounds().is_empty() {
        search.evaluate(Vec::new());
        return search.finish();
    }
    match algorithm {
        Algorithm::Em => em::search(&mut search, false),
        Algorithm::Memr => em::search(&mut search, true),
        Algorithm::Genetic => genetic::search(&mut search),
        Algorithm::DifferentialEvolution => differential::search(&mut search),
        Algorithm::CmaEs => cma::search(&mut search),
    }
    search.finish()
}

/// A point and its value.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) x: Vec<f64>,
    pub(super) value: f64,
}

impl Point {
    /// The number of the best of some points; 0 of none.
    pub(super) fn best_of(points: &[Self]) -> usize {
        (0..points.len()).min_by(|a, b| points[*a].value.total_cmp(&points[*b].value)).unwrap_or(0)
    }
}

/// A search under way.
pub(super) struct Search<'a> {
    objective: &'a dyn Objective,
    pub(super) bounds: &'a [[f64; 2]],
    pub(super) settings: &'a Settings,
    pub(super) random: ChaCha8Rng,
    best: Point,
    evaluations: usize,
    history: Vec<Mark>,
    start: Instant,
}

impl<'a> Search<'a> {
    fn new(objective: &'a dyn Objective, settings: &'a Settings) -> Self {
        Self {
            objective,
            bounds: objective.bounds(),
            settings,
            random: ChaCha8Rng::seed_from_u64(settings.seed),
            best: Point { x: Vec::new(), value: f64::INFINITY },
            evaluations: 0,
            history: Vec::new(),
            start: Instant::now(),
        }
    }

    /// The value at `x` brought within the bounds; the best is kept.
    pub(super) fn evaluate(&mut self, mut x: Vec<f64>) -> Point {
        // Not `clamp`, which panics where the bounds are no numbers.
        x.iter_mut().zip(self.bounds).for_each(|(x, [low, high])| *x = x.max(*low).min(*high));
        let value = self.objective.value(&x);
        let point = Point { x, value: if value.is_nan() { f64::INFINITY } else { value } };
        self.evaluations += 1;
        if point.value < self.best.value || self.evaluations == 1 {
            self.best = point.clone();
        }
        point
    }

    /// A point drawn evenly within the bounds.
    pub(super) fn draw(&mut self) -> Vec<f64> {
        self.bounds.iter().map(|[low, high]| low + (high - low) * self.random.random::<f64>()).collect()
    }

    /// The first population.
    pub(super) fn population(&mut self) -> Vec<Point> {
        (0..self.settings.population.max(4))
            .map(|_| {
                let x = self.draw();
                self.evaluate(x)
            })
            .collect()
    }

    /// Notes how far the search has come, and says whether there is another iteration.
    pub(super) fn goes_on(&mut self) -> bool {
        self.history.push(Mark { evaluations: self.evaluations, value: self.best.value });
        self.history.len() <= self.settings.iterations
            && self.evaluations < self.settings.evaluations
            && self.best.value > self.settings.enough
            && self.start.elapsed() < self.settings.time
    }

    fn finish(self) -> Run {
        Run {
            x: self.best.x,
            value: self.best.value,
            evaluations: self.evaluations,
            time_s: self.start.elapsed().as_secs_f64(),
            history: self.history,
        }
    }
}

#[cfg(test)]
mod tests;
