//! A whole trajectory at once: markers followed softly and smoothly, feet, centre of mass and limits held exactly.
//!
//! # Problem
//!
//! Over all frames k, with x_k the posture of base and joints and ⊖ the change between two postures:
//!
//! min Σ_k Σ_i ‖m_i(x_k) − m̂_ik‖²/σ_m² + Σ_k ‖(x_{k+1} ⊖ x_k) − (x_k ⊖ x_{k−1})‖²/(Δt⁴ σ_a²)
//! subject to c(x_k) = 0 (feet, centre of mass, and until it is left the chair) and q_min ≤ q_k ≤ q_max
//!
//! While a chair is sat on it tells how high the centre of mass can be: its height z is then followed, (z − ẑ)²/σ_z² in the
//! sum, and not held.
//!
//! # Method
//!
//! Gauss–Newton in the null space of the constraints: of each frame the step is p_k + Z_k y_k with p_k = −J_c⁺ c and
//! J_c Z_k = 0; the y of all frames solve one banded system. A joint at its limit that the step would push beyond is left out
//! of it. Each step is followed by Newton's method on the constraints of every frame, so what is accepted holds them.
//! The paper solves frame by frame with priorities (its reference 11); constraints and markers are the same.

use std::ops::AddAssign as _;

use darm_core::real::Vec3;
use darm_core::se::{Pose, rotation_log};
use darm_core::tree::TreeError;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::banded::Banded;
use super::placed::Placed;
use super::{Fixed, Posture};
use darm_robot::robot::Robot;

/// Constraints are held to this, m and rad.
const HELD: f64 = 1e-10;
/// Steps of the whole trajectory at most.
const STEPS: usize = 40;
/// Newton steps on the constraints of a frame at most.
const CORRECTIONS: usize = 40;
/// The height of the centre of mass above a chair is followed to this, m.
const SEATED_M: f64 = 0.002;
/// Singular values below this share of the largest constrain nothing more; its square is a share of eigenvalues, which
/// rounding must not reach.
const REDUNDANT: f64 = 1e-6;
/// The cost falls by less than this share: done; of a frame alone, which is a start for all together, by less than the second.
const SETTLED: (f64, f64) = (1e-5, 1e-3);

/// A frame of a link that stands still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// The joint that moves the link; `None`: the base.
    pub joint: Option<usize>,
    /// The frame in the link.
    pub pose: Pose<f64>,
    /// Where it stands in the world.
    pub stands: Pose<f64>,
}

/// A chair on which something sits still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chair<'a> {
    /// Points that sit.
    pub seat: &'a [Fixed],
    /// Where their middle is, m.
    pub at: Vec3<f64>,
    /// In so many frames, the first ones.
    pub frames: usize,
}

/// What a trajectory shall follow and hold.
pub struct Problem<'a> {
    /// The tree.
    pub robot: &'a Robot,
    /// Time between two frames, s.
    pub step_s: f64,
    /// Markers on the tree.
    pub markers: &'a [Fixed],
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

