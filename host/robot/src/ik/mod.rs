//! Inverse kinematics by a method of choice, with the error before every step, so that methods can be compared.
//!
//! Take [`Method::LevenbergMarquardt`]; the others are there to be learned from. [`configurations`] gives all
//! postures that reach a target, [`search`] holds the searches by populations of points, `memr` of `darm-papers` the tables that
//! they are known from.
//!
//! [`solve`] never fails: [`Solution::status`] says how it ended, and [`Solution::q`] holds the nearest positions
//! found.
//!
//! ```
//! use darm_robot::ik::{self, Arm, Method, Options, Status};
//! use darm_core::tree::{Inertia, Joint, Tree};
//! use darm_core::{real::Vec3, se::Pose};
//! let upper = Joint::revolute(None, Vec3::z(), Pose::identity(), Inertia::none());
//! let lower = Joint::revolute(Some(0), Vec3::z(), Pose::at(Vec3::new(0.5, 0.0, 0.0)), Inertia::none());
//! let tree = Tree::new(&[upper, lower], Vec3::zeros()).unwrap();
//! let tool = tree.frame(1, &Pose::at(Vec3::new(0.3, 0.0, 0.0)));
//! let arm = Arm { tree: &tree, tool: &tool, limits: &[[-3.0, 3.0]; 2] };
//! let (target, options) = (Pose::at(Vec3::new(0.5, 0.3, 0.0)), Options { orientation_rad: f64::INFINITY, ..Options::default() });
//! let slow = ik::solve(Method::Transpose, &arm, &target, &[0.1, 0.2], &Options { steps: 500, ..options });
//! let fast = ik::solve(Method::LevenbergMarquardt, &arm, &target, &[0.1, 0.2], &options);
//! assert_eq!((slow.solution.status, fast.solution.status), (Status::Reached, Status::Reached));
//! assert!(slow.history.len() > fast.history.len());
//! ```

pub mod configurations;
pub mod objective;
pub mod search;
pub mod trials;

use std::fmt;
use std::str::FromStr;

use darm_core::ik::{self, error, scale};
use darm_core::se::{Pose, Twist};
use darm_core::tree::Frames;
use nalgebra::SMatrix;
use objective::Distance;
use search::{Algorithm, Mark, Settings, minimise};

pub use darm_core::ik::{Arm, Options, Solution, Status};

/// How joint positions are found: by steps that linearise the arm, or by a population of points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Damped steps within the limits, with restarts: [`darm_core::ik::solve`], the one to take.
    #[default]
    LevenbergMarquardt,
    /// J⁻¹: a square, regular Jacobian alone.
    Inverse,
    /// J⁺.
    PseudoInverse,
    /// α·Jᵀ.
    Transpose,
    /// Jᵀ(JJᵀ + μ1)⁻¹ with a constant μ of 1e-3 m².
    DampedLeastSquares,
    /// A search by a population of points, which needs no Jacobian.
    Population(Algorithm),
}

/// μ of [`Method::DampedLeastSquares`], m².
const DAMPING: f64 = 1e-3;

/// What a solution came from.
#[derive(Clone, Debug, PartialEq)]
pub struct Traced<const N: usize> {
    /// The nearest positions found, and how the search ended.
    pub solution: Solution<f64, N>,
    /// The error before each step of the last start, and at its end. Of a population the least √(|Δp|² + ℓ²θ²) after
    /// each iteration, expressed as a distance.
    pub history: Vec<Residual>,
}

/// How far a tool is from its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Distance, m.
    pub error_m: f64,
    /// Angle, rad.
    pub error_rad: f64,
}

impl Method {
    /// The methods that step, the recommended one first.
    pub const STEPS: [Self; 5] =
        [Self::LevenbergMarquardt, Self::Inverse, Self::PseudoInverse, Self::Transpose, Self::DampedLeastSquares];

    /// The name that a person types.
    pub fn name(self) -> &'static str {
        match self {
            Self::LevenbergMarquardt => "lm",
            Self::Inverse => "inverse",
            Self::PseudoInverse => "pseudo-inverse",
            Self::Transpose => "transpose",
            Self::DampedLeastSquares => "dls",
            Self::Population(algorithm) => algorithm.name(),
        }
    }

    /// All methods: those that step, then the searches by populations.
    pub fn all() -> impl Iterator<Item = Self> {
        Self::STEPS.into_iter().chain(Algorithm::ALL.map(Self::Population))
    }

    /// Steps from one start, or iterations, that are enough as a rule.
    pub fn usual_steps(self) -> usize {
        if let Self::Population(_) = self { Settings::default().iterations } else { Options::<f64>::default().steps }
    }

    /// A step of one of the lecture's methods; `None` where it does not exist.
    fn step<const N: usize>(self, jacobian: &SMatrix<f64, 6, N>, error: &Twist<f64>) -> Option<[f64; N]> {
        match self {
            Self::Inverse => ik::inverse_step(jacobian, error),
            Self::PseudoInverse => Some(ik::pseudo_inverse_step(jacobian, error)),
            Self::Transpose => Some(ik::transpose_step(jacobian, error)),
            Self::LevenbergMarquardt | Self::DampedLeastSquares => Some(ik::damped_step(jacobian, error, DAMPING)),
            Self::Population(_) => None,
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Self::all().find(|method| method.name() == name).ok_or_else(|| {
            let names: Vec<_> = Self::all().map(Self::name).collect();
            format!("no method is called {name:?}; there are {}", names.join(", "))
        })
    }
}

