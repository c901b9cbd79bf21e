//! The tables of Abed, Koh, Sahari, Tiong, Tan, Solving the Inverse Kinematics for Robot Manipulators using Modified
//! Electromagnetism-like Algorithm with Record to Record Travel, and the problems that they are of.
//!
//! # Where the paper is silent or wrong
//!
//! - The number of variables of the test functions is not printed: 4 fits the spreads of Table 1.
//! - The genetic algorithm's best value on De Jong's function, 1.27e-6, does not fit the printed 100 iterations. About
//!   800 variables mutate in these, each to any value within 10.24, so that none comes nearer to 0 than about 1e-2, and
//!   crossover only contracts the population. It fits 1000 iterations, which every other problem has: with these the
//!   sums Σx² of both functions are alike in the paper too, 1.27e-6 and 2.38e-4 / 200.
//! - A "best value" is the least of the 20 runs: far below what the standard deviations allow for a mean.
//! - Links of 20 cm cannot reach (100, 50), (80, 30) and (90, 30) cm, which lie farther away than 80 cm. With 28 cm
//!   all five targets are within reach; 30 cm is taken beside what is printed.
//! - Table 3 does not fit Table 2: EMW's five errors lie between 0.9e-2 and 5.4e-2 cm, where runs with Table 2's
//!   standard deviations of 4e-2 cm have means of 8e-2 cm (the error of a random search for a point is spread by half
//!   its mean).
//! - The law and number of the steps of a local search, whether the best point moves, and most of the genetic
//!   algorithm are not printed: what was chosen is in the files `memr`, `em` and `genetic`.

use std::fmt::Write as _;

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::TreeError;

use darm_robot::ik::objective::Function;
use darm_robot::ik::search::{Algorithm, Settings, minimise};
use darm_robot::ik::trials::{Experiment, Trials};
use darm_robot::ik::{Method, Options};
use darm_robot::robot::planar::planar_arm;

use crate::convergence::{Runs, bands};

/// The length that is printed, m.
pub const PRINTED_LINK_M: f64 = 0.2;
/// A length with which all targets are within reach, m.
pub const LINK_M: f64 = 0.3;
/// Runs of each search.
pub const RUNS: usize = 20;
/// Variables of the test functions.
const VARIABLES: usize = 4;
/// Iterations with which the genetic algorithm's result on De Jong's function fits the printed one; 100 are printed.
pub const GENETIC_DE_JONG_ITERATIONS: usize = 1000;
/// Runs that Table 3 prints.
const PRINTED_RUNS: usize = 5;
/// Limits of the four joints, rad: the third turns by 360 degrees, the others by 180.
pub const LIMITS: [[f64; 2]; 4] = {
    use std::f64::consts::{PI, TAU};
    [[0.0, PI], [0.0, PI], [0.0, TAU], [0.0, PI]]
};
/// Closer than this a target counts as met, m: 1e-10 cm.
pub const MET_M: f64 = 1e-12;

/// What is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Problem {
    /// De Jong's function.
    DeJong,
    /// Rastrigin's function.
    Rastrigin,
    /// The planar arm of four links, and the target of its tip (x, y) in cm.
    Target([f64; 2]),
}

/// What the paper prints, in cm for targets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Printed {
    /// Tables 1 and 2.
    Best {
        /// The least of the runs.
        value: f64,
        /// Their standard deviation.
        deviation: f64,
    },
    /// Table 3: five runs.
    Runs([f64; 5]),
}

/// One cell of a table: what is solved, how, and what the paper prints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Number of the table.
    pub table: u8,
    /// What is solved.
    pub problem: Problem,
    /// By what.
    pub algorithm: Algorithm,
    /// With this outcome in the paper.
    pub printed: Printed,
}

/// The paper's targets, cm.
pub const TARGETS: [[f64; 2]; 5] = [[100.0, 50.0], [50.0, 60.0], [70.0, 20.0], [80.0, 30.0], [90.0, 30.0]];

const fn best(table: u8, problem: Problem, algorithm: Algorithm, value: f64, deviation: f64) -> Cell {
    Cell { table, problem, algorithm, printed: Printed::Best { value, deviation } }
}

const fn runs(target: [f64; 2], algorithm: Algorithm, errors: [f64; 5]) -> Cell {
    Cell { table: 3, problem: Problem::Target(target), algorithm, printed: Printed::Runs(errors) }
}