/// Constraints of a frame and their Jacobian.
fn hard(problem: &Problem<'_>, placed: &Placed, frame: usize) -> (DVector<f64>, DMatrix<f64>) {
    let wide = 6 + problem.robot.joints.len();
    let chair = problem.chair_of(frame);
    let axes = problem.held_axes(frame);
    let seated = 6 * problem.feet.len() + axes.len();
    let rows = seated + if chair.is_some() { 3 } else { 0 };
    let (mut off, mut jacobian) = (DVector::zeros(rows), DMatrix::zeros(rows, wide));
    for (k, foot) in problem.feet.iter().enumerate() {
        let pose = placed.pose(foot.joint, &foot.pose);
        let turn = rotation_log(&(pose.rotation * foot.stands.rotation.transpose()));
        off.fixed_rows_mut::<3>(6 * k).copy_from(&turn);
        off.fixed_rows_mut::<3>(6 * k + 3).copy_from(&(pose.position - foot.stands.position));
        jacobian.rows_mut(6 * k, 6).copy_from(&placed.jacobian(foot.joint, &foot.pose));
    }
    if let Some((targets, _)) = problem.com {
        let (com, of_com) = placed.com();
        for (row, &axis) in axes.iter().enumerate() {
            off[6 * problem.feet.len() + row] = com[axis] - targets[frame][axis];
            jacobian.row_mut(6 * problem.feet.len() + row).copy_from(&of_com.row(axis));
        }
    }
    if let Some(chair) = chair {
        let share = 1.0 / chair.seat.len() as f64;
        off.fixed_rows_mut::<3>(seated).copy_from(&-chair.at);
        for at in chair.seat {
            off.fixed_rows_mut::<3>(seated).add_assign(&(placed.point(at) * share));
            let of_point = placed.jacobian(at.joint, &Pose::at(at.point));
            jacobian.rows_mut(seated, 3).add_assign(&(of_point.rows(3, 3) * share));
        }
    }
    (off, jacobian)
}

impl Problem<'_> {
    /// The chair while it is sat on.
    fn chair_of(&self, frame: usize) -> Option<Chair<'_>> {
        self.chair.filter(|chair| frame < chair.frames && !chair.seat.is_empty())
    }

    /// Axes along which the centre of mass is held.
    fn held_axes(&self, frame: usize) -> Vec<usize> {
        let sits = self.chair_of(frame).is_some();
        self.com.map_or(Vec::new(), |(_, axes)| (0..3).filter(|&k| axes[k] && !(k == 2 && sits)).collect())
    }

    /// What a row of the constraints holds, in words.
    fn constraint(&self, row: usize, frame: usize) -> String {
        if let Some(foot) = self.feet.get(row / 6) {
            return format!("the contact of {}", crate::identify::body_name(self.robot, foot.joint));
        }
        match self.held_axes(frame).get(row - 6 * self.feet.len()) {
            Some(&axis) => format!("the centre of mass along {}", ["x", "y", "z"][axis]),
            None => "the seat".into(),
        }
    }

    /// How far the centre of mass is above its height on a chair, m, and the row of its Jacobian.
    fn height(&self, placed: &Placed, frame: usize) -> Option<(f64, DVector<f64>)> {
        self.chair_of(frame)?;
        let (targets, _) = self.com.filter(|(_, axes)| axes[2])?;
        let (com, of_com) = placed.com();
        Some((com.z - targets[frame].z, of_com.row(2).transpose()))
    }
}

/// −J⁺ c, and an orthonormal basis of what J leaves free of these columns.
fn split(off: &DVector<f64>, jacobian: &DMatrix<f64>, free: &[usize]) -> (DVector<f64>, DMatrix<f64>) {
    let wide = jacobian.ncols();
    let spread = |columns: &DMatrix<f64>| {
        let mut all = DMatrix::zeros(wide, columns.ncols());
        free.iter().enumerate().for_each(|(row, &k)| all.row_mut(k).copy_from(&columns.row(row)));
        all
    };
    if off.is_empty() {
        return (DVector::zeros(wide), spread(&DMatrix::identity(free.len(), free.len())));
    }
    // JᵀJ has all directions as eigenvectors, those that J leaves free too.
    let own = jacobian.select_columns(free);
    let eigen = own.tr_mul(&own).symmetric_eigen();
    let least = REDUNDANT * REDUNDANT * eigen.eigenvalues.max();
    let (held, left): (Vec<usize>, Vec<usize>) = (0..free.len()).partition(|&k| eigen.eigenvalues[k] > least);
    let across = eigen.eigenvectors.select_columns(&held);
    let inverse = DVector::from_iterator(held.len(), held.iter().map(|&k| 1.0 / eigen.eigenvalues[k]));
    let step = -(&across * (across.tr_mul(&own.tr_mul(off))).component_mul(&inverse));
    (
        spread(&DMatrix::from_column_slice(free.len(), 1, step.as_slice())).column(0).into_owned(),
        spread(&eigen.eigenvectors.select_columns(&left)),
    )
}

