//! From joints as an engineer gives them to links whose frames are turned so that a step along the tree is short.

use core::fmt;

use super::{BASE, Body, Joint, Link, Tree, Turn};
use crate::actuator::JointKind;
use crate::real::{Mat3, Real, Vec3, real};
use crate::trig;

/// Why joints do not make a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TreeError {
    /// The parent of a joint is itself, a later one, or none of these.
    Parent {
        /// The joint.
        joint: usize,
        /// What it is said to stand on.
        parent: usize,
    },
    /// An axis is no unit vector.
    Axis {
        /// The joint.
        joint: usize,
        /// Length of its axis.
        length: f32,
    },
    /// There are more joints than links can be numbered.
    TooMany {
        /// How many there are.
        joints: usize,
        /// How many there can be.
        max: usize,
    },
}

impl<T: Real, const N: usize> Tree<T, N> {
    /// A tree of `joints`, parents before children, in the field of free fall `gravity` (base frame, m/s²).
    ///
    /// The base has no mass until it is given one: set [`base`](Tree::base).
    ///
    /// # Errors
    ///
    /// [`TreeError::TooMany`]: N is above the number of links that can be numbered. [`TreeError::Parent`]: a joint does
    /// not come after its parent. [`TreeError::Axis`]: an axis is not a unit vector.
    pub fn new(joints: &[Joint<T>; N], gravity: Vec3<T>) -> Result<Self, TreeError> {
        if N > usize::from(BASE) {
            return Err(TreeError::TooMany { joints: N, max: usize::from(BASE) });
        }
        for (index, joint) in joints.iter().enumerate() {
            joint.check(index)?;
        }
        let turned: [Mat3<T>; N] = core::array::from_fn(|index| turned_frame(joints, index));
        let links = core::array::from_fn(|index| link(joints, &turned, index));
        Ok(Self { links, base: Body::none(), gravity })
    }

    /// The ten inertial parameters of a link in the frame that its joint was given with.
    pub fn parameters(&self, link: usize) -> [T; 10] {
        self.links.get(link).map_or([T::zero(); 10], |link| link.body.turned(&link.turned).parameters())
    }

    /// Replaces the ten inertial parameters of a link, expressed in the frame that its joint was given with.
    pub fn set_parameters(&mut self, link: usize, ten: &[T; 10]) {
        if let Some(link) = self.links.get_mut(link) {
            link.body = Body::from_parameters(ten).turned(&link.turned.transpose());
        }
    }
}

impl<T: Real> Joint<T> {
    /// Whether this joint, number `joint` of its tree, has a parent before it and an axis of length 1.
    ///
    /// # Errors
    ///
    /// The parent or the axis.
    pub fn check(&self, joint: usize) -> Result<(), TreeError> {
        if let Some(parent) = self.parent.filter(|parent| *parent >= joint) {
            return Err(TreeError::Parent { joint, parent });
        }
        let length = self.axis.direction.norm();
        let off = length - T::one();
        if (off * off).partial_cmp(&real(1e-10)) != Some(core::cmp::Ordering::Less) {
            return Err(TreeError::Axis { joint, length: crate::real::to_f32(length) });
        }
        Ok(())
    }
}

/// The turned frame of a link in its own: z along the axis, and x so that the turn to its first child is about x.
fn turned_frame<T: Real, const N: usize>(joints: &[Joint<T>; N], index: usize) -> Mat3<T> {
    let Some(joint) = joints.get(index) else { return Mat3::identity() };
    let axis = axis_frame(&joint.axis.direction);
    match joints.iter().find(|child| child.parent == Some(index)) {
        Some(child) => {
            let next = axis.tr_mul(&(child.placement.rotation * child.axis.direction));
            axis * about_z(quarter_behind(&next))
        }
        None => axis,
    }
}

