//! A single joint: revolute or prismatic, discrete or driven by a servo.

use super::MAX_STATES;
use crate::real::{Real, Vec3, cast};
use crate::se::{Pose, Twist, rotation_about};

/// What a joint does along its axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Turns about it; the value is an angle in rad.
    Revolute,
    /// Slides along it; the value is a distance in m.
    Prismatic,
}

/// The axis of a joint, through the origin of its base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis<T: Real> {
    /// Whether the joint turns or slides.
    pub kind: JointKind,
    /// A unit vector in the base frame, and as well in the top frame.
    pub direction: Vec3<T>,
}

/// A joint with a few stable positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiscreteJoint<T: Real> {
    /// What it moves along.
    pub axis: Axis<T>,
    /// The value in each state, rad or m.
    pub values: [T; MAX_STATES],
    /// How many of the values count.
    pub states: u8,
}

/// A joint that is moved continuously.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoJoint<T: Real> {
    /// What it moves along.
    pub axis: Axis<T>,
    /// The value of the joint when the servo is commanded to 0, rad or m.
    pub offset: T,
}

impl<T: Real> Axis<T> {
    /// The pose of the top in the base at `value`.
    pub fn pose(&self, value: T) -> Pose<T> {
        match self.kind {
            JointKind::Revolute => Pose { rotation: rotation_about(&self.direction, value), position: Vec3::zeros() },
            JointKind::Prismatic => Pose::at(self.direction * value),
        }
    }

    /// How the top moves per unit of the value: the same expressed in the base and in the top.
    pub fn twist(&self) -> Twist<T> {
        match self.kind {
            JointKind::Revolute => Twist { angular: self.direction, linear: Vec3::zeros() },
            JointKind::Prismatic => Twist { angular: Vec3::zeros(), linear: self.direction },
        }
    }

    pub(super) fn is_planar(&self) -> bool {
        let (x, y, z) = (self.direction.x, self.direction.y, self.direction.z);
        match self.kind {
            JointKind::Revolute => x == T::zero() && y == T::zero(),
            JointKind::Prismatic => z == T::zero(),
        }
    }
}

impl Axis<f64> {
    pub(super) fn cast<U: Real>(&self) -> Axis<U> {
        Axis { kind: self.kind, direction: cast(&self.direction) }
    }
}
