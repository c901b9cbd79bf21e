//! Dynamics of a tree on a floating base: a humanoid, or a person who rises from a chair.
//!
//! The base adds six coordinates before the joints: its twist (ω, v), expressed in its own frame at its origin, and the load
//! (moment, force) on it in the same frame. They stay apart from the joints' numbers: M is held as four blocks.
//! The mass of the base body is [`Tree::base`].

use nalgebra::SMatrix;

use super::articulated::on_floating_base;
use super::com::{carried, columns};
use super::mass::{composites, mass_of_joints, momenta};
use super::newton_euler::{Motion, inward, outward_loads};
use super::{MassMoment, Vec3};
use crate::real::{Mat6, Real};
use crate::se::{Pose, Twist, Wrench};
use crate::tree::{Frames, Tree};

/// Where a floating base is and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseMotion<T: Real> {
    /// Pose of the base in the world.
    pub pose: Pose<T>,
    /// Its twist, expressed in its own frame.
    pub twist: Twist<T>,
    /// The rate of the six numbers of the twist.
    pub twist_rate: Twist<T>,
}

/// M of base and joints, in blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloatingMass<T: Real, const N: usize> {
    /// The base alone: spatial inertia of the complete tree, 6 × 6, angular part first.
    pub base: Mat6<T>,
    /// Momentum of the complete tree, expressed in the base's frame, per unit of each joint: 6 × N.
    pub coupling: SMatrix<T, 6, N>,
    /// The joints alone, N × N.
    pub joints: SMatrix<T, N, N>,
}

/// The Jacobian of the centre of mass, expressed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloatingCom<T: Real, const N: usize> {
    /// Centre of mass of base and links, m.
    pub position: Vec3<T>,
    /// Per unit of the base's twist, 3 × 6.
    pub base: SMatrix<T, 3, 6>,
    /// Per unit of each joint, 3 × N.
    pub joints: SMatrix<T, 3, N>,
}

/// The load on the base (expressed in its frame) and the joint torques (N·m or N) of a motion.
///
/// `loads`: what the environment exerts on each link, as in [`inverse_dynamics`](super::inverse_dynamics). When the
/// base is free the load on it is zero: what is left is the error of the motion.
pub fn inverse_dynamics<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    base: &BaseMotion<T>,
    [q, qd, qdd]: [&[T; N]; 3],
    loads: Option<&[Wrench<T>; N]>,
) -> (Wrench<T>, [T; N]) {
    let turns = tree.turns(q);
    let (w, v) = (&base.twist.angular, &base.twist.linear);
    let fall = base.pose.rotation.tr_mul(&tree.gravity);
    let moving = Motion::new(*w, base.twist_rate.angular, base.twist_rate.linear + w.cross(v) - fall);
    let of_motion = outward_loads::<T, N, false>(tree, &moving, [q, qd, qdd], &turns);
    let (torques, carried) = inward(tree, of_motion, loads, q, &turns);
    (carried + moving.load(&tree.base), torques)
}

/// The motion of torques: the rate of the base's twist, expressed in its frame, and q̈.
///
/// Given are the pose of the base in the world and its twist expressed in its own frame; the joints' positions, velocities and
/// torques (N·m or N). `on_base` is the load on the base, expressed
/// in its frame, and `loads` what the environment exerts on each link, as in
/// [`inverse_dynamics`](super::inverse_dynamics). Articulated bodies (Featherstone, table 9.4). `None` when a joint moves
/// no mass, or the complete tree has none.
pub fn forward_dynamics<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    (pose, twist): (&Pose<T>, &Twist<T>),
    state: [&[T; N]; 3],
    on_base: &Wrench<T>,
    loads: Option<&[Wrench<T>; N]>,
) -> Option<(Twist<T>, [T; N])> {
    let gravity = pose.rotation.tr_mul(&tree.gravity);
    on_floating_base(tree, (twist, &gravity), state, on_base, loads)
}

/// Gravity alone: the load on the base (expressed in its frame) and the joint torques that hold the tree still.
pub fn gravity<T: Real, const N: usize>(tree: &Tree<T, N>, frames: &Frames<T, N>) -> (Wrench<T>, [T; N]) {
    let (masses, moments, links) = carried(tree, frames);
    let total = with_base(tree, frames, &links);
    let base = frames.base();
    let arm = total.moment - base.origin * total.mass;
    let load = Wrench {
        moment: base.turn_back(&-arm.cross(&tree.gravity)),
        force: base.turn_back(&(-tree.gravity * total.mass)),
    };
    (load, columns(tree, frames, &masses, &moments).map(|column| -column.dot(&tree.gravity)))
}

/// M of base and joints at the joints' positions `q`, to which `frames` belong.
pub fn mass<T: Real, const N: usize>(tree: &Tree<T, N>, frames: &Frames<T, N>, q: &[T; N]) -> FloatingMass<T, N> {
    let turns = tree.turns(q);
    let (bodies, links) = composites(tree, q, &turns);
    let base = frames.base();
    let in_base = |about: &Vec3<T>, along: &Vec3<T>| {
        let (n, f) = (base.turn_back(&(about - base.origin.cross(along))), base.turn_back(along));
        [n.x, n.y, n.z, f.x, f.y, f.z]
    };
    let total = links.joined(&tree.base).in_base(base);
    let mut block = Mat6::zeros();
    for (column, axis) in
        block.data.0.iter_mut().zip([base.x, base.y, base.z, base.x, base.y, base.z].iter().enumerate())
    {
        let (number, axis) = axis;
        let (angular, linear) = if number < 3 { (*axis, base.origin.cross(axis)) } else { (Vec3::zeros(), *axis) };
        let (about, along) = total.momentum(&angular, &linear);
        *column = in_base(&about, &along);
    }
    let mut coupling = SMatrix::zeros();
    for (column, (about, along)) in coupling.data.0.iter_mut().zip(momenta(tree, frames, &bodies)) {
        *column = in_base(&about, &along);
    }
    let mut joints = SMatrix::zeros();
    mass_of_joints(tree, q, &turns, &mut joints);
    FloatingMass { base: block, coupling, joints }
}

/// Centre of mass and its Jacobian in the posture of `frames`; zeros when there is no mass.
pub fn com_jacobian<T: Real, const N: usize>(tree: &Tree<T, N>, frames: &Frames<T, N>) -> FloatingCom<T, N> {
    let (masses, moments, links) = carried(tree, frames);
    let total = with_base(tree, frames, &links);
    let mut com = FloatingCom { position: Vec3::zeros(), base: SMatrix::zeros(), joints: SMatrix::zeros() };
    if total.mass <= T::zero() {
        return com;
    }
    let base = frames.base();
    com.position = total.moment / total.mass;
    let arm = com.position - base.origin;
    let axes = [base.x, base.y, base.z];
    let moved = axes.iter().map(|axis| axis.cross(&arm)).chain(axes);
    for (column, moved) in com.base.data.0.iter_mut().zip(moved) {
        *column = [moved.x, moved.y, moved.z];
    }
    for (column, moved) in com.joints.data.0.iter_mut().zip(&columns(tree, frames, &masses, &moments)) {
        let moved = moved / total.mass;
        *column = [moved.x, moved.y, moved.z];
    }
    com
}

fn with_base<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    frames: &Frames<T, N>,
    links: &MassMoment<T>,
) -> MassMoment<T> {
    let base = frames.base();
    MassMoment {
        mass: links.mass + tree.base.mass,
        moment: links.moment + base.origin * tree.base.mass + base.turn(&tree.base.moment),
    }
}
