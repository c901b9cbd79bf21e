//! One stage of an arm as data: a rigid link, a parallel platform, a discrete joint or a servo joint.
//!
//! A stage carries its *top* frame on its *base* frame. What its actuators are set to is a [`Setting`] each; a stage
//! turns settings into the pose of its top, says how that pose changes with each setting, and what load each
//! actuator bears.

mod closed_form;
mod joint;
mod linear;
mod platform;

use crate::real::{Real, Vec3, real};
use crate::se::{Pose, Twist, Wrench};
pub use closed_form::ClosedForm;
pub use joint::{Axis, DiscreteJoint, JointKind, ServoJoint};
pub use platform::{Assembly, Leg, MAX_ITERATIONS, MIN_DETERMINANT, Platform, PlatformError};

/// States that one actuator can have at most: the digits 0..=3 of a word.
pub const MAX_STATES: usize = 4;

/// Actuators that one stage can have at most.
pub const MAX_LEGS: usize = 6;

/// One actuator in its present state: where it is anchored and what it is set to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting<T: Real> {
    /// Anchor of a leg on the base plate, in the base frame, m; unused by a joint.
    pub base: Vec3<T>,
    /// Anchor of a leg on the top plate, in the top frame, m; unused by a joint.
    pub top: Vec3<T>,
    /// Length of a leg, m; position of a prismatic joint, m; angle of a revolute joint, rad.
    pub value: T,
}

/// The settings of one stage, as many as it has actuators; a servo joint has one.
pub type Settings<T> = [Setting<T>; MAX_LEGS];

impl<T: Real> Setting<T> {
    /// The setting of a joint.
    pub fn of_joint(value: T) -> Self {
        Self { base: Vec3::zeros(), top: Vec3::zeros(), value }
    }
}

/// A number of one actuator that its stage depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// [`Setting::value`].
    Value,
    /// One coordinate of [`Setting::base`]: 0 is x, 1 is y, 2 is z.
    Base(u8),
    /// One coordinate of [`Setting::top`]: 0 is x, 1 is y, 2 is z.
    Top(u8),
}

/// One stage of an arm.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "there is no heap to put the six legs on")]
pub enum Stage<T: Real> {
    /// A rigid link: the pose of its top in its base.
    Link(Pose<T>),
    /// A platform with three discrete legs that moves in the xy-plane.
    Planar(Platform<T, 3>),
    /// A platform with six discrete legs.
    Spatial(Platform<T, 6>),
    /// A joint with a few stable positions.
    Discrete(DiscreteJoint<T>),
    /// A joint that is moved continuously.
    Servo(ServoJoint<T>),
}

impl<T: Real> Stage<T> {
    /// How many discrete actuators the stage has, and so digits of a word.
    pub fn n_actuators(&self) -> usize {
        match self {
            Self::Link(_) | Self::Servo(_) => 0,
            Self::Discrete(_) => 1,
            Self::Planar(_) => 3,
            Self::Spatial(_) => 6,
        }
    }

    /// Whether the top only ever moves in the xy-plane of the base.
    pub fn is_planar(&self) -> bool {
        match self {
            Self::Link(pose) => pose.is_planar(),
            Self::Planar(platform) => platform.home.is_planar(),
            Self::Spatial(_) => false,
            Self::Discrete(joint) => joint.axis.is_planar(),
            Self::Servo(joint) => joint.axis.is_planar(),
        }
    }

    /// Leg number `leg` of a platform.
    pub fn leg(&self, leg: usize) -> Option<&Leg<T>> {
        match self {
            Self::Planar(platform) => platform.legs.get(leg),
            Self::Spatial(platform) => platform.legs.get(leg),
            _ => None,
        }
    }

    /// Leg number `leg` of a platform, to change it.
    pub fn leg_mut(&mut self, leg: usize) -> Option<&mut Leg<T>> {
        match self {
            Self::Planar(platform) => platform.legs.get_mut(leg),
            Self::Spatial(platform) => platform.legs.get_mut(leg),
            _ => None,
        }
    }

    /// How many states actuator number `leg` has; 0 where there is no such actuator.
    pub fn n_states(&self, leg: usize) -> usize {
        let states = match self {
            Self::Discrete(joint) if leg == 0 => joint.states,
            _ => self.leg(leg).map_or(0, |leg| leg.states),
        };
        MAX_STATES.min(states.into())
    }

    /// Actuator number `leg` in state `digit`; `None` where there is no such actuator or state.
    pub fn setting(&self, leg: usize, digit: u8) -> Option<Setting<T>> {
        if usize::from(digit) >= self.n_states(leg) {
            return None;
        }
        match self {
            Self::Discrete(joint) => Some(Setting::of_joint(*joint.values.get(usize::from(digit))?)),
            _ => self.leg(leg)?.setting(digit),
        }
    }

    /// The pose of the top in the base.
    ///
    /// # Errors
    ///
    /// As [`Platform::assemble`]; a link and a joint always have a pose.
    pub fn pose(&self, settings: &Settings<T>) -> Result<Pose<T>, PlatformError> {
        Ok(match self {
            Self::Link(pose) => *pose,
            Self::Planar(platform) => platform.assemble(settings)?.pose,
            Self::Spatial(platform) => platform.assemble(settings)?.pose,
            Self::Discrete(joint) => joint.axis.pose(settings[0].value),
            Self::Servo(joint) => joint.axis.pose(settings[0].value),
        })
    }

    /// How the top moves, expressed in its own frame, per unit of one number of actuator `leg` (of a servo joint: leg 0).
    pub fn twist(&self, settings: &Settings<T>, pose: &Pose<T>, leg: usize, part: Part) -> Twist<T> {
        match (self, part) {
            (Self::Planar(platform), _) => platform.twist(settings, pose, leg, part),
            (Self::Spatial(platform), _) => platform.twist(settings, pose, leg, part),
            (Self::Discrete(joint), Part::Value) => joint.axis.twist(),
            (Self::Servo(joint), Part::Value) => joint.axis.twist(),
            _ => Twist::zero(),
        }
    }

    /// What each discrete actuator bears when `load` acts on the top, expressed in the top's frame, for the stage at rest.
    ///
    /// N along a leg or prismatic joint, positive in compression (it pushes the top away); N·m about a revolute
    /// joint, positive when the joint drives its angle up.
    pub fn loads(&self, settings: &Settings<T>, pose: &Pose<T>, load: &Wrench<T>) -> [T; MAX_LEGS] {
        match self {
            Self::Planar(platform) => platform.loads(settings, pose, load),
            Self::Spatial(platform) => platform.loads(settings, pose, load),
            Self::Discrete(joint) => {
                let mut loads = [T::zero(); MAX_LEGS];
                loads[0] = -load.power(&joint.axis.twist());
                loads
            }
            Self::Link(_) | Self::Servo(_) => [T::zero(); MAX_LEGS],
        }
    }
}

impl Stage<f64> {
    /// The same stage in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Stage<U> {
        match self {
            Self::Link(pose) => Stage::Link(pose.cast()),
            Self::Planar(platform) => Stage::Planar(platform.cast()),
            Self::Spatial(platform) => Stage::Spatial(platform.cast()),
            Self::Discrete(joint) => Stage::Discrete(DiscreteJoint {
                axis: joint.axis.cast(),
                values: joint.values.map(real),
                states: joint.states,
            }),
            Self::Servo(joint) => Stage::Servo(ServoJoint { axis: joint.axis.cast(), offset: real(joint.offset) }),
        }
    }
}

#[cfg(test)]
mod tests;
