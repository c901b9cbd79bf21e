//! The paper's incremental scheme, for comparison.
//!
//! The end frames are led to the desired ones in n_div equal steps along the screws that join them (Rodrigues). At
//! step d the frame that the arm really has is fed back: δx_k = (H_k⁻¹·H_k(d+1) − I)ᵛ, eq. (11); δa = G†·δx, eq. (13),
//! with the Jacobian G by central differences and G† by singular values, those of rounding size left out (the
//! paper's regularisation).

use darm_core::se::{Pose, Twist};
use nalgebra::{DMatrix, DVector, Vector3};

use super::newton::damped_inverse;
use super::problem::Problem;
use super::{Found, SynthesisError};

/// Half the interval of the differences, in units of the unknowns.
const HALF_INTERVAL: f64 = 1e-6;

pub(super) fn solve(problem: &mut Problem, steps: u32) -> Result<Found, SynthesisError> {
    let mut unknowns = problem.start();
    let from = problem.poses(&unknowns)?;
    let ways: Vec<Twist<f64>> = from.iter().zip(&problem.targets).map(|(from, t)| from.to(&t.pose).log()).collect();
    for step in 1..=steps {
        let share = f64::from(step) / f64::from(steps);
        let poses = problem.poses(&unknowns)?;
        let goals = from.iter().zip(&ways).map(|(from, way)| *from * Pose::exp(&(*way * share)));
        let apart: Vec<Twist<f64>> = poses.iter().zip(goals).map(|(pose, goal)| vee(&pose.to(&goal))).collect();
        let jacobian = differences(problem, &unknowns, &poses)?;
        unknowns += damped_inverse(&jacobian, &stacked(problem, &apart), 0.0).component_div(problem.weights());
    }
    Ok(Found { unknowns, iterations: steps, starts: 1 })
}

/// (H − I)ᵛ, eq. (9): the part of a small motion that is a screw.
fn vee(motion: &Pose<f64>) -> Twist<f64> {
    let r = &motion.rotation;
    let angular = Vector3::new(r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12) * 0.5;
    Twist { angular, linear: motion.position }
}

fn stacked(problem: &Problem, twists: &[Twist<f64>]) -> DVector<f64> {
    let n = problem.n_rows();
    DVector::from_iterator(twists.len() * n, twists.iter().flat_map(|twist| problem.row(twist).into_iter().take(n)))
}

/// G of eq. (12), its columns in the scale of the unknowns' weights.
fn differences(
    problem: &mut Problem,
    unknowns: &DVector<f64>,
    poses: &[Pose<f64>],
) -> Result<DMatrix<f64>, SynthesisError> {
    let mut jacobian = DMatrix::zeros(poses.len() * problem.n_rows(), unknowns.len());
    for column in 0..unknowns.len() {
        let mut moved = |by: f64| {
            let mut unknowns = unknowns.clone();
            unknowns[column] += by;
            problem.poses(&unknowns)
        };
        let (above, below) = (moved(HALF_INTERVAL)?, moved(-HALF_INTERVAL)?);
        let twists: Vec<Twist<f64>> = poses
            .iter()
            .zip(above.iter().zip(&below))
            .map(|(pose, (above, below))| vee(&pose.to(above)) - vee(&pose.to(below)))
            .collect();
        let scale = 2.0 * HALF_INTERVAL * problem.weights()[column];
        jacobian.set_column(column, &(stacked(problem, &twists) / scale));
    }
    Ok(jacobian)
}
