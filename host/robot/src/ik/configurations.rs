//! All postures that bring a tool to one target.
//!
//! The search of [`ik::solve`](super::solve) begins at many starts drawn within the limits, and every end that
//! reaches the target is kept. With as many joints as the target binds directions (the rank of the Jacobian) postures
//! are isolated: ends nearer to each other than [`SAME`] in every joint are one posture, and revolute joints that can
//! turn by 360 degrees are distinguished modulo a turn. How often each posture was met says how likely one was missed.
//!
//! With more joints the postures form manifolds, on which the arm moves without moving its tool (self-motion). Of
//! those a sample is reported: again and again the posture farthest from all that were chosen before.

use darm_core::actuator::JointKind;
use darm_core::ik::{self, Arm, Options, Status, scale};
use darm_core::se::Pose;
use darm_core::tree::{Frames, singular};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::objective::{Distance, Objective as _};

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

/// All postures that bring the tool to `target`, those nearest to `q` first: at most `most` of a self-motion.
///
/// `options` are those of one search, [`Options::starts`] the number of starts; no posture where none reaches the
/// target.
pub fn configurations<const N: usize>(
    arm: &Arm<f64, N>,
    target: &Pose<f64>,
    q: &[f64; N],
    options: &Options<f64>,
    max_count: usize,
) -> Configurations {
    let distance = Distance::new(arm, target, options);
    let turns = turns(arm);
    let tight = |tolerance: f64| if tolerance.is_finite() { tolerance.min(TOLERANCE) } else { tolerance };
    let once = Options {
        position_m: tight(options.position_m),
        orientation_rad: tight(options.orientation_rad),
        starts: 1,
        ..*options
    };
    let mut random = ChaCha8Rng::seed_from_u64(options.seed);
    let mut ends: Vec<[f64; N]> = Vec::new();
    let mut start = *q;
    for _ in 0..options.starts {
        let found = ik::solve(arm, target, &start, &once);
        if found.status == Status::Reached {
            ends.push(found.q);
        }
        let x: Vec<_> =
            distance.bounds().iter().map(|[low, high]| low + (high - low) * random.random::<f64>()).collect();
        start = distance.positions(&x);
    }
    let rank = ends.iter().map(|end| rank(arm, target, end, options)).max().unwrap_or(0);
    let freedom = if ends.is_empty() { 0 } else { distance.bounds().len().saturating_sub(rank) };
    let apart = |a: &[f64; N], b: &[f64; N]| apart(a, b, &turns);
    let (reach, max_count) = if freedom == 0 { (SAME, usize::MAX) } else { (0.0, max_count) };
    let mut chosen = spread(&ends, q, apart, reach, max_count);
    chosen.sort_by(|a, b| apart(a, q).total_cmp(&apart(b, q)));
    let mut postures: Vec<_> = chosen.iter().map(|end| Posture { q: end.to_vec(), met: 0 }).collect();
    for end in &ends {
        let nearest = (0..chosen.len()).min_by(|a, b| apart(&chosen[*a], end).total_cmp(&apart(&chosen[*b], end)));
        if let Some(posture) = nearest.and_then(|index| postures.get_mut(index)) {
            posture.met += 1;
        }
    }
    Configurations { freedom, postures, starts: options.starts, reached: ends.len() }
}

/// Up to `most` of the `ends`: that nearest to `q`, then again and again the farthest from all chosen, while it is
/// farther than `reach`.
fn spread<const N: usize>(
    ends: &[[f64; N]],
    q: &[f64; N],
    apart: impl Fn(&[f64; N], &[f64; N]) -> f64,
    reach: f64,
    max_count: usize,
) -> Vec<[f64; N]> {
    let mut next = ends.iter().min_by(|a, b| apart(a, q).total_cmp(&apart(b, q)));
    let mut far = vec![f64::INFINITY; ends.len()];
    let mut chosen = Vec::new();
    while let Some(end) = next.filter(|_| chosen.len() < max_count) {
        chosen.push(*end);
        far.iter_mut().zip(ends).for_each(|(far, other)| *far = far.min(apart(end, other)));
        let farthest = far.iter().zip(ends).max_by(|a, b| a.0.total_cmp(b.0));
        next = farthest.filter(|(far, _)| **far > reach).map(|(_, end)| end);
    }
    chosen
}

/// The largest difference of a joint (rad or m), modulo a turn where it can turn round.
fn apart<const N: usize>(a: &[f64; N], b: &[f64; N], turns: &[bool; N]) -> f64 {
    let difference = |((a, b), turns): ((&f64, &f64), &bool)| {
        let difference = a - b;
        if *turns {
            difference - std::f64::consts::TAU * (difference / std::f64::consts::TAU).round()
        } else {
            difference
        }
    };
    a.iter().zip(b).zip(turns).map(difference).fold(0.0, |largest: f64, difference| largest.max(difference.abs()))
}

/// Which joints can turn by 360 degrees.
fn turns<const N: usize>(arm: &Arm<f64, N>) -> [bool; N] {
    std::array::from_fn(|k| {
        let [low, high] = arm.limits[k];
        arm.tree.links[k].kind == JointKind::Revolute && high - low >= std::f64::consts::TAU - SAME
    })
}

/// How many directions that count the joints which can move bind.
fn rank<const N: usize>(arm: &Arm<f64, N>, target: &Pose<f64>, q: &[f64; N], options: &Options<f64>) -> usize {
    let (mut error, mut jacobian) = arm.linearised(target, q, &mut Frames::default());
    scale(&mut error, &mut jacobian, options.weights());
    for (mut column, [low, high]) in jacobian.column_iter_mut().zip(arm.limits) {
        if low >= high {
            column.fill(0.0);
        }
    }
    let [largest, ..] = singular::singular_values(&jacobian);
    singular::rank(&jacobian, RANK * largest)
}

#[cfg(test)]
mod tests;
