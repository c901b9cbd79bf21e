//! Functions of bounded variables that a search makes least: two test functions, and the distance of a tool from its
//! target.

use darm_core::ik::{Arm, Options, error};
use darm_core::se::{Pose, Twist};
use darm_core::tree::{LinkFrame, Tree};

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
/// Variables are the joints that can move; where a limit is missing 2π (rad or m) are searched.
#[derive(Clone, Debug)]
pub struct Distance<const N: usize> {
    tree: Tree<f64, N>,
    tool: LinkFrame<f64>,
    target: Pose<f64>,
    /// (ℓ, 1), zero for a part that does not count.
    weights: [f64; 2],
    bounds: Vec<[f64; 2]>,
    /// The joint of each variable.
    joints: Vec<usize>,
    /// Where the other joints stand.
    rest: [f64; N],
}

impl<const N: usize> Distance<N> {
    /// How far the arm's tool is from `target`; joints that cannot move stand where their limits are.
    pub fn new(arm: &Arm<f64, N>, target: &Pose<f64>, options: &Options<f64>) -> Self {
        use std::f64::consts::{PI, TAU};
        let bounds = arm.limits.map(|[low, high]| match (low.is_finite(), high.is_finite()) {
            (true, true) => [low.min(high), high],
            (true, false) => [low, low + TAU],
            (false, true) => [high - TAU, high],
            (false, false) => [-PI, PI],
        });
        let joints: Vec<_> = (0..N).filter(|joint| bounds[*joint][0] < bounds[*joint][1]).collect();
        Self {
            tree: *arm.tree,
            tool: *arm.tool,
            target: *target,
            weights: options.weights(),
            bounds: joints.iter().map(|joint| bounds[*joint]).collect(),
            joints,
            rest: bounds.map(|[low, _]| low),
        }
    }

    /// The value of an error (rad, m).
    pub fn of(&self, error: &Twist<f64>) -> f64 {
        let [angular, linear] = self.weights;
        (angular * error.angular.norm()).hypot(linear * error.linear.norm())
    }

    /// All joint positions (rad or m) of a point.
    pub fn positions(&self, x: &[f64]) -> [f64; N] {
        let mut q = self.rest;
        for (joint, x) in self.joints.iter().zip(x) {
            if let Some(q) = q.get_mut(*joint) {
                *q = *x;
            }
        }
        q
    }
}

impl<const N: usize> Objective for Distance<N> {
    fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }

    fn value(&self, x: &[f64]) -> f64 {
        self.of(&error(&self.target, &self.tree.pose(&self.tool, &self.positions(x))))
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
