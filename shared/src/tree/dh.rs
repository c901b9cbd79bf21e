//! Serial arms by the parameters of Denavit and Hartenberg, in both notations.
//!
//! | notation | step from link i−1 to link i                | link frame i is at        | source                       |
//! |----------|---------------------------------------------|---------------------------|------------------------------|
//! | standard | Rot_z(θ)·Trans_z(d)·Trans_x(a)·Rot_x(α)     | the far end of the link   | Denavit, Hartenberg 1955     |
//! | modified | Rot_x(α)·Trans_x(a)·Rot_z(θ)·Trans_z(d)     | the near end, at its joint | Craig, Introduction to Robotics, chapter 3 |
//!
//! θ of a revolute and d of a prismatic joint are the row's value plus the joint's position. In modified notation α and a
//! are those of the joint before (Craig's α_{i−1}, a_{i−1}). Angles in rad, lengths in m.

use super::{Inertia, Joint, Tree, TreeError};
use crate::actuator::JointKind;
use crate::real::{Mat3, Real, Vec3};
use crate::se::Pose;
use crate::trig;

/// One row of a table of parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row<T: Real> {
    /// What the joint does along z.
    pub kind: JointKind,
    /// θ, or its value at position zero, rad.
    pub theta_rad: T,
    /// d, or its value at position zero, m.
    pub d_m: T,
    /// a, m.
    pub a_m: T,
    /// α, rad.
    pub alpha_rad: T,
    /// Mass distribution in the frame of the row's link.
    pub inertia: Inertia<T>,
}

/// A serial arm in the standard notation, and the frame of its last row in its last link.
///
/// # Errors
///
/// [`TreeError::TooMany`]: N is above the number of links that can be numbered.
pub fn standard<T: Real, const N: usize>(
    rows: &[Row<T>; N],
    gravity: Vec3<T>,
) -> Result<(Tree<T, N>, Pose<T>), TreeError> {
    let far_end = rows.last().map_or(Pose::identity(), Row::far_end);
    Ok((Tree::new(&collected(standard_joints(rows)), gravity)?, far_end))
}

/// A serial arm in the modified notation; the frame of its last row is that of its last link.
///
/// # Errors
///
/// [`TreeError::TooMany`]: N is above the number of links that can be numbered.
pub fn modified<T: Real, const N: usize>(rows: &[Row<T>; N], gravity: Vec3<T>) -> Result<Tree<T, N>, TreeError> {
    Tree::new(&collected(modified_joints(rows)), gravity)
}

/// The joints of a table in the standard notation.
///
/// Their link frames are at the joints, and the inertias of the rows are brought there; the frame of a row is its
/// [far end](Row::far_end).
pub fn standard_joints<T: Real>(rows: &[Row<T>]) -> impl Iterator<Item = Joint<T>> {
    rows.iter().enumerate().scan(Pose::identity(), |far_end, (index, row)| {
        let placement = *far_end * row.along_z();
        *far_end = row.far_end();
        Some(row.joint(index, placement, row.inertia.placed(&far_end.rotation, &far_end.position)))
    })
}

/// The joints of a table in the modified notation, whose link frames are those of the rows.
pub fn modified_joints<T: Real>(rows: &[Row<T>]) -> impl Iterator<Item = Joint<T>> {
    rows.iter().enumerate().map(|(index, row)| row.joint(index, row.far_end() * row.along_z(), row.inertia))
}

fn collected<T: Real, const N: usize>(mut joints: impl Iterator<Item = Joint<T>>) -> [Joint<T>; N] {
    let none = || Joint::revolute(None, Vec3::z(), Pose::identity(), Inertia::none());
    core::array::from_fn(|_| joints.next().unwrap_or_else(none))
}

impl<T: Real> Row<T> {
    fn joint(&self, index: usize, placement: Pose<T>, inertia: Inertia<T>) -> Joint<T> {
        let parent = index.checked_sub(1);
        match self.kind {
            JointKind::Revolute => Joint::revolute(parent, Vec3::z(), placement, inertia),
            JointKind::Prismatic => Joint::prismatic(parent, Vec3::z(), placement, inertia),
        }
    }

    /// Rot_z(θ)·Trans_z(d) at position zero.
    fn along_z(&self) -> Pose<T> {
        let (one, zero) = (T::one(), T::zero());
        let (s, c) = trig::sin_cos(self.theta_rad);
        let rotation = Mat3::new(c, -s, zero, s, c, zero, zero, zero, one);
        Pose { rotation, position: Vec3::new(zero, zero, self.d_m) }
    }

    /// Trans_x(a)·Rot_x(α): in the standard notation the row's frame in the link that is at its joint.
    pub fn far_end(&self) -> Pose<T> {
        let (one, zero) = (T::one(), T::zero());
        let (s, c) = trig::sin_cos(self.alpha_rad);
        let rotation = Mat3::new(one, zero, zero, zero, c, -s, zero, s, c);
        Pose { rotation, position: Vec3::new(self.a_m, zero, zero) }
    }
}