/// Sine and cosine of the angle γ within ±π/2 about z for which `direction` is in the yz-plane of what is turned by γ.
fn quarter_behind<T: Real>(direction: &Vec3<T>) -> (T, T) {
    let (x, y) = (direction.x, -direction.y);
    let across = trig::sqrt(x * x + y * y);
    if across < T::default_epsilon() * real(8.0) {
        return (T::zero(), T::one());
    }
    let sign = if y < T::zero() { -T::one() } else { T::one() };
    (sign * x / across, sign * y / across)
}

fn about_z<T: Real>((s, c): (T, T)) -> Mat3<T> {
    let (one, zero) = (T::one(), T::zero());
    Mat3::new(c, -s, zero, s, c, zero, zero, zero, one)
}

/// A rotation that takes z to `axis`: of the axes y and x by quarter turns without rounding.
fn axis_frame<T: Real>(axis: &Vec3<T>) -> Mat3<T> {
    let (one, zero) = (T::one(), T::zero());
    if *axis == Vec3::z() {
        return Mat3::identity();
    }
    if *axis == Vec3::y() {
        return Mat3::new(one, zero, zero, zero, zero, one, zero, -one, zero);
    }
    if *axis == Vec3::x() {
        return Mat3::new(zero, zero, one, one, zero, zero, zero, one, zero);
    }
    let z = axis.normalize();
    let aside = if z.x.abs() < real(0.5) { Vec3::x() } else { Vec3::y() };
    let y = z.cross(&aside).normalize();
    Mat3::from_columns(&[y.cross(&z), y, z])
}

fn link<T: Real, const N: usize>(joints: &[Joint<T>; N], turned: &[Mat3<T>; N], index: usize) -> Link<T> {
    let identity = Mat3::identity();
    let own = turned.get(index).unwrap_or(&identity);
    let Some(joint) = joints.get(index) else {
        return Link {
            parent: BASE,
            kind: JointKind::Revolute,
            turn: Turn::None,
            origin: Vec3::zeros(),
            offset: T::zero(),
            body: Body::none(),
            turned: *own,
        };
    };
    let behind = joint.parent.and_then(|parent| turned.get(parent)).unwrap_or(&identity);
    let rotation = behind.tr_mul(&(joint.placement.rotation * own));
    let (turn, offset) = split(&rotation, joint.axis.kind);
    Link {
        parent: joint.parent.map_or(BASE, |parent| parent as u8),
        kind: joint.axis.kind,
        turn,
        origin: behind.tr_mul(&joint.placement.position),
        offset,
        body: Body::from(&joint.inertia).turned(&own.transpose()),
        turned: *own,
    }
}

/// A constant rotation as one about x and, for a revolute joint, an angle about its axis after it.
fn split<T: Real>(rotation: &Mat3<T>, kind: JointKind) -> (Turn<T>, T) {
    let tiny = T::default_epsilon() * real(8.0);
    let r = rotation;
    if r.m13.abs() > tiny {
        return (Turn::Full(*r), T::zero());
    }
    let (cosine, sine) = (r.m33, -r.m23);
    let turn = if (sine.abs() <= tiny) && cosine > T::zero() {
        Turn::None
    } else if cosine.abs() > tiny {
        Turn::AboutX { cosine, sine }
    } else if sine > T::zero() {
        Turn::Quarter
    } else {
        Turn::QuarterBack
    };
    // What is left after the turn about x is a turn about z.
    let angle = trig::atan2(cosine * r.m21 + sine * r.m31, r.m11);
    match kind {
        JointKind::Revolute => (turn, angle),
        JointKind::Prismatic if angle.abs() <= tiny => (turn, T::zero()),
        JointKind::Prismatic => (Turn::Full(*r), T::zero()),
    }
}

impl fmt::Display for TreeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Parent { joint, parent } => {
                write!(f, "joint {joint} has link {parent} as its parent, which does not come before it")
            }
            Self::Axis { joint, length } => write!(f, "the axis of joint {joint} has the length {length}, not 1"),
            Self::TooMany { joints, max } => write!(f, "{joints} joints, of which there can be {max}"),
        }
    }
}

impl core::error::Error for TreeError {}