/// Moves joints that are beyond a limit onto it; tells which are at one.
fn clamp(robot: &Robot, q: &mut [f64]) -> Vec<bool> {
    let at = |(joint, q): (&darm_robot::robot::RobotJoint, &mut f64)| match joint.limits {
        Some([low, high]) if *q <= low || *q >= high => {
            *q = q.clamp(low, high);
            true
        }
        _ => false,
    };
    robot.joints.iter().zip(q).map(at).collect()
}

/// What the search of a posture ended with: the constraint that is farthest off, and by how much, m or rad.
type Off = (usize, f64);

/// The posture near this one that holds the constraints of a frame within the limits, or how far off the search ended.
fn held(problem: &Problem<'_>, placed: &mut Placed, frame: usize, start: &Posture) -> Result<Posture, Off> {
    let mut posture = start.clone();
    let mut pinned = vec![false; posture.q.len()];
    clamp(problem.robot, &mut posture.q);
    let mut worst = (0, f64::INFINITY);
    for _ in 0..CORRECTIONS {
        placed.place(&posture);
        let (off, jacobian) = hard(problem, placed, frame);
        let row = if off.is_empty() { 0 } else { off.iamax() };
        worst = (row, off.get(row).map_or(0.0, |off| off.abs()));
        if worst.1 <= HELD {
            return Ok(posture);
        }
        let free: Vec<usize> = (0..jacobian.ncols()).filter(|&k| k < 6 || !pinned[k - 6]).collect();
        posture = posture.moved(&split(&off, &jacobian, &free).0);
        let before = posture.q.clone();
        clamp(problem.robot, &mut posture.q);
        pinned.iter_mut().zip(before.iter().zip(&posture.q)).for_each(|(pin, (a, b))| *pin |= a != b);
    }
    Err(worst)
}

