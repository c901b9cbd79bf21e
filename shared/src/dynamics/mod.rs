//! Dynamics of a [`Tree`]: the torques of a motion, the motion of torques, and the matrices between them.
//!
//! The equation of motion in state-space form, with q in rad or m and τ in N·m or N:
//!
//! τ = M(q) q̈ + V(q, q̇) + G(q) + Jᵀ F
//!
//! | quantity                                   | function                          | reads            |
//! |--------------------------------------------|-----------------------------------|------------------|
//! | τ of a motion, Newton–Euler                | [`inverse_dynamics`]              | q, q̇, q̈          |
//! | V, centrifugal and Coriolis                | [`velocity_torque`]               | q, q̇             |
//! | C with V = C q̇ and Ṁ = C + Cᵀ              | [`coriolis_matrix`]               | frames, q̇        |
//! | M, composite bodies                        | [`mass_matrix`]                   | q                |
//! | G                                          | [`gravity`]                       | frames           |
//! | all of the equation at once                | [`state_space`]                   | q, q̇             |
//! | q̈ of torques                               | [`forward_dynamics`]              | q, q̇, τ          |
//! | the same by articulated bodies             | [`articulated_dynamics`]          | q, q̇, τ          |
//! | centre of mass, its Jacobian               | [`center_of_mass`], [`com_jacobian`] | frames        |
//! | kinetic and potential energy, momentum     | [`kinetic_energy`], [`potential_energy`], [`momentum`] | frames, q̇ |
//! | Y with τ = Y φ, φ the inertial parameters  | [`regressor`]                     | frames, q, q̇, q̈  |
//! | the same with a floating base              | [`floating`]                      |                  |
//!
//! "Frames" are those that [`Tree::place`] left for the posture: one call serves all functions that read them. F is what
//! the tool exerts on its environment, and Jᵀ F is [`statics`](crate::tree::jacobian::statics). Friction and the
//! motors' own inertia are not in these equations.
//!
//! # Example
//!
//! ```
//! use darm_core::dynamics::inverse_dynamics;
//! use darm_core::tree::{Inertia, Joint, Tree};
//! use darm_core::{real::{Mat3, Vec3}, se::Pose};
//! // A pendulum: 2 kg at 0.5 m, turning about y; x points down the arm at q = 0 is level.
//! let bob = Inertia { mass: 2.0, com: Vec3::new(0.5, 0.0, 0.0), about_com: Mat3::zeros() };
//! let joint = Joint::revolute(None, Vec3::y(), Pose::identity(), bob);
//! let tree = Tree::new(&[joint], Vec3::new(0.0, 0.0, -9.81)).unwrap();
//! // Held level: −m g l (about y, a positive torque turns x towards −z); accelerated: m l² more per rad/s².
//! let [held] = inverse_dynamics(&tree, &[0.0], &[0.0], &[0.0], None);
//! let [moved] = inverse_dynamics(&tree, &[0.0], &[0.0], &[1.0], None);
//! assert!((held + 2.0 * 9.81 * 0.5_f64).abs() < 1e-12 && (moved - held - 0.5).abs() < 1e-12);
//! ```
//!
//! Source: J. J. Craig, Introduction to Robotics: Mechanics and Control, chapter 6 (Newton–Euler, state-space form);
//! R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5 and 6 (composite bodies, trees).
#![allow(non_snake_case)]

mod articulated;
mod com;
mod coriolis;
mod energy;
pub mod floating;
mod mass;
mod newton_euler;
mod regressor;

use nalgebra::SMatrix;

use crate::real::{Real, Vec3};
use crate::tree::{Frames, Tree};

pub use articulated::articulated_dynamics;
pub use com::{center_of_mass, com_jacobian, gravity};
pub use coriolis::coriolis_matrix;
pub use energy::{Momentum, kinetic_energy, momentum, potential_energy};
pub use mass::{mass_matrix, mass_matrix_into, solve};
pub use newton_euler::{inverse_dynamics, velocity_torque};
pub use regressor::{Regressor, regressor, torque_of};

/// The equation of motion at one state: τ = M q̈ + V + G.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateSpace<T: Real, const N: usize> {
    /// M(q), N × N, symmetric and positive definite when every joint moves mass.
    pub mass: SMatrix<T, N, N>,
    /// V(q, q̇): centrifugal and Coriolis torques, N·m or N.
    pub velocity: [T; N],
    /// G(q): what holds the arm against gravity, N·m or N.
    pub gravity: [T; N],
}

/// M, V and G at positions `q` and velocities `qd`.
pub fn state_space<T: Real, const N: usize>(tree: &Tree<T, N>, q: &[T; N], qd: &[T; N]) -> StateSpace<T, N> {
    let mut frames = Frames::default();
    tree.place(q, &mut frames);
    StateSpace { mass: mass_matrix(tree, q), velocity: velocity_torque(tree, q, qd), gravity: gravity(tree, &frames) }
}

/// q̈ = M⁻¹ (τ − V − G): the accelerations that `torque` causes at positions `q` and velocities `qd`.
///
/// A load F on the tool from the environment adds Jᵀ F to `torque`. `None` when the mass matrix is singular: a joint that
/// moves no mass.
pub fn forward_dynamics<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    q: &[T; N],
    qd: &[T; N],
    torque: &[T; N],
) -> Option<[T; N]> {
    let mut rest = *torque;
    for (rest, bias) in rest.iter_mut().zip(inverse_dynamics(tree, q, qd, &[T::zero(); N], None)) {
        *rest -= bias;
    }
    solve(&mass_matrix(tree, q), &rest)
}

/// Mass of a complete tree (kg) and mass times position of its centre of mass (kg·m), expressed in the base.
pub(crate) struct MassMoment<T: Real> {
    pub(crate) mass: T,
    pub(crate) moment: Vec3<T>,
}