impl Residual {
    /// √(|Δp|² + ℓ²θ²), m, where one radian is held equal to ℓ metres.
    pub fn distance_m(&self, length_scale_m: f64) -> f64 {
        self.error_m.hypot(length_scale_m * self.error_rad)
    }
}

impl From<&Twist<f64>> for Residual {
    fn from(error: &Twist<f64>) -> Self {
        Self { error_m: error.linear.norm(), error_rad: error.angular.norm() }
    }
}

/// Joint positions that bring the tool to `target`, or as near as was found, from the start `q`.
///
/// The lecture's methods take up to `options.steps` steps from the one start, each joint kept within its limits, and
/// end [`Status::NotConverged`] where the tool is not within the tolerances after them; only the recommended one
/// restarts and says what is out of reach. A population is drawn within the limits, not about `q`, takes
/// `options.steps` iterations with the settings of [`Settings::default`], and ends sooner when it is within the
/// tolerances.
pub fn solve<const N: usize>(
    method: Method,
    arm: &Arm<f64, N>,
    target: &Pose<f64>,
    q: &[f64; N],
    options: &Options<f64>,
) -> Traced<N> {
    if let Method::Population(algorithm) = method {
        return by_population(algorithm, arm, target, options);
    }
    if method != Method::LevenbergMarquardt {
        return follow(method, arm, target, q, options);
    }
    let (mut history, mut last) = (Vec::new(), 0);
    let solution = ik::solve_observed(arm, target, q, options, |start, error| {
        if start != last {
            history.clear();
            last = start;
        }
        history.push(error.into());
    });
    Traced { solution, history }
}

/// One of the lecture's methods from one start.
fn follow<const N: usize>(
    method: Method,
    arm: &Arm<f64, N>,
    target: &Pose<f64>,
    start: &[f64; N],
    options: &Options<f64>,
) -> Traced<N> {
    let weights = options.weights();
    let size = |error: &Twist<f64>| {
        weights[0].powi(2) * error.angular.norm_squared() + weights[1].powi(2) * error.linear.norm_squared()
    };
    let (mut q, mut frames) = (arm.within_limits(start), Frames::default());
    let (mut best, mut lowest, mut history) = (q, f64::INFINITY, Vec::new());
    for _ in 0..=options.steps {
        let (mut error, mut jacobian) = arm.linearised(target, &q, &mut frames);
        history.push(Residual::from(&error));
        if size(&error) < lowest {
            (best, lowest) = (q, size(&error));
        }
        if options.accepts(&error) || history.len() > options.steps {
            break;
        }
        scale(&mut error, &mut jacobian, weights);
        let Some(step) = method.step(&jacobian, &error) else { break };
        q.iter_mut().zip(&step).for_each(|(q, step)| *q += step);
        q = arm.within_limits(&q);
    }
    Traced { solution: solution_at(arm, target, options, best, history.len() - 1), history }
}

/// The best point of a population as a solution.
fn by_population<const N: usize>(
    algorithm: Algorithm,
    arm: &Arm<f64, N>,
    target: &Pose<f64>,
    options: &Options<f64>,
) -> Traced<N> {
    let distance = Distance::new(arm, target, options);
    let of_angle = options.orientation_rad * options.length_scale_m;
    let enough = options.position_m.min(of_angle);
    let settings = Settings { iterations: options.steps, seed: options.seed, enough, ..Settings::default() };
    let run = minimise(algorithm, &distance, &settings);
    let residual = |mark: &Mark| Residual { error_m: mark.value, error_rad: 0.0 };
    let history: Vec<Residual> = run.history.iter().map(residual).collect();
    let steps = history.len().saturating_sub(1);
    Traced { solution: solution_at(arm, target, options, distance.positions(&run.x), steps), history }
}

/// What `q` comes to, by forward kinematics.
fn solution_at<const N: usize>(
    arm: &Arm<f64, N>,
    target: &Pose<f64>,
    options: &Options<f64>,
    q: [f64; N],
    steps: usize,
) -> Solution<f64, N> {
    let pose = arm.tree.pose(arm.tool, &q);
    let error = error(target, &pose);
    let Residual { error_m, error_rad } = Residual::from(&error);
    let status = if options.accepts(&error) { Status::Reached } else { Status::NotConverged };
    Solution { status, q, pose, error_m, error_rad, steps, starts: 1 }
}

#[cfg(test)]
mod tests;