/// Residuals and normal equations of the markers of a frame.
struct Soft {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

/// One frame, made linear.
struct Linear {
    soft: Soft,
    off: DVector<f64>,
    jacobian: DMatrix<f64>,
}

fn linear(problem: &Problem<'_>, placed: &mut Placed, frame: usize, posture: &Posture) -> Linear {
    placed.place(posture);
    let wide = 6 + posture.q.len();
    let weight = problem.marker_m.powi(-2);
    let seen: Vec<_> =
        problem.markers.iter().zip(&problem.targets[frame]).filter_map(|(m, t)| Some((m, (*t)?))).collect();
    let (mut rows, mut left) = (DMatrix::zeros(3 * seen.len(), wide), DVector::zeros(3 * seen.len()));
    for (k, (marker, target)) in seen.iter().enumerate() {
        rows.rows_mut(3 * k, 3).copy_from(&placed.jacobian(marker.joint, &Pose::at(marker.point)).rows(3, 3));
        left.fixed_rows_mut::<3>(3 * k).copy_from(&(target - placed.point(marker)));
    }
    let transposed = rows.transpose() * weight;
    let mut soft = Soft { matrix: &transposed * rows, right: transposed * left };
    if let Some((above, row)) = problem.height(placed, frame) {
        let weight = SEATED_M.powi(-2);
        soft.matrix.ger(weight, &row, &row, 1.0);
        soft.right.axpy(-weight * above, &row, 1.0);
    }
    let (off, jacobian) = hard(problem, placed, frame);
    Linear { soft, off, jacobian }
}

/// Sum of squares of the markers of a frame over their σ, and how many were seen.
fn followed(problem: &Problem<'_>, placed: &mut Placed, frame: usize, posture: &Posture) -> (f64, usize) {
    placed.place(posture);
    let seen = problem.markers.iter().zip(&problem.targets[frame]).filter_map(|(m, t)| Some((m, (*t)?)));
    seen.fold((0.0, 0), |(sum, count), (marker, target)| {
        (sum + (placed.point(marker) - target).norm_squared() / problem.marker_m.powi(2), count + 1)
    })
}

/// Change of the change about a frame.
fn bend(postures: &[Posture], k: usize) -> DVector<f64> {
    postures[k].to(&postures[k + 1]) - postures[k - 1].to(&postures[k])
}

fn cost(problem: &Problem<'_>, postures: &[Posture]) -> Result<f64, TreeError> {
    let soft: Result<Vec<f64>, TreeError> = each(problem, postures, |placed, frame, posture| {
        let markers = followed(problem, placed, frame, posture).0;
        markers + problem.height(placed, frame).map_or(0.0, |(above, _)| (above / SEATED_M).powi(2))
    });
    let weight = smoothness(problem);
    let bends: f64 = (1..postures.len().saturating_sub(1)).map(|k| bend(postures, k).norm_squared() * weight).sum();
    Ok(soft?.iter().sum::<f64>() + bends)
}

fn smoothness(problem: &Problem<'_>) -> f64 {
    (problem.step_s * problem.step_s * problem.acceleration).powi(-2)
}

/// Every frame on its own, on all cores.
fn each<T: Send>(
    problem: &Problem<'_>,
    postures: &[Posture],
    of: impl Fn(&mut Placed, usize, &Posture) -> T + Sync,
) -> Result<Vec<T>, TreeError> {
    let make = || Placed::new(problem.robot);
    postures
        .par_iter()
        .enumerate()
        .map_init(make, |placed, (frame, posture)| match placed {
            Ok(placed) => Ok(of(placed, frame, posture)),
            Err(error) => Err(*error),
        })
        .collect()
}

/// The postures that hold the constraints, each near its start.
fn all_held(problem: &Problem<'_>, postures: &[Posture]) -> Result<Vec<Posture>, TrajectoryError> {
    let found = each(problem, postures, |placed, frame, posture| held(problem, placed, frame, posture))?;
    let out = |(frame, found): (usize, Result<Posture, Off>)| {
        found.map_err(|(row, off)| {
            let what = problem.constraint(row, frame);
            TrajectoryError::OutOfReach { frame: frame + 1, what, off_mm: 1e3 * off }
        })
    };
    found.into_iter().enumerate().map(out).collect()
}

/// The step of all frames with some joints left out, for this damping.
fn step(
    problem: &Problem<'_>,
    (postures, frames): (&[Posture], &[Linear]),
    pinned: &[Vec<bool>],
    damping: f64,
) -> Option<Vec<DVector<f64>>> {
    let free = |k: usize| -> Vec<usize> { (0..6 + pinned[k].len()).filter(|&i| i < 6 || !pinned[k][i - 6]).collect() };
    let parts: Vec<(DVector<f64>, DMatrix<f64>)> =
        frames.par_iter().enumerate().map(|(k, frame)| split(&frame.off, &frame.jacobian, &free(k))).collect();
    let mut start = vec![0; parts.len() + 1];
    parts.iter().enumerate().for_each(|(k, (_, z))| start[k + 1] = start[k] + z.ncols());
    let width = (0..parts.len()).map(|k| start[(k + 3).min(parts.len())] - start[k]).max().unwrap_or(1);
    let n = start[parts.len()];
    let (mut matrix, mut right) = (Banded::zeros(n, width.saturating_sub(1).max(1)), DVector::zeros(n));
    let mut put = |(later, earlier): (usize, usize), block: &DMatrix<f64>| {
        for column in 0..block.ncols() {
            (0..block.nrows())
                .for_each(|row| matrix.add(start[later] + row, start[earlier] + column, block[(row, column)]));
        }
    };
    for (k, ((p, z), frame)) in parts.iter().zip(frames).enumerate() {
        let soft = &frame.soft;
        // Nothing is held: Z is the identity.
        let mut own = if z.is_square() { soft.matrix.clone() } else { z.transpose() * (&soft.matrix * z) };
        (0..own.nrows()).for_each(|i| own[(i, i)] += damping);
        put((k, k), &own);
        let pull = z.tr_mul(&(&soft.right - &soft.matrix * p));
        right.rows_mut(start[k], z.ncols()).add_assign(&pull);
    }
    let weight = smoothness(problem);
    for k in 1..parts.len().saturating_sub(1) {
        let near = [(k - 1, 1.0), (k, -2.0), (k + 1, 1.0)];
        let left = near.iter().fold(bend(postures, k), |sum, (j, factor)| sum + &parts[*j].0 * *factor);
        for (i, (a, of_a)) in near.iter().enumerate() {
            let pull = parts[*a].1.tr_mul(&left) * (-weight * of_a);
            right.rows_mut(start[*a], pull.len()).add_assign(&pull);
            for (b, of_b) in &near[..=i] {
                let (later, earlier) = (&parts[*a].1, &parts[*b].1);
                let both = later.is_square() && earlier.is_square();
                let shared = if both { later.clone() } else { later.transpose() * earlier };
                put((*a, *b), &(shared * (weight * of_a * of_b)));
            }
        }
    }
    let y = matrix.solve(right)?;
    Some(parts.iter().enumerate().map(|(k, (p, z))| p + z * y.rows(start[k], z.ncols())).collect())
}

/// Rounds in which joints are left out of one step.
const PINNINGS: usize = 4;

/// The step that pushes no joint beyond the limit that it is at.
fn limited(problem: &Problem<'_>, postures: &[Posture], frames: &[Linear], damping: f64) -> Option<Vec<DVector<f64>>> {
    let mut pinned = vec![vec![false; problem.robot.joints.len()]; postures.len()];
    for _ in 0..PINNINGS {
        let steps = step(problem, (postures, frames), &pinned, damping)?;
        let mut more = false;
        for (k, posture) in postures.iter().enumerate() {
            for (i, joint) in problem.robot.joints.iter().enumerate() {
                let Some([low, high]) = joint.limits else { continue };
                let change = steps[k][6 + i];
                let out = posture.q[i] >= high && change > 0.0 || posture.q[i] <= low && change < 0.0;
                more |= out && !pinned[k][i];
                pinned[k][i] |= out;
            }
        }
        if !more {
            return Some(steps);
        }
    }
    step(problem, (postures, frames), &pinned, damping)
}

/// The trajectory that follows the markers best, from these postures.
pub fn solve(problem: &Problem<'_>, start: &[Posture]) -> Result<Trajectory, TrajectoryError> {
    let mut postures = all_held(problem, start)?;
    let (mut best, mut damping, mut steps, mut settled) = (cost(problem, &postures)?, 1e-3, 0, false);
    let enough = if start.len() == 1 { SETTLED.1 } else { SETTLED.0 };
    while steps < STEPS && !settled && damping < 1e12 {
        let frames = each(problem, &postures, |placed, frame, posture| linear(problem, placed, frame, posture))?;
        steps += 1;
        let Some(change) = limited(problem, &postures, &frames, damping) else {
            damping *= 100.0;
            continue;
        };
        let tried: Vec<Posture> = postures.iter().zip(&change).map(|(posture, change)| posture.moved(change)).collect();
        let next =
            all_held(problem, &tried).ok().map(|next| cost(problem, &next).map(|cost| (next, cost))).transpose()?;
        match next {
            Some((next, lower)) if lower <= best => {
                settled = best - lower <= enough * best;
                (postures, best, damping) = (next, lower, (damping / 10.0).max(1e-9));
            }
            _ => damping *= 30.0,
        }
    }
    told(problem, postures, steps, settled || damping >= 1e12)
}

fn told(
    problem: &Problem<'_>,
    postures: Vec<Posture>,
    steps: usize,
    settled: bool,
) -> Result<Trajectory, TrajectoryError> {
    let off = each(problem, &postures, |placed, frame, posture| {
        placed.place(posture);
        let off = hard(problem, placed, frame).0;
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
