//! Inverse kinematics: joint positions that bring a tool to a pose, by steps that linearise the arm.
//!
//! The lecture's iteration: with the error ε_X = X̂ − X at the approximation Θ̂, ε_X ≈ J ε_Θ; solve for ε_Θ, take it from Θ̂,
//! and repeat until ε_X is small. The ways to solve differ where J is not square or nearly singular:
//!
//! | step                  | formula                             | when                                                 |
//! |-----------------------|-------------------------------------|------------------------------------------------------|
//! | [`inverse_step`]      | J⁻¹ ε                               | J is square and regular                              |
//! | [`pseudo_inverse_step`] | J⁺ ε                              | any J; large steps near a singularity                |
//! | [`transpose_step`]    | α Jᵀ ε                              | any J; converges slowly, costs least                 |
//! | [`damped_step`]       | Jᵀ (J Jᵀ + μ 1)⁻¹ ε                 | any J; steps stay bounded at a singularity           |
//!
//! [`iterate`] takes a fixed number of damped steps within the limits of the joints: on the chip, in bounded time.
//! [`solve`] is what a user should take: it keeps the limits, starts again elsewhere when a start leads nowhere, checks its
//! answer by forward kinematics, and says whether the pose was reached.
//!
//! The error is given along the axes of the base: angular part first, the rotation vector of R_target·Rᵀ; then
//! p_target − p. Its angular part is held equal to the linear one by a length ℓ, as in [`Pose::distance`].
//! A tool that does not come closer although its target is within reach has met a joint's limit or a singularity.
//!
//! # Example
//!
//! ```
//! use darm_core::ik::{self, Arm, Options, Status};
//! use darm_core::tree::{Inertia, Joint, Tree};
//! use darm_core::{real::Vec3, se::Pose};
//! // The lecture's planar robot, whose tool is to stand at (0.5, 0.3) m, turned in whatever way.
//! let upper = Joint::revolute(None, Vec3::z(), Pose::identity(), Inertia::none());
//! let lower = Joint::revolute(Some(0), Vec3::z(), Pose::at(Vec3::new(0.5, 0.0, 0.0)), Inertia::none());
//! let tree = Tree::new(&[upper, lower], Vec3::zeros()).unwrap();
//! let tool = tree.frame(1, &Pose::at(Vec3::new(0.3, 0.0, 0.0)));
//! let arm = Arm { tree: &tree, tool: &tool, limits: &[[-3.0, 3.0]; 2] };
//! let target = Pose::at(Vec3::new(0.5, 0.3, 0.0));
//! let found = ik::solve(&arm, &target, &[0.1, 0.2], &Options { orientation_rad: f64::INFINITY, ..Options::default() });
//! assert_eq!(found.status, Status::Reached);
//! assert!((tree.pose(&tool, &found.q).position - target.position).norm() < 1e-5);
//! ```
//!
//! Source: the lecture; S. R. Buss, Introduction to Inverse Kinematics with Jacobian Transpose, Pseudoinverse and Damped
//! Least Squares methods, 2004 (α, damping); S. K. Chan, P. D. Lawrence, General inverse kinematics with the error damped
//! pseudoinverse, ICRA 1988 (μ in proportion to ε²).
#![allow(non_snake_case)]

mod search;
mod step;

use nalgebra::SMatrix;

use crate::real::{Real, Vec3};
use crate::se::{Pose, Twist, rotation_log};
use crate::tree::{Frames, LinkFrame, Tree};

pub use search::{Options, Solution, Status, solve, solve_observed};
pub use step::{damped_step, inverse_step, pseudo_inverse_step, transpose_step};

/// What is moved: a tool on a tree whose joints stay within limits.
#[derive(Clone, Copy, Debug)]
pub struct Arm<'a, T: Real, const N: usize> {
    /// Joints and links on a fixed base.
    pub tree: &'a Tree<T, N>,
    /// The frame that is brought to the target.
    pub tool: &'a LinkFrame<T>,
    /// Lowest and highest position of each joint, rad or m; infinite where there is no limit.
    pub limits: &'a [[T; 2]; N],
}

impl<T: Real, const N: usize> Arm<'_, T, N> {
    /// The positions with each joint brought within its limits.
    #[inline]
    pub fn within_limits(&self, q: &[T; N]) -> [T; N] {
        let mut inside = *q;
        for (q, [low, high]) in inside.iter_mut().zip(self.limits) {
            if *q < *low {
                *q = *low;
            }
            if *q > *high {
                *q = *high;
            }
        }
        inside
    }

    /// Whether `position` (m, base) is farther by `tolerance_m` from the first joint than all links together are long.
    pub fn is_beyond_reach(&self, position: &Vec3<T>, tolerance_m: T) -> bool {
        let (first, length) = self.tree.reach(self.tool, self.limits);
        (position - first).norm() > length + tolerance_m
    }

    /// ε (rad, m) and ⁰J, 6 × N, at the positions `q`.
    #[inline]
    pub fn linearised(&self, target: &Pose<T>, q: &[T; N], frames: &mut Frames<T, N>) -> (Twist<T>, SMatrix<T, 6, N>) {
        self.tree.place(q, frames);
        (error(target, &frames.pose(self.tool)), self.tree.jacobian_base(self.tool, frames))
    }
}

/// ε: the rotation vector (rad) and the way (m) from `pose` to `target`, expressed along the axes of the base at the
/// tool.
#[inline]
pub fn error<T: Real>(target: &Pose<T>, pose: &Pose<T>) -> Twist<T> {
    Twist {
        angular: rotation_log(&(target.rotation * pose.rotation.transpose())),
        linear: target.position - pose.position,
    }
}

/// Multiplies the angular and the linear part of the error, and those rows of the Jacobian, by these `weights`: (ℓ, 1) holds
/// one radian equal to ℓ metres, and zero leaves a part out.
#[inline(always)]
pub fn scale<T: Real, const N: usize>(
    error: &mut Twist<T>,
    jacobian: &mut SMatrix<T, 6, N>,
    [angular, linear]: [T; 2],
) {
    error.angular *= angular;
    error.linear *= linear;
    for [a, b, c, x, y, z] in &mut jacobian.data.0 {
        [*a, *b, *c] = [*a * angular, *b * angular, *c * angular];
        [*x, *y, *z] = [*x * linear, *y * linear, *z * linear];
    }
}

/// Takes `steps` damped steps from `q` towards `target`, each joint kept within its limits, and returns the error that is left
/// (rad, m): bounded time, for the chip.
///
/// `length_scale_m`: ℓ; `damping`: μ, m², above zero. A small μ converges fast and steps far near a singularity; 1e-3 m² suits
/// an arm of half a metre.
pub fn iterate<T: Real, const N: usize>(
    arm: &Arm<T, N>,
    target: &Pose<T>,
    q: &mut [T; N],
    steps: usize,
    (length_scale_m, damping): (T, T),
) -> Twist<T> {
    let mut frames = Frames::default();
    for _ in 0..steps {
        let (mut error, mut jacobian) = arm.linearised(target, q, &mut frames);
        scale(&mut error, &mut jacobian, [length_scale_m, T::one()]);
        for (q, step) in q.iter_mut().zip(damped_step(&jacobian, &error, damping)) {
            *q += step;
        }
        *q = arm.within_limits(q);
    }
    error(target, &arm.tree.pose(arm.tool, q))
}

#[cfg(test)]
mod tests;
