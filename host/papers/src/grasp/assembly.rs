//! From a robot, its shapes and four fingertips to a hand.

use std::path::{Path, PathBuf};

use darm_core::actuator::JointKind;

use super::collision::Body;
use super::cross_check::CrossCheck;
use super::fault::HandFault;
use super::hand::{Finger, FingerJoint, Hand};
use super::layout::{ANGLES, BODIES, COORDINATES, FINGERS, JOINTS, PALM};
use darm_robot::description::{DescriptionError, read, read_shapes};
use darm_robot::robot::{Robot, RobotFrame};
use darm_robot::shape::LinkShape;
use darm_robot::urdf::Locks;

/// A hand as its file gives it.
#[derive(Clone, Debug)]
pub struct HandFile {
    /// The hand that computes.
    pub hand: Hand,
    /// The same hand as a robot, which checks every answer.
    pub cross_check: CrossCheck,
    /// The sequence of λ for the paper's search.
    pub lambdas: Vec<f64>,
}

/// A robot and its file, which has the shapes of its links too.
pub(super) struct Described {
    pub(super) robot: Robot,
    path: PathBuf,
}

/// A finger, its joints' limits, and where it is in the robot.
pub(super) struct Read {
    pub(super) finger: Finger,
    limits: [[f64; 2]; COORDINATES],
    tip: RobotFrame,
    path: [usize; JOINTS],
}

/// Ranges of the virtual joints φ₅ and φ₆ where nobody says others, deg.
pub(super) const VIRTUAL_DEG: [[f64; 2]; 2] = [[0.0, 90.0], [-45.0, 45.0]];

impl Described {
    /// Reads a URDF or MJCF.
    pub(super) fn read(path: &Path) -> Result<Self, DescriptionError> {
        Ok(Self { robot: read(path, &Locks::new())?, path: path.into() })
    }

    /// The hand of four fingers, none of which share a joint.
    pub(super) fn assemble(
        self,
        name: String,
        fingers: [Read; FINGERS],
        lambdas: Vec<f64>,
    ) -> Result<HandFile, HandFault> {
        if let Some((_, fault)) = shared(&fingers) {
            return Err(fault);
        }
        let bodies = self.bodies(&fingers)?;
        let joints = std::array::from_fn(|i| fingers[i].path);
        let tips = std::array::from_fn(|i| fingers[i].tip.clone());
        let limits = limits(&fingers);
        let hand = Hand::new(name, fingers.map(|finger| finger.finger), limits, bodies).map_err(HandFault::Flat)?;
        Ok(HandFile { hand, cross_check: CrossCheck { robot: self.robot, joints, tips }, lambdas })
    }

    /// The links of the fingers and the palm, each with its shapes.
    fn bodies(&self, fingers: &[Read; FINGERS]) -> Result<[Body; BODIES], HandFault> {
        let joints: Vec<usize> = fingers.iter().flat_map(|finger| finger.path).collect();
        let link = |joint: &usize| self.robot.joints[*joint].link.clone();
        let palm = || self.robot.frames.first().map_or(String::new(), |base| base.name.clone());
        let mut bodies: [Body; BODIES] =
            std::array::from_fn(|body| Body { name: joints.get(body).map_or_else(palm, link), shapes: Vec::new() });
        for shape in &read_shapes(&self.path).map_err(|error| HandFault::Robot(error.to_string()))? {
            let frame = self.robot.frame(&shape.link).ok_or_else(|| unknown_link(&self.robot, &shape.link))?;
            let no_finger = || HandFault::NoFinger { link: shape.link.clone() };
            let body = match frame.joint {
                None => PALM,
                Some(joint) => joints.iter().position(|other| *other == joint).ok_or_else(no_finger)?,
            };
            bodies[body].shapes.push(LinkShape { pose: frame.pose * shape.pose, ..shape.clone() });
        }
        if bodies.iter().all(|body| body.shapes.is_empty()) {
            return Err(HandFault::NoShapes);
        }
        Ok(bodies)
    }
}

/// The first finger that shares a joint with one before it.
pub(super) fn shared(fingers: &[Read; FINGERS]) -> Option<(usize, HandFault)> {
    fingers.iter().enumerate().find_map(|(i, finger)| {
        let other = fingers[..i].iter().find(|other| other.path.iter().any(|joint| finger.path.contains(joint)))?;
        let (finger, other) = (finger.finger.name.clone(), other.finger.name.clone());
        Some((i, HandFault::Shared { finger, other }))
    })
}

/// Least and greatest of every angle, rad.
pub(super) fn limits(fingers: &[Read; FINGERS]) -> [[f64; 2]; ANGLES] {
    std::array::from_fn(|k| fingers[k / COORDINATES].limits[k % COORDINATES])
}

/// The finger with this tip.
pub(super) fn finger_at(
    robot: &Robot,
    name: &str,
    tip: RobotFrame,
    virtual_deg: [[f64; 2]; 2],
    tip_radius_m: f64,
) -> Result<Read, HandFault> {
    let path = robot.path(&tip);
    let found = path.len();
    let path: [usize; JOINTS] = path.try_into().map_err(|_| HandFault::Joints { finger: name.into(), found })?;
    let mut limits = [[0.0; 2]; COORDINATES];
    for (limits, joint) in limits.iter_mut().zip(path.map(|joint| &robot.joints[joint])) {
        *limits = joint
            .limits
            .filter(|_| joint.joint.axis.kind == JointKind::Revolute)
            .ok_or_else(|| HandFault::Unlimited { joint: joint.name.clone() })?;
    }
    for (limits, range) in limits.iter_mut().skip(JOINTS).zip(virtual_deg) {
        *limits = range.map(f64::to_radians);
    }
    let joints = path.map(|joint| {
        let joint = &robot.joints[joint].joint;
        FingerJoint { placement: joint.placement, axis: joint.axis.direction }
    });
    let finger = Finger { name: name.to_owned(), joints, tip: tip.pose, tip_radius_m };
    Ok(Read { finger, limits, tip, path })
}

/// The fault that the robot has no such link.
pub(super) fn unknown_link(robot: &Robot, link: &str) -> HandFault {
    let known = robot.frames.iter().map(|frame| frame.name.clone()).collect();
    HandFault::UnknownLink { link: link.into(), known }
}