/// Tables 1, 2 and 3.
pub const CELLS: [Cell; 21] = {
    use Algorithm::{Em, Genetic, Memr};
    use Problem::{DeJong, Rastrigin, Target};
    let [first, second, third, fourth, fifth] = TARGETS;
    [
        best(1, DeJong, Em, 5.04e-4, 7.30e-3),
        best(1, DeJong, Memr, 5.30e-6, 5.33e-6),
        best(1, DeJong, Genetic, 1.27e-6, 4.24e-6),
        best(1, Rastrigin, Em, 4.85e-1, 8.50e-1),
        best(1, Rastrigin, Memr, 2.37e-4, 6.72e-1),
        best(1, Rastrigin, Genetic, 2.38e-4, 6.21e-3),
        best(2, Target(first), Em, 1.36e-2, 3.53e-2),
        best(2, Target(first), Memr, 6.86e-4, 2.26e-3),
        best(2, Target(first), Genetic, 1.10e-3, 2.56e-3),
        best(2, Target(second), Em, 1.92e-2, 4.10e-2),
        best(2, Target(second), Memr, 6.54e-4, 2.13e-3),
        best(2, Target(second), Genetic, 9.74e-4, 2.77e-3),
        runs(third, Em, [2.93e-2, 1.46e-2, 1.32e-2, 2.16e-2, 8.88e-3]),
        runs(third, Memr, [3.32e-3, 2.51e-3, 1.58e-3, 2.55e-3, 5.69e-3]),
        runs(third, Genetic, [2.02e-3, 4.21e-3, 2.10e-3, 3.87e-3, 4.34e-3]),
        runs(fourth, Em, [1.90e-2, 2.07e-2, 1.96e-2, 3.70e-2, 2.75e-2]),
        runs(fourth, Memr, [1.59e-3, 4.14e-3, 1.03e-3, 5.86e-4, 2.82e-3]),
        runs(fourth, Genetic, [2.97e-3, 2.22e-3, 2.98e-3, 1.40e-3, 1.83e-3]),
        runs(fifth, Em, [2.25e-2, 3.96e-2, 5.35e-2, 2.35e-2, 2.22e-2]),
        runs(fifth, Memr, [2.29e-3, 4.28e-3, 8.85e-4, 3.46e-3, 1.44e-3]),
        runs(fifth, Genetic, [2.94e-3, 4.37e-3, 7.67e-3, 2.65e-3, 2.73e-3]),
    ]
};

impl Problem {
    /// What a person reads.
    pub fn name(self) -> String {
        match self {
            Self::DeJong => "De Jong".into(),
            Self::Rastrigin => "Rastrigin".into(),
            Self::Target([x, y]) => format!("({x}, {y}) cm"),
        }
    }

    /// What a value is multiplied by to be given in the paper's unit: of targets, m to cm.
    pub fn factor(self) -> f64 {
        if let Self::Target(_) = self { 100.0 } else { 1.0 }
    }
}

impl Printed {
    /// The least value that is printed.
    pub fn minimum(&self) -> f64 {
        match self {
            Self::Best { value, .. } => *value,
            Self::Runs(errors) => errors.iter().copied().fold(f64::INFINITY, f64::min),
        }
    }
}

impl Cell {
    /// The paper's settings, for one seed: 50 points; 100 iterations and DV = 0.01 on De Jong's function, 1000 and 2
    /// elsewhere, in cm on targets.
    pub fn settings(&self, seed: u64) -> Settings {
        let (iterations, deviation) = match self.problem {
            Problem::DeJong => (100, 0.01),
            Problem::Rastrigin => (1000, 2.0),
            Problem::Target(_) => (1000, 0.02),
        };
        Settings { iterations, deviation, seed, ..Settings::default() }
    }

    /// The genetic algorithm on De Jong's function, with its own number of iterations.
    pub fn genetic_de_jong(iterations: usize, seed: u64) -> Repeated {
        let cell = best(1, Problem::DeJong, Algorithm::Genetic, 1.27e-6, 4.24e-6);
        let settings = Settings { iterations, ..cell.settings(seed) };
        let function = Function::de_jong(VARIABLES);
        let search = |seed| minimise(cell.algorithm, &function, &Settings { seed, ..settings });
        Repeated { cell, trials: Trials::new(RUNS, seed, search), short_cm: 0.0 }
    }

    /// The cell again: `runs` searches from `seed` on, links of `link_m`; values in m where the paper has cm.
    ///
    /// # Errors
    /// As [`reach`].
    pub fn repeat(&self, link_m: f64, runs: usize, seed: u64) -> Result<Trials, TreeError> {
        let settings = self.settings(seed);
        let on = |function: Function| {
            Trials::new(runs, seed, |seed| minimise(self.algorithm, &function, &Settings { seed, ..settings }))
        };
        match self.problem {
            Problem::DeJong => Ok(on(Function::de_jong(VARIABLES))),
            Problem::Rastrigin => Ok(on(Function::rastrigin(VARIABLES))),
            Problem::Target(target) => reach(link_m, Method::Population(self.algorithm), target, &settings, runs),
        }
    }
}

