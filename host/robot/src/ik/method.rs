//! Methods of inverse kinematics by name: those that step, and the searches by populations of points.

use std::fmt;
use std::str::FromStr;

use darm_core::ik::{Options, Status, error};
use darm_core::real::Vec6;
use darm_core::se::Twist;
use nalgebra::Matrix6xX;

use super::arm::Problem;
use super::nearest;
use super::objective::Distance;
use super::search::{Algorithm, Mark, Settings, minimise};
use super::step::{damped, inverse, pseudo_inverse, scaled, transpose};

/// How joint positions are found: by steps that linearise the arm, or by a population of points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Damped steps within the limits, with restarts, and Newton's to the nearest posture: the one to take.
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

/// Where a method ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// How it ended.
    pub status: Status,
    /// The nearest positions found, one of each variable, rad or m.
    pub x: Vec<f64>,
    /// Whether no small motion within the limits comes nearer; not known of a method that takes a number of steps.
    pub is_minimum: bool,
    /// Steps of all starts.
    pub steps: usize,
    /// Starts.
    pub starts: usize,
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
    fn step(self, jacobian: &Matrix6xX<f64>, error: &Vec6<f64>) -> Option<Vec<f64>> {
        match self {
            Self::Inverse => inverse(jacobian, error),
            Self::PseudoInverse => Some(pseudo_inverse(jacobian, error)),
            Self::Transpose => Some(transpose(jacobian, error)),
            Self::LevenbergMarquardt | Self::DampedLeastSquares => Some(damped(jacobian, error, DAMPING)),
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

/// Positions that bring the tool to `target`, or as near as was found, from the start `x`. Shows `visit` the number of the
/// start and the error (rad, m) before each step; of a population the least √(|Δp|² + ℓ²θ²) as a distance.
///
/// The lecture's methods take up to `options.steps` steps from the one start, each joint kept within its limits, and
/// end [`Status::NotConverged`] where the tool is not within the tolerances after them; only the recommended one
/// restarts and says what is out of reach. A population is drawn within the limits, not about `x`, takes
/// `options.steps` iterations with the settings of [`Settings::default`], and ends sooner when it is within the
/// tolerances.
pub fn solve(method: Method, problem: Problem<'_>, x: &[f64], mut visit: impl FnMut(usize, &Twist<f64>)) -> Solution {
    match method {
        Method::LevenbergMarquardt => {
            let nearest::End { x, status, is_minimum, steps, starts } = nearest::solve(problem, x, visit);
            Solution { status, x, is_minimum, steps, starts }
        }
        Method::Population(algorithm) => {
            let (distance, options) = (Distance::new(problem), problem.options);
            let enough = options.position_m.min(options.orientation_rad * options.length_scale_m);
            let settings = Settings { iterations: options.steps, seed: options.seed, enough, ..Settings::default() };
            let run = minimise(algorithm, &distance, &settings);
            let as_distance = |mark: &Mark| Twist { linear: [mark.value, 0.0, 0.0].into(), ..Twist::zero() };
            run.history.iter().for_each(|mark| visit(0, &as_distance(mark)));
            ended(problem, run.x, run.history.len().saturating_sub(1))
        }
        _ => follow(method, problem, x, visit),
    }
}

/// One of the lecture's methods from one start.
fn follow(method: Method, problem: Problem<'_>, start: &[f64], mut visit: impl FnMut(usize, &Twist<f64>)) -> Solution {
    let Problem { arm, target, options } = problem;
    let mut x = arm.within_limits(start);
    let (mut best, mut lowest, mut steps) = (x.clone(), f64::INFINITY, 0);
    loop {
        let (error, jacobian) = arm.linearised(target, &x);
        visit(0, &error);
        let (residual, jacobian) = scaled(&error, jacobian, options.weights());
        if residual.norm_squared() < lowest {
            (best, lowest) = (x.clone(), residual.norm_squared());
        }
        if options.accepts(&error) || steps == options.steps {
            break;
        }
        let Some(step) = method.step(&jacobian, &residual) else { break };
        let moved: Vec<f64> = x.iter().zip(&step).map(|(x, step)| x + step).collect();
        x = arm.within_limits(&moved);
        steps += 1;
    }
    ended(problem, best, steps)
}

/// What `x` comes to, by forward kinematics.
fn ended(problem: Problem<'_>, x: Vec<f64>, steps: usize) -> Solution {
    let is_reached = problem.options.accepts(&error(problem.target, &problem.arm.pose(&x)));
    let status = if is_reached { Status::Reached } else { Status::NotConverged };
    Solution { status, x, is_minimum: is_reached, steps, starts: 1 }
}

#[cfg(test)]
mod tests;
