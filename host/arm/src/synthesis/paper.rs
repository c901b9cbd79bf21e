//! The paper's incremental scheme, for comparison.
//!
//! The end frames are led to the desired ones in n_div equal steps along the screws that join them (Rodrigues):
//! δx_k = (H_k(d)⁻¹·H_k(d+1) − I)ᵛ, eq. (11); δa = G†·δx, eq. (13), with the Jacobian G by central differences. G† is the
//! weighted generalized inverse: of all exact steps it takes the one with the least ‖δa‖ (redundant case), and Tikhonov's
//! where there is none (insufficient case).
//!
//! H_k(d) is a frame of the interpolation in the text before eq. (1), and the frame of the arm in eq. (5), see [`Feedback`].

use darm_core::se::{Pose, Twist};
use nalgebra::{DMatrix, DVector, Vector3};

use super::newton::damped_inverse;
use super::problem::Problem;
use super::{Found, SynthesisError};

/// Half the interval of the differences, in units of the unknowns.
const HALF_INTERVAL: f64 = 1e-6;

/// The settings of the paper's scheme.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scheme {
    /// n_div of the paper.
    pub steps: u32,
    /// Tikhonov's parameter in the insufficient case, as a share of the Jacobian's norm.
    pub regularisation: f64,
    /// The frame that a step starts from.
    pub feedback: Feedback,
}

impl Scheme {
    /// The scheme with this number of steps, each from the frames of the arm.
    pub fn of(steps: u32) -> Self {
        Self { steps, regularisation: 1e-3, feedback: Feedback::Actual }
    }
}

/// The frame that a step starts from: H_k(d) of eq. (11).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feedback {
    /// That of the arm, eq. (5): each step corrects what the one before it left. The error falls as n_div⁻².
    Actual,
    /// That of the interpolation: what the steps leave adds up. The error falls as n_div⁻¹.
    Interpolated,
}

pub(super) fn solve(problem: &mut Problem, scheme: Scheme) -> Result<Found, SynthesisError> {
    let mut unknowns = problem.start();
    let from = problem.poses(&unknowns)?;
    let ways: Vec<Twist<f64>> = from.iter().zip(&problem.targets).map(|(from, t)| from.to(&t.pose).log()).collect();
    let interpolated = |step: u32| -> Vec<Pose<f64>> {
        let share = f64::from(step) / f64::from(scheme.steps);
        from.iter().zip(&ways).map(|(from, way)| *from * Pose::exp(&(*way * share))).collect()
    };
    for step in 1..=scheme.steps {
        let poses = problem.poses(&unknowns)?;
        let goals = interpolated(step);
        let here = match scheme.feedback {
            Feedback::Actual => poses.clone(),
            Feedback::Interpolated => interpolated(step - 1),
        };
        let apart: Vec<Twist<f64>> = here.iter().zip(&goals).map(|(pose, goal)| vee(&pose.to(goal))).collect();
        let jacobian = differences(problem, &unknowns, &poses)?;
        let change = damped_inverse(&jacobian, &stacked(problem, &apart), scheme.regularisation);
        unknowns += change.component_div(problem.weights());
    }
    Ok(Found { unknowns, iterations: scheme.steps, starts: 1 })
}

/// (H − I)ᵛ, eq. (9): the part of a small motion that is a screw.
fn vee(motion: &Pose<f64>) -> Twist<f64> {
    let r = &motion.rotation;
    let angular = Vector3::new(r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12) * 0.5;
    Twist { angular, linear: motion.position }
}

fn stacked(problem: &Problem, twists: &[Twist<f64>]) -> DVector<f64> {
    let rows = problem.targets.iter().zip(twists).flat_map(|(target, twist)| target.weighted(twist));
    DVector::from_iterator(problem.n_rows(), rows)
}

/// G of eq. (12), its columns in the scale of the unknowns' weights. A stop is moved in the frames whose word uses it.
fn differences(
    problem: &mut Problem,
    unknowns: &DVector<f64>,
    poses: &[Pose<f64>],
) -> Result<DMatrix<f64>, SynthesisError> {
    let mut jacobian = DMatrix::zeros(problem.n_rows(), unknowns.len());
    let mut unknowns = unknowns.clone();
    for column in 0..unknowns.len() {
        let here = unknowns[column];
        let scale = 2.0 * HALF_INTERVAL * problem.weights()[column];
        unknowns[column] = here + HALF_INTERVAL;
        let above = problem.poses_with(&unknowns, column)?;
        unknowns[column] = here - HALF_INTERVAL;
        let below = problem.poses_with(&unknowns, column)?;
        unknowns[column] = here;
        let moved = |index: usize| match (above[index], below[index]) {
            (Some(above), Some(below)) => vee(&poses[index].to(&above)) - vee(&poses[index].to(&below)),
            _ => Twist::zero(),
        };
        let twists: Vec<Twist<f64>> = (0..poses.len()).map(moved).collect();
        jacobian.set_column(column, &(stacked(problem, &twists) / scale));
    }
    Ok(jacobian)
}
