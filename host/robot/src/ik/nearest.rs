//! The search that a user should take: damped steps within the limits from several starts, and, where none reaches the
//! target, the posture of least distance √(|Δp|² + ℓ²θ²) among the minima that they end in.
//!
//! Each start is followed by damped Gauss-Newton steps with μ in proportion to ε² (S. K. Chan, P. D. Lawrence, ICRA 1988).
//! Where they stall, Newton's steps with the exact Hessian follow (projected on the limits: D. P. Bertsekas, SIAM J. Control
//! Optim. 20 (1982) 221), until the gradient of what can still move vanishes and the Hessian of it has no direction
//! downwards: a minimum, not merely a place where steps became short.

use darm_core::ik::Status;
use darm_core::real::Vec6;
use darm_core::se::Twist;
use nalgebra::{DMatrix, DVector, Matrix6xX};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::arm::{Curvature, Problem};
use super::step::{damped, scaled};

/// μ per ε²: how strongly steps are damped far from the target.
const DAMPING: f64 = 0.1;
/// Damping is not below this, m²: steps stay finite at a singularity.
const MIN_DAMPING: f64 = 1e-9;
/// A descent in which the cost has not fallen by this factor in [`PATIENCE`] steps is given up.
const STALLED: f64 = 0.7;
const PATIENCE: usize = 5;
/// Two starts whose squared distances differ by less than this part have met the same nearest pose.
const SAME: f64 = 1e-6;
/// Most of Newton's steps.
const NEWTON_STEPS: usize = 200;
/// At a minimum the gradient is below this part of what the distance and the Jacobian could give.
const FLAT: f64 = 1e-10;
/// Curvature below zero by this part of the largest is rounding.
const DOWNWARDS: f64 = 1e-9;

/// Where a search ended.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct End {
    pub(super) x: Vec<f64>,
    pub(super) status: Status,
    pub(super) is_minimum: bool,
    pub(super) steps: usize,
    pub(super) starts: usize,
}

/// A point on the way.
#[derive(Clone, Debug)]
struct Place {
    x: Vec<f64>,
    error: Twist<f64>,
    /// ε², m².
    cost: f64,
    is_minimum: bool,
}

/// Positions that bring the tool to `target`, or nearest to it of all starts; the first is `x`. Shows `visit` the number
/// of the start and the error (rad, m) before each step and at each end.
pub(super) fn solve(problem: Problem<'_>, x: &[f64], mut visit: impl FnMut(usize, &Twist<f64>)) -> End {
    let Problem { arm, target, options } = problem;
    let mut search = Search { problem, steps: 0 };
    let (mut random, bounds) = (ChaCha8Rng::seed_from_u64(options.seed), arm.bounds());
    let mut best = search.descend(arm.within_limits(x), |error| visit(0, error));
    let (mut starts, mut met_again) = (1, 0);
    while starts < options.starts && !options.accepts(&best.error) && met_again < options.starts / 4 {
        let start = bounds.iter().map(|[low, high]| low + (high - low) * random.random::<f64>()).collect();
        let place = search.descend(start, |error| visit(starts, error));
        starts += 1;
        if (place.cost - best.cost).abs() <= best.cost * SAME {
            met_again += 1;
        } else if place.cost < best.cost {
            met_again = 0;
        }
        if place.cost < best.cost || options.accepts(&place.error) {
            best = place;
        }
    }
    let status = if options.accepts(&best.error) {
        Status::Reached
    } else if met_again > 1 || arm.is_beyond_reach(&target.position, options.position_m) {
        Status::OutOfReach
    } else {
        Status::NotConverged
    };
    End { x: best.x, status, is_minimum: best.is_minimum, steps: search.steps, starts }
}

struct Search<'a> {
    problem: Problem<'a>,
    steps: usize,
}

