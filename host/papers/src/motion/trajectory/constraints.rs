//! The constraints of a frame: feet, seat, centre of mass and limits; and postures that meet them.

use std::ops::AddAssign as _;

use darm_core::se::{Pose, rotation_log};
use nalgebra::{DMatrix, DVector};

use super::{Chair, Posture, Problem, TrajectoryError};
use crate::motion::placed::Placed;
use darm_robot::robot::{Robot, RobotJoint};

/// Constraints are met to this, m and rad.
const TOLERANCE: f64 = 1e-10;
/// Newton steps on the constraints of a frame at most.
const CORRECTIONS: usize = 40;
/// Singular values below this share of the largest constrain nothing more; its square is a share of eigenvalues, which
/// rounding must not reach.
const REDUNDANT: f64 = 1e-6;

/// Constraints of a frame and their Jacobian.
pub(super) fn constraint_rows(problem: &Problem<'_>, placed: &Placed, frame: usize) -> (DVector<f64>, DMatrix<f64>) {
    let wide = 6 + problem.robot.joints.len();
    let chair = problem.chair_of(frame);
    let axes = problem.constrained_axes(frame);
    let seated = 6 * problem.feet.len() + axes.len();
    let rows = seated + if chair.is_some() { 3 } else { 0 };
    let (mut off, mut jacobian) = (DVector::zeros(rows), DMatrix::zeros(rows, wide));
    for (k, foot) in problem.feet.iter().enumerate() {
        let pose = placed.pose(foot.joint, &foot.pose);
        let turn = rotation_log(&(pose.rotation * foot.placed.rotation.transpose()));
        off.fixed_rows_mut::<3>(6 * k).copy_from(&turn);
        off.fixed_rows_mut::<3>(6 * k + 3).copy_from(&(pose.position - foot.placed.position));
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
    pub(super) fn chair_of(&self, frame: usize) -> Option<Chair<'_>> {
        self.chair.filter(|chair| frame < chair.frames && !chair.seat.is_empty())
    }

    /// Axes along which the centre of mass is constrained.
    fn constrained_axes(&self, frame: usize) -> Vec<usize> {
        let sits = self.chair_of(frame).is_some();
        self.com.map_or(Vec::new(), |(_, axes)| (0..3).filter(|&k| axes[k] && !(k == 2 && sits)).collect())
    }

    /// What a row of the constraints holds, in words.
    fn constraint(&self, row: usize, frame: usize) -> String {
        if let Some(foot) = self.feet.get(row / 6) {
            return format!("the contact of {}", crate::identify::body_name(self.robot, foot.joint));
        }
        match self.constrained_axes(frame).get(row - 6 * self.feet.len()) {
            Some(&axis) => format!("the centre of mass along {}", ["x", "y", "z"][axis]),
            None => "the seat".into(),
        }
    }
}

/// −J⁺ c, and an orthonormal basis of what J leaves free of these columns.
pub(super) fn split(off: &DVector<f64>, jacobian: &DMatrix<f64>, free: &[usize]) -> (DVector<f64>, DMatrix<f64>) {
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
    let threshold = REDUNDANT * REDUNDANT * eigen.eigenvalues.max();
    let (bound, left): (Vec<usize>, Vec<usize>) = (0..free.len()).partition(|&k| eigen.eigenvalues[k] > threshold);
    let across = eigen.eigenvectors.select_columns(&bound);
    let inverse = DVector::from_iterator(bound.len(), bound.iter().map(|&k| 1.0 / eigen.eigenvalues[k]));
    let step = -(&across * (across.tr_mul(&own.tr_mul(off))).component_mul(&inverse));
    (
        spread(&DMatrix::from_column_slice(free.len(), 1, step.as_slice())).column(0).into_owned(),
        spread(&eigen.eigenvectors.select_columns(&left)),
    )
}

/// Moves joints that are beyond a limit onto it; which are at one.
fn clamp(robot: &Robot, q: &mut [f64]) -> Vec<bool> {
    let at = |(joint, q): (&RobotJoint, &mut f64)| match joint.limits {
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
fn constrained(problem: &Problem<'_>, placed: &mut Placed, frame: usize, start: &Posture) -> Result<Posture, Off> {
    let mut posture = start.clone();
    let mut pinned = vec![false; posture.q.len()];
    clamp(problem.robot, &mut posture.q);
    let mut worst = (0, f64::INFINITY);
    for _ in 0..CORRECTIONS {
        placed.place(&posture);
        let (off, jacobian) = constraint_rows(problem, placed, frame);
        let row = if off.is_empty() { 0 } else { off.iamax() };
        worst = (row, off.get(row).map_or(0.0, |off| off.abs()));
        if worst.1 <= TOLERANCE {
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

/// The postures that hold the constraints, each near its start.
pub(super) fn all_constrained(problem: &Problem<'_>, postures: &[Posture]) -> Result<Vec<Posture>, TrajectoryError> {
    let found = problem.each(postures, |placed, frame, posture| constrained(problem, placed, frame, posture))?;
    let out = |(frame, found): (usize, Result<Posture, Off>)| {
        found.map_err(|(row, off)| {
            let what = problem.constraint(row, frame);
            TrajectoryError::OutOfReach { frame: frame + 1, what, off_mm: 1e3 * off }
        })
    };
    found.into_iter().enumerate().map(out).collect()
}
