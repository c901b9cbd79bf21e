//! What a trajectory costs: distances of the markers, and changes of acceleration.

use darm_core::se::Pose;
use darm_core::tree::TreeError;
use nalgebra::{DMatrix, DVector};

use super::constraints::constraint_rows;
use super::{Posture, Problem};
use crate::motion::placed::Placed;

/// The height of the centre of mass above a chair is followed to this, m.
const SEATED_M: f64 = 0.002;

/// Residuals and normal equations of the markers of a frame.
pub(super) struct Soft {
    pub(super) matrix: DMatrix<f64>,
    pub(super) right: DVector<f64>,
}

/// One frame, made linear.
pub(super) struct Linear {
    pub(super) soft: Soft,
    pub(super) off: DVector<f64>,
    pub(super) jacobian: DMatrix<f64>,
}

pub(super) fn linear(problem: &Problem<'_>, placed: &mut Placed, frame: usize, posture: &Posture) -> Linear {
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
    let (off, jacobian) = constraint_rows(problem, placed, frame);
    Linear { soft, off, jacobian }
}

/// Sum of squares of the markers of a frame over their σ, and how many were seen.
pub(super) fn followed(problem: &Problem<'_>, placed: &mut Placed, frame: usize, posture: &Posture) -> (f64, usize) {
    placed.place(posture);
    let seen = problem.markers.iter().zip(&problem.targets[frame]).filter_map(|(m, t)| Some((m, (*t)?)));
    seen.fold((0.0, 0), |(sum, count), (marker, target)| {
        (sum + (placed.point(marker) - target).norm_squared() / problem.marker_m.powi(2), count + 1)
    })
}

/// Change of the change about a frame.
pub(super) fn second_difference(postures: &[Posture], k: usize) -> DVector<f64> {
    postures[k].to(&postures[k + 1]) - postures[k - 1].to(&postures[k])
}

pub(super) fn cost(problem: &Problem<'_>, postures: &[Posture]) -> Result<f64, TreeError> {
    let soft: Result<Vec<f64>, TreeError> = problem.each(postures, |placed, frame, posture| {
        let markers = followed(problem, placed, frame, posture).0;
        markers + problem.height(placed, frame).map_or(0.0, |(above, _)| (above / SEATED_M).powi(2))
    });
    let weight = smoothness(problem);
    let bends: f64 =
        (1..postures.len().saturating_sub(1)).map(|k| second_difference(postures, k).norm_squared() * weight).sum();
    Ok(soft?.iter().sum::<f64>() + bends)
}

pub(super) fn smoothness(problem: &Problem<'_>) -> f64 {
    (problem.step_s * problem.step_s * problem.acceleration).powi(-2)
}

impl Problem<'_> {
    /// How far the centre of mass is above its height on a chair, m, and the row of its Jacobian.
    fn height(&self, placed: &Placed, frame: usize) -> Option<(f64, DVector<f64>)> {
        self.chair_of(frame)?;
        let (targets, _) = self.com.filter(|(_, axes)| axes[2])?;
        let (com, of_com) = placed.com();
        Some((com.z - targets[frame].z, of_com.row(2).transpose()))
    }
}
