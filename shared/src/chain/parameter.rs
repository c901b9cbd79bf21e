//! The numbers of a chain's geometry: their names, their values, and how the tool moves with each.

use core::fmt;

use super::{Chain, Scratch};
use crate::actuator::{Leg, Part, Stage};
use crate::real::Real;
use crate::se::{Pose, Twist};

/// One number of the geometry of a chain.
///
/// A `component` of a pose is a coordinate of its rotation vector (0, 1, 2; rad) or of its position (3, 4, 5; m), see
/// [`Pose::coordinate`]; an `axis` is x (0), y (1) or z (2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Parameter {
    /// Where an actuator stops: the length of a leg, m, or the value of a discrete joint, m or rad.
    Stop {
        /// Index of the actuator.
        actuator: u8,
        /// The digit that drives it there.
        state: u8,
    },
    /// A coordinate of a leg's anchor on the base plate, m.
    BaseAnchor {
        /// Index of the actuator.
        actuator: u8,
        /// The coordinate.
        axis: u8,
    },
    /// A coordinate of a leg's anchor on the top plate, m.
    TopAnchor {
        /// Index of the actuator.
        actuator: u8,
        /// The coordinate.
        axis: u8,
    },
    /// The value of a servo joint when the servo is commanded to 0, rad or m.
    ServoOffset {
        /// Index of the servo.
        servo: u8,
    },
    /// A coordinate of the pose of a rigid link.
    Link {
        /// Index of the stage.
        stage: u8,
        /// The coordinate.
        component: u8,
    },
    /// A coordinate of the pose of the first stage in the base.
    Mount {
        /// The coordinate.
        component: u8,
    },
    /// A coordinate of the pose of the tool in the last stage.
    Tool {
        /// The coordinate.
        component: u8,
    },
}

/// The chain has no such number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoSuchParameter(pub Parameter);

impl<T: Real, const N: usize> Chain<T, N> {
    /// The value of a parameter, m or rad as [`Parameter`] says; `None` where the chain has no such number.
    pub fn get(&self, parameter: Parameter) -> Option<T> {
        match parameter {
            Parameter::Stop { actuator, state } => {
                let (stage, leg) = self.actuator(actuator.into())?;
                self.stages[stage].setting(leg, state).map(|setting| setting.value)
            }
            Parameter::BaseAnchor { actuator, axis } => self.leg(actuator)?.base.get(usize::from(axis)).copied(),
            Parameter::TopAnchor { actuator, axis } => self.leg(actuator)?.top.get(usize::from(axis)).copied(),
            Parameter::ServoOffset { servo } => match self.stages.get(self.servo(servo)?)? {
                Stage::Servo(joint) => Some(joint.offset),
                _ => None,
            },
            Parameter::Link { stage, component } => match self.stages.get(usize::from(stage))? {
                Stage::Link(pose) => pose.coordinate(component),
                _ => None,
            },
            Parameter::Mount { component } => self.mount.coordinate(component),
            Parameter::Tool { component } => self.tool.coordinate(component),
        }
    }

    /// Gives a parameter another value, m or rad as [`Parameter`] says.
    ///
    /// # Errors
    ///
    /// The chain has no such parameter.
    pub fn set(&mut self, parameter: Parameter, value: T) -> Result<(), NoSuchParameter> {
        let done = match parameter {
            Parameter::Link { component, .. } | Parameter::Mount { component } | Parameter::Tool { component } => {
                self.pose_mut(parameter).and_then(|pose| {
                    *pose = pose.with_coordinate(component, value)?;
                    Some(())
                })
            }
            _ => self.number_mut(parameter).map(|number| *number = value),
        };
        done.ok_or(NoSuchParameter(parameter))
    }

    /// How the tool moves, expressed in its own frame, per unit of a parameter, in the posture that `scratch` was left in
    /// by [`assemble`](Self::assemble): (T⁻¹·∂T/∂a)ᵛ.
    ///
    /// Zero for a number that has no part in this posture, such as a stop that the word does not use.
    pub fn derivative(&self, parameter: Parameter, scratch: &Scratch<T, N>) -> Twist<T> {
        self.moved_frame(parameter, scratch)
            .map_or(Twist::zero(), |(T_base_top, twist)| T_base_top.to(&scratch.pose_base_tool).adjoint_inverse(&twist))
    }