/// Runs of any method to a target (cm) by the paper's arm with links of this length.
///
/// # Errors
/// None: the four joints of this arm make a tree.
pub fn reach(
    link_m: f64,
    method: Method,
    [x, y]: [f64; 2],
    settings: &Settings,
    runs: usize,
) -> Result<Trials, TreeError> {
    let (arm, tip) = planar_arm(&[link_m; 4], &LIMITS);
    let target = Pose::at(Vec3::new(0.01 * x, 0.01 * y, 0.0));
    let options = Options { position_m: MET_M, orientation_rad: f64::INFINITY, ..Options::default() };
    arm.trials(&tip, &target, &Experiment { method, options: &options, settings, runs })
}

/// A cell and its runs, in the unit of the paper.
#[derive(Clone, Debug, PartialEq)]
pub struct Repeated {
    /// What is printed.
    pub cell: Cell,
    /// What the runs came to here.
    pub trials: Trials,
    /// How far the nearest posture is from the target, cm; 0 where it is within reach.
    pub short_cm: f64,
}

impl Repeated {
    /// Repeats a cell, and finds out whether its target can be reached.
    ///
    /// # Errors
    /// As [`reach`].
    pub fn new(cell: &Cell, link_m: f64, runs: usize, seed: u64) -> Result<Self, TreeError> {
        let trials = cell.repeat(link_m, runs, seed)?;
        let short_m = match cell.problem {
            Problem::Target(target) => {
                let nearest =
                    reach(link_m, Method::LevenbergMarquardt, target, &cell.settings(seed), 1)?.summary().best;
                if nearest > MET_M { nearest } else { 0.0 }
            }
            _ => 0.0,
        };
        Ok(Self { cell: *cell, trials, short_cm: 100.0 * short_m })
    }

    /// How many of the errors that Table 3 prints lie between the least and the greatest of the runs here.
    pub fn printed_within(&self) -> Option<usize> {
        let (summary, factor) = (self.trials.summary(), self.cell.problem.factor());
        match self.cell.printed {
            Printed::Best { .. } => None,
            Printed::Runs(errors) => {
                let ours = factor * summary.best..=factor * summary.worst;
                Some(errors.iter().filter(|error| ours.contains(error)).count())
            }
        }
    }

    fn runs(&self) -> Runs<'_> {
        let name = printed_name(self.cell.algorithm);
        Runs { name, trials: &self.trials, compared: Some(self.cell.printed.minimum()) }
    }

    /// As [`off`](Self::off) of Table 3, for the mean of the five best runs.
    pub fn off_of_best(&self) -> Option<f64> {
        let Printed::Runs(errors) = self.cell.printed else { return None };
        let mean = self.trials.values().iter().take(PRINTED_RUNS).sum::<f64>() / PRINTED_RUNS as f64;
        Some(off_range(self.cell.problem.factor() * mean, &errors))
    }

    /// What is compared, ours and the paper's, in its unit: the best value of Tables 1 and 2, the mean of Table 3.
    pub fn compared(&self) -> [f64; 2] {
        let (summary, factor) = (self.trials.summary(), self.cell.problem.factor());
        match self.cell.printed {
            Printed::Best { value, .. } => [factor * summary.best, value],
            Printed::Runs(errors) => [factor * summary.mean, errors.iter().sum::<f64>() / PRINTED_RUNS as f64],
        }
    }

    /// How far the outcome lies from the paper's, as a part of its spread; up to 1 is within it.
    ///
    /// Tables 1 and 2: distance of the best values over the printed standard deviation. Table 3: distance of the mean
    /// from the middle of the five printed errors over half their range.
    pub fn off(&self) -> f64 {
        let [ours, printed] = self.compared();
        match self.cell.printed {
            Printed::Best { deviation, .. } => (ours - printed).abs() / deviation,
            Printed::Runs(errors) => off_range(ours, &errors),
        }
    }
}

/// How far a mean lies from the middle of the errors, over half their range.
fn off_range(mean: f64, errors: &[f64]) -> f64 {
    let [low, high] = [f64::min, f64::max].map(|of| errors.iter().copied().reduce(of).unwrap_or(f64::NAN));
    (mean - 0.5 * (low + high)).abs() / (0.5 * (high - low))
}