impl Search<'_> {
    /// The nearest place on the way from one start.
    fn descend(&mut self, mut x: Vec<f64>, mut visit: impl FnMut(&Twist<f64>)) -> Place {
        let Problem { arm, target, options } = self.problem;
        let mut best: Option<Place> = None;
        let (mut mark, weights) = (0.0, options.weights());
        for step in 0..=options.steps {
            let (error, jacobian) = arm.linearised(target, &x);
            visit(&error);
            let (residual, jacobian) = scaled(&error, jacobian, weights);
            let cost = residual.norm_squared();
            if best.as_ref().is_none_or(|best| cost < best.cost) {
                best = Some(Place { x: x.clone(), error, cost, is_minimum: false });
            }
            if options.accepts(&error) {
                return Place { x, error, cost, is_minimum: true };
            }
            if step == options.steps || step > 0 && step % PATIENCE == 0 && cost > mark * STALLED {
                break;
            }
            if step % PATIENCE == 0 {
                mark = cost;
            }
            x = self.stepped(&x, &residual, jacobian);
            self.steps += 1;
        }
        let place = best.unwrap_or(Place { x, error: Twist::zero(), cost: f64::INFINITY, is_minimum: false });
        if place.cost.is_finite() { self.settle(place, visit) } else { place }
    }

    /// One damped step; variables that it would take out of their limits stay on them, and the others take their part.
    fn stepped(&self, x: &[f64], error: &Vec6<f64>, mut jacobian: Matrix6xX<f64>) -> Vec<f64> {
        let arm = self.problem.arm;
        let damping = error.norm_squared() * DAMPING + MIN_DAMPING;
        let mut step = damped(&jacobian, error, damping);
        let mut is_limited = false;
        for (k, (x, variable)) in x.iter().zip(&arm.variables).enumerate() {
            let [low, high] = variable.limits;
            if *x <= low && step[k] < 0.0 || *x >= high && step[k] > 0.0 {
                jacobian.column_mut(k).fill(0.0);
                is_limited = true;
            }
        }
        if is_limited {
            step = damped(&jacobian, error, damping);
        }
        let moved: Vec<f64> = x.iter().zip(&step).map(|(x, step)| x + step).collect();
        arm.within_limits(&moved)
    }

    /// The minimum that lies downhill of a place.
    fn settle(&mut self, mut place: Place, mut visit: impl FnMut(&Twist<f64>)) -> Place {
        let Problem { arm, target, options } = self.problem;
        let weights = options.weights();
        let mut here = arm.curvature(target, &place.x, weights);
        let mut damping = 1e-6 * here.hessian.amax();
        for _ in 0..NEWTON_STEPS {
            let free = self.free(&place.x, &here);
            let Some(step) = self.newton_step(&here, &free, damping) else {
                damping = (10.0 * damping).max(1e-12 * here.hessian.amax());
                continue;
            };
            if step.is_empty() || options.accepts(&here.error) {
                place.is_minimum = true;
                break;
            }
            let mut x = place.x.clone();
            free.iter().zip(step.iter()).for_each(|(&k, step)| x[k] += step);
            let x = arm.within_limits(&x);
            let there = arm.curvature(target, &x, weights);
            self.steps += 1;
            if there.cost < here.cost {
                (place, here) = (Place { x, error: there.error, cost: 2.0 * there.cost, is_minimum: false }, there);
                damping *= 0.1;
                visit(&here.error);
            } else if there.cost.is_finite() && damping > 1e9 * here.hessian.amax() {
                // No step that differs from none in floating point leads down.
                place.is_minimum = true;
                break;
            } else {
                damping = (10.0 * damping).max(1e-12 * here.hessian.amax());
            }
        }
        place
    }

    /// The variables that can move downhill: those not at a limit, or at one that the gradient leads away from.
    fn free(&self, x: &[f64], here: &Curvature) -> Vec<usize> {
        let is_free = |&k: &usize| {
            let [low, high] = self.problem.arm.variables[k].limits;
            !(x[k] <= low && here.gradient[k] >= 0.0 || x[k] >= high && here.gradient[k] <= 0.0)
        };
        (0..x.len()).filter(is_free).collect()
    }

    /// A step downhill of the free variables, empty at a minimum; `None` where the damping is too small for one.
    fn newton_step(&self, here: &Curvature, free: &[usize], damping: f64) -> Option<DVector<f64>> {
        let gradient = here.gradient.select_rows(free);
        let hessian = here.hessian.select_rows(free).select_columns(free);
        let flat = FLAT * (2.0 * here.cost * hessian.amax()).sqrt();
        if free.is_empty() || gradient.amax() <= flat {
            return Some(downwards(hessian, damping).unwrap_or(DVector::zeros(0)));
        }
        let n = free.len();
        let damped = hessian + DMatrix::from_diagonal_element(n, n, damping);
        damped.cholesky().map(|factors| -factors.solve(&gradient))
    }
}

/// A short step along the direction in which the gradient falls most, where it falls; shorter with more damping.
fn downwards(hessian: DMatrix<f64>, damping: f64) -> Option<DVector<f64>> {
    if hessian.is_empty() {
        return None;
    }
    let largest = hessian.amax();
    let eigen = hessian.symmetric_eigen();
    let (lowest, value) = eigen.eigenvalues.argmin();
    let length = 0.1 * largest / (largest + damping);
    (value < -DOWNWARDS * largest).then(|| eigen.eigenvectors.column(lowest) * length)
}

#[cfg(test)]
mod tests;
