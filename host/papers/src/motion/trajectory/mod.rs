//! A complete trajectory at once: markers are followed softly and smoothly, feet, centre of mass and limits are met exactly.
//!
//! # Problem
//!
//! Over all frames k, with x_k the posture of base and joints and ⊖ the change between two postures:
//!
//! min Σ_k Σ_i ‖m_i(x_k) − m̂_ik‖²/σ_m² + Σ_k ‖(x_{k+1} ⊖ x_k) − (x_k ⊖ x_{k−1})‖²/(Δt⁴ σ_a²)
//! subject to c(x_k) = 0 (feet, centre of mass, and until it is left the chair) and q_min ≤ q_k ≤ q_max
//!
//! While a chair is sat on it says how high the centre of mass can be: its height z is then followed, (z − ẑ)²/σ_z² in the
//! sum, and not held.
//!
//! # Method
//!
//! Gauss–Newton in the null space of the constraints: of each frame the step is p_k + Z_k y_k with p_k = −J_c⁺ c and
//! J_c Z_k = 0; the y of all frames solve one banded system. A joint at its limit that the step would push beyond is left out
//! of it. Each step is followed by Newton's method on the constraints of every frame, so what is accepted holds them.
//! The paper solves frame by frame with priorities (its reference 11); constraints and markers are the same.

mod constraints;
mod cost;
mod step;

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::TreeError;
use rayon::prelude::*;

use self::constraints::{all_constrained, constraint_rows};
use self::cost::{cost, followed, linear};
use self::step::limited;
use super::placed::Placed;
use super::{BodyPoint, Posture};
use darm_robot::robot::Robot;

/// Steps of the complete trajectory at most.
const STEPS: usize = 40;
/// The cost falls by less than this share: done; of a frame alone, which is a start for all together, by less than the second.
const SETTLED: (f64, f64) = (1e-5, 1e-3);

/// A frame of a link that does not move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// The joint that moves the link; `None`: the base.
    pub joint: Option<usize>,
    /// The frame in the link.
    pub pose: Pose<f64>,
    /// Where it is in the world.
    pub placed: Pose<f64>,
}

/// A chair on which something sits still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chair<'a> {
    /// Points that sit.
    pub seat: &'a [BodyPoint],
    /// Where their middle is, m.
    pub at: Vec3<f64>,
    /// In this many frames, the first ones.
    pub frames: usize,
}

/// What a trajectory shall follow and hold.
pub struct Problem<'a> {
    /// The tree.
    pub robot: &'a Robot,
    /// Time between two frames, s.
    pub step_s: f64,
    /// Markers on the tree.
    pub markers: &'a [BodyPoint],
    /// Where each marker shall be, frame by frame; `None`: nobody saw it.
    pub targets: &'a [Vec<Option<Vec3<f64>>>],
    /// Links that stand still.
    pub feet: &'a [Foot],
    /// What it sits on.
    pub chair: Option<Chair<'a>>,
    /// Where the centre of mass shall be in every frame, and along which axes; its height only off the chair.
    pub com: Option<(&'a [Vec3<f64>], [bool; 3])>,
    /// σ_m, m.
    pub marker_m: f64,
    /// σ_a, rad/s² or m/s².
    pub acceleration: f64,
}

impl Problem<'_> {
    /// A function of every frame by itself, on all cores.
    fn each<T: Send>(
        &self,
        postures: &[Posture],
        of: impl Fn(&mut Placed, usize, &Posture) -> T + Sync,
    ) -> Result<Vec<T>, TreeError> {
        let make = || Placed::new(self.robot);
        postures
            .par_iter()
            .enumerate()
            .map_init(make, |placed, (frame, posture)| match placed {
                Ok(placed) => Ok(of(placed, frame, posture)),
                Err(error) => Err(*error),
            })
            .collect()
    }
}

/// A trajectory that holds its constraints.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Frame by frame.
    pub postures: Vec<Posture>,
    /// RMS distance of the markers from their targets, m.
    pub marker_rms_m: f64,
    /// The largest of all frames that any constraint is off, m or rad.
    pub worst_constraint: f64,
    /// Steps.
    pub steps: usize,
    /// Whether the cost settled.
    pub settled: bool,
}

/// Why there is no trajectory.
#[derive(Debug, thiserror::Error)]
pub enum TrajectoryError {
    /// The tree cannot be computed.
    #[error(transparent)]
    Tree(#[from] TreeError),
    /// A frame has no posture that holds the constraints within the limits.
    #[error(
        "frame {frame}: no posture within the limits holds feet, seat and centre of mass, the nearest has {what} {off_mm:.1} mm off; scale the motion or start from another posture"
    )]
    OutOfReach {
        /// The frame, from 1.
        frame: usize,
        /// What is farthest off.
        what: String,
        /// How far off the nearest is, mm (or mrad).
        off_mm: f64,
    },
    /// The plates' moment has the wrong sign.
    #[error(
        "the plates' {column}: their centre of pressure is {off_mm:.0} mm off the person's, with the sign of {column} turned {turned_mm:.0} mm: it must be the moment that the ground exerts on the person, about the world's origin, z up"
    )]
    Turned {
        /// Mx or My.
        column: &'static str,
        /// RMS distance as measured, mm.
        off_mm: f64,
        /// And with its sign turned.
        turned_mm: f64,
    },
}

/// The trajectory that follows the markers best, from these postures.
///
/// # Errors
///
/// The joints of the robot make no tree, or a frame has no posture that holds the constraints within the limits.
pub fn solve(problem: &Problem<'_>, start: &[Posture]) -> Result<Trajectory, TrajectoryError> {
    let mut postures = all_constrained(problem, start)?;
    let (mut best, mut damping, mut steps, mut settled) = (cost(problem, &postures)?, 1e-3, 0, false);
    let enough = if start.len() == 1 { SETTLED.1 } else { SETTLED.0 };
    while steps < STEPS && !settled && damping < 1e12 {
        let frames = problem.each(&postures, |placed, frame, posture| linear(problem, placed, frame, posture))?;
        steps += 1;
        let Some(change) = limited(problem, &postures, &frames, damping) else {
            damping *= 100.0;
            continue;
        };
        let tried: Vec<Posture> = postures.iter().zip(&change).map(|(posture, change)| posture.moved(change)).collect();
        let next = all_constrained(problem, &tried)
            .ok()
            .map(|next| cost(problem, &next).map(|cost| (next, cost)))
            .transpose()?;
        match next {
            Some((next, lower)) if lower <= best => {
                settled = best - lower <= enough * best;
                (postures, best, damping) = (next, lower, (damping / 10.0).max(1e-9));
            }
            _ => damping *= 30.0,
        }
    }
    evaluated(problem, postures, steps, settled || damping >= 1e12)
}

/// A trajectory with its errors.
fn evaluated(
    problem: &Problem<'_>,
    postures: Vec<Posture>,
    steps: usize,
    settled: bool,
) -> Result<Trajectory, TrajectoryError> {
    let off = problem.each(&postures, |placed, frame, posture| {
        placed.place(posture);
        let off = constraint_rows(problem, placed, frame).0;
        let worst = if off.is_empty() { 0.0 } else { off.amax() };
        (worst, followed(problem, placed, frame, posture))
    })?;
    let (sum, count) = off.iter().fold((0.0, 0), |(sum, count), (_, (own, seen))| (sum + own, count + seen));
    Ok(Trajectory {
        worst_constraint: off.iter().map(|(worst, _)| *worst).fold(0.0, f64::max),
        marker_rms_m: problem.marker_m * (sum / count.max(1) as f64).sqrt(),
        postures,
        steps,
        settled,
    })
}
