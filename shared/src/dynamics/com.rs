//! Centre of mass, its Jacobian, and gravity, which is the load of free fall on that Jacobian.

use nalgebra::SMatrix;

use super::{MassMoment, Vec3};
use crate::actuator::JointKind;
use crate::real::Real;
use crate::tree::{Frames, Tree, add_scaled, cross, dot};

/// Mass and mass moment of every link with all that it carries, expressed in the base, and of the complete tree.
#[inline(always)]
pub(super) fn carried<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    frames: &Frames<T, N>,
) -> ([T; N], [Vec3<T>; N], MassMoment<T>) {
    let mut masses = [T::zero(); N];
    let mut moments = [Vec3::zeros(); N];
    for (((mass, moment), link), frame) in masses.iter_mut().zip(&mut moments).zip(&tree.links).zip(frames.links()) {
        *mass = link.body.mass;
        *moment = add_scaled(&frame.turn(&link.body.moment), &frame.origin, link.body.mass);
    }
    let mut total = MassMoment { mass: T::zero(), moment: Vec3::zeros() };
    for (index, link) in tree.links.iter().enumerate().rev() {
        if let (Some(mass), Some(moment)) = (masses.get(index).copied(), moments.get(index).copied()) {
            let parent = usize::from(link.parent);
            *masses.get_mut(parent).unwrap_or(&mut total.mass) += mass;
            *moments.get_mut(parent).unwrap_or(&mut total.moment) += moment;
        }
    }
    (masses, moments, total)
}

/// Mass (kg) and centre of mass of all links (m, expressed in the base frame); the centre is the origin when there is no mass.
///
/// The base of a fixed tree does not count.
pub fn center_of_mass<T: Real, const N: usize>(tree: &Tree<T, N>, frames: &Frames<T, N>) -> (T, Vec3<T>) {
    let (mut mass, mut moment) = (T::zero(), Vec3::zeros());
    for (link, frame) in tree.links.iter().zip(frames.links()) {
        mass += link.body.mass;
        moment += add_scaled(&frame.turn(&link.body.moment), &frame.origin, link.body.mass);
    }
    if mass > T::zero() { (mass, moment / mass) } else { (mass, Vec3::zeros()) }
}

/// Centre of mass (m) and ∂c/∂q, 3 × N, expressed in the base frame; zeros when there is no mass.
///
/// Column i is ẑᵢ × (cᵢ − pᵢ)·mᵢ/m for a revolute joint and ẑᵢ·mᵢ/m for a prismatic one, where mᵢ and cᵢ are those of all
/// that joint i carries.
pub fn com_jacobian<T: Real, const N: usize>(tree: &Tree<T, N>, frames: &Frames<T, N>) -> (Vec3<T>, SMatrix<T, 3, N>) {
    let (masses, moments, total) = carried(tree, frames);
    let mut jacobian = SMatrix::zeros();
    if total.mass <= T::zero() {
        return (Vec3::zeros(), jacobian);
    }
    let per_mass = T::one() / total.mass;
    let columns = columns(tree, frames, &masses, &moments);
    for (column, moved) in jacobian.data.0.iter_mut().zip(&columns) {
        *column = [moved.x * per_mass, moved.y * per_mass, moved.z * per_mass];
    }
    (total.moment * per_mass, jacobian)
}

/// G(q), N·m or N: the joint torques that hold the arm still against gravity.
///
/// −Jᵀ m g with the Jacobian of the centre of mass.
pub fn gravity<T: Real, const N: usize>(tree: &Tree<T, N>, frames: &Frames<T, N>) -> [T; N] {
    let (masses, moments, _) = carried(tree, frames);
    columns(tree, frames, &masses, &moments).map(|column| -dot(&column, &tree.gravity))
}

/// ∂(m c)/∂q: how the mass moment of the tree changes with each joint.
#[inline(always)]
pub(super) fn columns<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    frames: &Frames<T, N>,
    masses: &[T; N],
    moments: &[Vec3<T>; N],
) -> [Vec3<T>; N] {
    let mut columns = [Vec3::zeros(); N];
    for ((((column, link), frame), mass), moment) in
        columns.iter_mut().zip(&tree.links).zip(frames.links()).zip(masses).zip(moments)
    {
        *column = match link.kind {
            JointKind::Revolute => cross(&frame.z, &add_scaled(moment, &frame.origin, -*mass)),
            JointKind::Prismatic => frame.z * *mass,
        };
    }
    columns
}
