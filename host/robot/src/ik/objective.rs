//! Functions of bounded variables that a search makes least: two test functions, and the distance of a tool from its
//! target.

use darm_core::ik::error;
use darm_core::se::{Pose, Twist};

use super::arm::{Arm, Problem};

/// A function of variables within bounds, to be made as small as possible.
pub trait Objective: Sync {
    /// Least and greatest value of each variable, finite.
    fn bounds(&self) -> &[[f64; 2]];

    /// The value at a point that has as many numbers as there are bounds. Not a number is taken as the worst of all.
    fn value(&self, x: &[f64]) -> f64;
}

/// A test function of the paper, least at the origin, where it is 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Function {
    kind: Kind,
    bounds: Vec<[f64; 2]>,
}

/// Which test function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    DeJong,
    Rastrigin,
}

impl Function {
    /// f₁(x) = Σ xᵢ² of `n` variables in ±5.12.
    pub fn de_jong(n: usize) -> Self {
        Self { kind: Kind::DeJong, bounds: vec![[-5.12, 5.12]; n] }
    }

    /// f₂(x) = Σ xᵢ² − 10 cos(2π xᵢ) + 10 of `n` variables in ±5.12: 11ⁿ minima, one of them the least.
    pub fn rastrigin(n: usize) -> Self {
        Self { kind: Kind::Rastrigin, bounds: vec![[-5.12, 5.12]; n] }
    }
}

impl Objective for Function {
    fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }

    fn value(&self, x: &[f64]) -> f64 {
        let term = |x: &f64| match self.kind {
            Kind::DeJong => x * x,
            Kind::Rastrigin => x * x - 10.0 * (std::f64::consts::TAU * x).cos() + 10.0,
        };
        x.iter().map(term).sum()
    }
}

/// √(|Δp|² + ℓ²θ²), m, between a tool and its target: the paper's equation (5), and beyond it any chain and
/// orientation.
///
/// Variables are those of the arm; where a limit is missing 2π (rad or m) are searched.
#[derive(Clone, Debug)]
pub struct Distance<'a> {
    arm: &'a Arm,
    target: Pose<f64>,
    /// (ℓ, 1), zero for a part that does not count.
    weights: [f64; 2],
    bounds: Vec<[f64; 2]>,
}

impl<'a> Distance<'a> {
    /// How far the arm's tool is from its target.
    pub fn new(problem: Problem<'a>) -> Self {
        let Problem { arm, target, options } = problem;
        Self { arm, target: *target, weights: options.weights(), bounds: arm.bounds() }
    }

    /// The value of an error (rad, m).
    pub fn of(&self, error: &Twist<f64>) -> f64 {
        let [angular, linear] = self.weights;
        (angular * error.angular.norm()).hypot(linear * error.linear.norm())
    }
}

impl Objective for Distance<'_> {
    fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }

    fn value(&self, x: &[f64]) -> f64 {
        self.of(&error(&self.target, &self.arm.pose(x)))
    }
}

#[cfg(test)]
mod tests {
    use super::{Function, Objective as _};

    #[test]
    fn test_functions_are_least_at_the_origin() {
        for function in [Function::de_jong(3), Function::rastrigin(3)] {
            assert_eq!(function.value(&[0.0; 3]), 0.0);
            assert!(function.value(&[1e-3, 0.0, 0.0]) > 0.0);
        }
        // One period away from the origin the cosine is 1 again: 1 remains.
        assert!((Function::rastrigin(2).value(&[1.0, 0.0]) - 1.0).abs() < 1e-12);
    }
}
