//! All postures that bring a tool to one target.
//!
//! The search of [`solve`](super::method::solve) begins at many starts drawn within the limits, and every end that
//! reaches the target is kept. With as many joints as the target binds directions (the rank of the Jacobian) postures
//! are isolated: ends nearer to each other than [`SAME`] in every joint are one posture, and revolute joints that can
//! turn by 360 degrees are distinguished modulo a turn. How often each posture was met says how likely one was missed.
//!
//! With more joints the postures form manifolds, on which the arm moves without moving its tool (self-motion). Of
//! those a sample is reported: again and again the posture farthest from all that were chosen before.

use darm_core::ik::{Options, Status};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::arm::{Problem, Variable};
use super::nearest;
use super::step::scaled;
use crate::svd::svd;

/// Postures closer than this in every joint are one, rad or m.
pub const SAME: f64 = 1e-3;
/// Tightest tolerance of a posture that is compared, m and rad.
const TOLERANCE: f64 = 1e-9;
/// A singular value below this part of the largest binds no direction.
const RANK: f64 = 1e-6;

/// What was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Configurations {
    /// Dimension of the self-motion: 0 where postures are isolated.
    pub freedom: usize,
    /// The isolated postures, or a sample of the manifolds; those nearest to the start first.
    pub postures: Vec<Posture>,
    /// Starts.
    pub starts: usize,
    /// Starts that reached the target.
    pub reached: usize,
}

/// One posture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Posture {
    /// Joint positions within the limits, rad or m.
    pub q: Vec<f64>,
    /// How many starts ended there, or nearer to it than to any other of the sample.
    pub met: usize,
}

/// All postures that bring the tool to its target, those nearest to `x` first: at most `max_count` of a self-motion.
///
/// `options` are those of one search, [`Options::starts`] the number of starts; no posture where none reaches the
/// target.
pub fn configurations(problem: Problem<'_>, x: &[f64], max_count: usize) -> Configurations {
    let (arm, ends) = (problem.arm, ends(problem, x));
    let rank = ends.iter().map(|end| rank(problem, end)).max().unwrap_or(0);
    let freedom = if ends.is_empty() { 0 } else { arm.variables.len().saturating_sub(rank) };
    let apart = |a: &[f64], b: &[f64]| apart(a, b, &arm.variables);
    let (reach, max_count) = if freedom == 0 { (SAME, usize::MAX) } else { (0.0, max_count) };
    let mut chosen = spread(&ends, x, apart, reach, max_count);
    chosen.sort_by(|a, b| apart(a, x).total_cmp(&apart(b, x)));
    let mut postures: Vec<_> = chosen.iter().map(|end| Posture { q: end.to_vec(), met: 0 }).collect();
    for end in &ends {
        let nearest = (0..chosen.len()).min_by(|a, b| apart(chosen[*a], end).total_cmp(&apart(chosen[*b], end)));
        if let Some(posture) = nearest.and_then(|index| postures.get_mut(index)) {
            posture.met += 1;
        }
    }
    let reached = ends.len();
    Configurations { freedom, postures, starts: problem.options.starts, reached }
}

/// Where the starts that reach the target end.
fn ends(problem: Problem<'_>, x: &[f64]) -> Vec<Vec<f64>> {
    let options = problem.options;
    let tight = |tolerance: f64| if tolerance.is_finite() { tolerance.min(TOLERANCE) } else { tolerance };
    let (position_m, orientation_rad) = (tight(options.position_m), tight(options.orientation_rad));
    let once = &Options { position_m, orientation_rad, starts: 1, ..*options };
    let (mut random, bounds) = (ChaCha8Rng::seed_from_u64(options.seed), problem.arm.bounds());
    let mut start = x.to_vec();
    let mut ends = Vec::new();
    for _ in 0..options.starts {
        let found = nearest::solve(Problem { options: once, ..problem }, &start, |_, _| ());
        if found.status == Status::Reached {
            ends.push(found.x);
        }
        start = bounds.iter().map(|[low, high]| low + (high - low) * random.random::<f64>()).collect();
    }
    ends
}

/// Up to `max_count` of the `ends`: that nearest to `x`, then again and again the farthest from all chosen, while it is
/// farther than `reach`.
fn spread<'a>(
    ends: &'a [Vec<f64>],
    x: &[f64],
    apart: impl Fn(&[f64], &[f64]) -> f64,
    reach: f64,
    max_count: usize,
) -> Vec<&'a [f64]> {
    let mut next = ends.iter().min_by(|a, b| apart(a, x).total_cmp(&apart(b, x)));
    let mut far = vec![f64::INFINITY; ends.len()];
    let mut chosen: Vec<&[f64]> = Vec::new();
    while let Some(end) = next.filter(|_| chosen.len() < max_count) {
        chosen.push(end);
        far.iter_mut().zip(ends).for_each(|(far, other)| *far = far.min(apart(end, other)));
        let farthest = far.iter().zip(ends).max_by(|a, b| a.0.total_cmp(b.0));
        next = farthest.filter(|(far, _)| **far > reach).map(|(_, end)| end);
    }
    chosen
}

/// The largest difference of a variable (rad or m), modulo a turn where it can turn round.
fn apart(a: &[f64], b: &[f64], variables: &[Variable]) -> f64 {
    let difference = |((a, b), variable): ((&f64, &f64), &Variable)| {
        let difference = a - b;
        let turns = if variable.turns(SAME) { (difference / std::f64::consts::TAU).round() } else { 0.0 };
        difference - std::f64::consts::TAU * turns
    };
    a.iter().zip(b).zip(variables).map(difference).fold(0.0, |largest: f64, difference| largest.max(difference.abs()))
}

/// How many directions that count the variables bind.
fn rank(problem: Problem<'_>, x: &[f64]) -> usize {
    let (error, jacobian) = problem.arm.linearised(problem.target, x);
    let (_, jacobian) = scaled(&error, jacobian, problem.options.weights());
    if jacobian.is_empty() {
        return 0;
    }
    let Some(parts) = svd(&jacobian) else { return 0 };
    let values = parts.singular_values;
    values.iter().filter(|value| **value > RANK * values.max()).count()
}

#[cfg(test)]
mod tests;