    /// The columns of the Jacobian: how the tool moves, expressed in its own frame, per unit of each servo's position.
    pub fn servo_jacobian(&self, scratch: &Scratch<T, N>) -> impl Iterator<Item = Twist<T>> {
        self.servo_stages().map(|stage| {
            let twist = self.stage_twist(scratch, stage, 0, Part::Value);
            scratch.tops[stage].to(&scratch.pose_base_tool).adjoint_inverse(&twist)
        })
    }

    /// The frame next after a parameter, in the base, and how it moves, expressed in itself.
    fn moved_frame(&self, parameter: Parameter, scratch: &Scratch<T, N>) -> Option<(Pose<T>, Twist<T>)> {
        let (actuator, part) = match parameter {
            Parameter::Stop { actuator, state } => {
                let index = usize::from(actuator);
                if index >= scratch.word.len() || scratch.word.digit(index) != state {
                    return None;
                }
                (actuator, Part::Value)
            }
            Parameter::BaseAnchor { actuator, axis } => (actuator, Part::Base(axis)),
            Parameter::TopAnchor { actuator, axis } => (actuator, Part::Top(axis)),
            Parameter::ServoOffset { servo } => {
                let stage = self.servo(servo)?;
                return Some((*scratch.tops.get(stage)?, self.stage_twist(scratch, stage, 0, Part::Value)));
            }
            Parameter::Link { stage, component } => {
                let stage = usize::from(stage);
                let Stage::Link(pose) = self.stages.get(stage)? else {
                    return None;
                };
                return Some((*scratch.tops.get(stage)?, pose.coordinate_twist(component)));
            }
            Parameter::Mount { component } => {
                return Some((self.mount, self.mount.coordinate_twist(component)));
            }
            Parameter::Tool { component } => {
                return Some((scratch.pose_base_tool, self.tool.coordinate_twist(component)));
            }
        };
        let (stage, leg) = self.actuator(actuator.into())?;
        Some((scratch.tops[stage], self.stage_twist(scratch, stage, leg, part)))
    }

    fn stage_twist(&self, scratch: &Scratch<T, N>, stage: usize, leg: usize, part: Part) -> Twist<T> {
        self.stages[stage].twist(&scratch.settings[stage], &scratch.stages[stage], leg, part)
    }

    fn servo(&self, servo: u8) -> Option<usize> {
        self.servo_stages().nth(servo.into())
    }

    fn leg(&self, actuator: u8) -> Option<&Leg<T>> {
        let (stage, leg) = self.actuator(actuator.into())?;
        self.stages[stage].leg(leg)
    }

    fn leg_mut(&mut self, actuator: u8) -> Option<&mut Leg<T>> {
        let (stage, leg) = self.actuator(actuator.into())?;
        self.stages[stage].leg_mut(leg)
    }

    fn number_mut(&mut self, parameter: Parameter) -> Option<&mut T> {
        match parameter {
            Parameter::Stop { actuator, state } => self.stop_mut(actuator, state),
            Parameter::BaseAnchor { actuator, axis } => self.leg_mut(actuator)?.base.get_mut(usize::from(axis)),
            Parameter::TopAnchor { actuator, axis } => self.leg_mut(actuator)?.top.get_mut(usize::from(axis)),
            Parameter::ServoOffset { servo } => {
                let stage = self.servo(servo)?;
                match &mut self.stages[stage] {
                    Stage::Servo(joint) => Some(&mut joint.offset),
                    _ => None,
                }
            }
            Parameter::Link { .. } | Parameter::Mount { .. } | Parameter::Tool { .. } => None,
        }
    }

    fn stop_mut(&mut self, actuator: u8, state: u8) -> Option<&mut T> {
        let (stage, leg) = self.actuator(actuator.into())?;
        let stage = &mut self.stages[stage];
        if usize::from(state) >= stage.n_states(leg) {
            return None;
        }
        match stage {
            Stage::Discrete(joint) => joint.values.get_mut(usize::from(state)),
            platform => platform.leg_mut(leg)?.length_m.get_mut(usize::from(state)),
        }
    }

    fn pose_mut(&mut self, parameter: Parameter) -> Option<&mut Pose<T>> {
        match parameter {
            Parameter::Link { stage, .. } => match self.stages.get_mut(usize::from(stage))? {
                Stage::Link(pose) => Some(pose),
                _ => None,
            },
            Parameter::Mount { .. } => Some(&mut self.mount),
            Parameter::Tool { .. } => Some(&mut self.tool),
            _ => None,
        }
    }
}

impl fmt::Display for NoSuchParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the arm has no {:?}", self.0)
    }
}

impl core::error::Error for NoSuchParameter {}