/// The tables for people, the paper's figures beside ours.
pub fn text(repeated: &[Repeated]) -> String {
    let mut text = String::new();
    let mut table = 0;
    for one @ Repeated { cell, trials, short_cm } in repeated {
        if cell.table != table {
            table = cell.table;
            let head = if table == 3 { "the paper: mean of 5, least, greatest" } else { "the paper: best, s.d." };
            let unit = if table == 1 { "value" } else { "position error, cm" };
            let _ = writeln!(text, "\nTable {table}, {unit}");
            let _ = writeln!(
                text,
                "{:15} {:8} {:>9} {:>9} {:>9} {:>9}   {head}",
                "problem", "", "best", "mean", "s.d.", "worst"
            );
        }
        let summary = trials.summary();
        let [best, mean, deviation, worst] =
            [summary.best, summary.mean, summary.deviation, summary.worst].map(|value| cell.problem.factor() * value);
        let _ = write!(
            text,
            "{:15} {:8} {best:9.2e} {mean:9.2e} {deviation:9.2e} {worst:9.2e}   ",
            cell.problem.name(),
            printed_name(cell.algorithm)
        );
        let _ = match cell.printed {
            Printed::Best { value, deviation } => write!(text, "{value:9.2e} {deviation:9.2e}"),
            Printed::Runs(errors) => {
                let largest = errors.iter().copied().fold(0.0, f64::max);
                write!(text, "{:9.2e} {:9.2e} {largest:9.2e}", one.compared()[1], cell.printed.minimum())
            }
        };
        let _ = if *short_cm > 0.0 { writeln!(text, "   out of reach by {short_cm:.1} cm") } else { writeln!(text) };
    }
    text
}

/// Figures 8 to 11, those of which there are cells: file name and SVG. A dashed line is the paper's best value.
pub fn figures(repeated: &[Repeated]) -> Vec<(&'static str, String)> {
    let [first, second, ..] = TARGETS;
    let shown = [
        ("figure-08-de-jong.svg", Problem::DeJong, "De Jong's function"),
        ("figure-09-rastrigin.svg", Problem::Rastrigin, "Rastrigin's function"),
        ("figure-10-first-target.svg", Problem::Target(first), "position error, cm"),
        ("figure-11-second-target.svg", Problem::Target(second), "position error, cm"),
    ];
    let figure = |(file, problem, label): (&'static str, Problem, &str)| {
        let runs: Vec<_> =
            repeated.iter().filter(|repeated| repeated.cell.problem == problem).map(Repeated::runs).collect();
        (file, bands(label, problem.factor(), &runs))
    };
    shown.map(figure).to_vec()
}

/// The name that the paper gives an algorithm.
pub fn printed_name(algorithm: Algorithm) -> &'static str {
    match algorithm {
        Algorithm::Em => "EMW",
        Algorithm::Memr => "MEMR",
        Algorithm::Genetic => "GA",
        Algorithm::DifferentialEvolution => "DE",
        Algorithm::CmaEs => "CMA-ES",
    }
}

#[cfg(test)]
mod tests {
    use super::{CELLS, LIMITS, LINK_M, MET_M, Method, PRINTED_LINK_M, Problem, RUNS, Repeated, TARGETS};
    use super::{planar_arm, reach};

    /// Equations (3) and (4).
    #[test]
    fn the_arm_is_that_of_the_paper() {
        let (lengths, q) = ([0.3, 0.25, 0.2, 0.15], [0.4f64, 1.1, -0.7, 2.0]);
        let (arm, tip) = planar_arm(&lengths, &LIMITS);
        let reached = arm.kinematics(&tip, &q).unwrap().pose_base_frame.position;
        let sums = (1..=4).map(|n| q[..n].iter().sum::<f64>());
        let [x, y] = [f64::cos, f64::sin].map(|of| sums.clone().zip(lengths).map(|(sum, l)| l * of(sum)).sum::<f64>());
        assert!((reached.x - x).abs() < 1e-15 && (reached.y - y).abs() < 1e-15);
    }

    #[test]
    fn three_targets_are_out_of_reach_with_the_printed_links_and_none_with_longer_ones() {
        let short = |link_m: f64| {
            TARGETS.map(|target| {
                let cell = CELLS.iter().find(|cell| cell.problem == Problem::Target(target)).unwrap();
                (10.0 * Repeated::new(cell, link_m, 1, 1).unwrap().short_cm).round() / 10.0
            })
        };
        // √(100² + 50²) − 80 = 31.8, √(80² + 30²) − 80 = 5.4, √(90² + 30²) − 80 = 14.9.
        assert_eq!(short(PRINTED_LINK_M), [31.8, 0.0, 0.0, 5.4, 14.9]);
        assert_eq!(short(LINK_M), [0.0; 5]);
    }

    /// MEMR takes 549 050 evaluations and meets none.
    #[test]
    fn the_recommended_method_meets_every_target_with_a_hundredth_of_the_evaluations() {
        let settings = CELLS[6].settings(1);
        for target in TARGETS {
            let trials = reach(LINK_M, Method::LevenbergMarquardt, target, &settings, RUNS).unwrap();
            assert_eq!(trials.within(MET_M), RUNS, "{target:?}");
            assert!(trials.runs.iter().all(|run| run.evaluations <= 5490), "{target:?}");
        }
    }
}
