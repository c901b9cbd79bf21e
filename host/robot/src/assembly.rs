//! A robot as far as the walk over its file has come: joints, links that are fixed to others, locks, joints that follow.

use std::collections::{BTreeMap, BTreeSet};

use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use darm_core::tree::{Inertia, Joint};

use crate::robot::{Mimic, Robot, RobotFrame, RobotJoint};

/// Joints by name that are held at a position (rad or m) as if they were fixed.
pub type Locks = BTreeMap<String, f64>;

/// Which of a file is the robot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// Joints that are locked.
    pub locks: Locks,
    /// The body or link with which its tree begins; `None`: all that the file describes.
    pub root: Option<String>,
}

impl From<&Locks> for Selection {
    fn from(locks: &Locks) -> Self {
        Self { locks: locks.clone(), root: None }
    }
}

/// A joint follows another by name: q = factor · q of the other + offset.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Following {
    pub(crate) joint: String,
    pub(crate) factor: f64,
    pub(crate) offset: f64,
}

/// Joints by name, and which they follow.
pub(crate) type Followings = BTreeMap<String, Following>;

/// The place of a link: in the link of which moving joint, and with which pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinkPose {
    pub(crate) joint: Option<usize>,
    pub(crate) pose: Pose<f64>,
}

/// A robot under construction.
pub(crate) struct Assembly<'a> {
    pub(crate) robot: Robot,
    locks: &'a Locks,
    followings: Followings,
    met: BTreeSet<String>,
    impossible: Vec<String>,
}

impl LinkPose {
    pub(crate) fn on_base() -> Self {
        Self { joint: None, pose: Pose::identity() }
    }

    /// A frame with this pose on the link.
    pub(crate) fn then(&self, pose: &Pose<f64>) -> Self {
        Self { pose: self.pose * *pose, ..*self }
    }
}

impl<'a> Assembly<'a> {
    /// A robot without joints; the joints that follow do so directly. `Err`: a joint that follows itself through others.
    pub(crate) fn new(
        name: &str,
        gravity: Vec3<f64>,
        locks: &'a Locks,
        followings: &Followings,
    ) -> Result<Self, String> {
        let direct = |(name, _): (&String, &Following)| Ok((name.clone(), direct(name, followings, locks)?));
        let followings = followings.iter().filter(|(name, _)| !locks.contains_key(*name));
        let robot = Robot { name: name.into(), gravity, ..Robot::empty() };
        let followings = followings.map(direct).collect::<Result<_, String>>()?;
        Ok(Self { robot, locks, followings, met: BTreeSet::new(), impossible: Vec::new() })
    }

    /// Takes a joint in, and gives the place of the link that it carries. Its placement is that on the link before it.
    pub(crate) fn joint(&mut self, on: &LinkPose, joint: RobotJoint) -> LinkPose {
        let placement = on.pose * joint.joint.placement;
        self.met.insert(joint.name.clone());
        let following = self.followings.get(&joint.name);
        let fixed_at = following.and_then(|following| {
            let at = self.locks.get(&following.joint)?;
            Some(following.factor * at + following.offset)
        });
        if let Some(at) = self.locks.get(&joint.name).copied().or(fixed_at) {
            return LinkPose { pose: placement * joint.joint.axis.pose(at), ..*on };
        }
        let inner = Joint { parent: on.joint, placement, ..joint.joint };
        self.robot.joints.push(RobotJoint { joint: inner, ..joint });
        LinkPose { joint: Some(self.robot.joints.len() - 1), pose: Pose::identity() }
    }

    /// The base floats, and all before this was fixed to a world that does not count.
    pub(crate) fn float(&mut self) -> LinkPose {
        self.robot.floating = true;
        self.robot.base = Inertia::none();
        self.robot.frames.clear();
        LinkPose::on_base()
    }

    /// Takes a link in: its frame, and its inertia into the body that it is fixed to.
    pub(crate) fn link(&mut self, name: &str, place: &LinkPose, inertia: &Inertia<f64>, is_end: bool) {
        if !is_possible(&inertia.about_com) {
            self.impossible.push(name.into());
        }
        let placed = inertia.placed(&place.pose.rotation, &place.pose.position);
        let joint = place.joint.and_then(|joint| self.robot.joints.get_mut(joint));
        let body = joint.map_or(&mut self.robot.base, |joint| &mut joint.joint.inertia);
        *body = if *body == Inertia::none() { placed } else { body.joined(&placed) };
        self.frame(name, place, is_end);
    }

    /// Takes a frame in that has no mass.
    pub(crate) fn frame(&mut self, name: &str, place: &LinkPose, is_end: bool) {
        self.robot.frames.push(RobotFrame { name: name.into(), joint: place.joint, pose: place.pose, is_end });
    }

    /// The name of a joint that is to be locked and was not met.
    pub(crate) fn unknown_lock(&self) -> Option<&String> {
        self.locks.keys().find(|name| !self.met.contains(*name))
    }

    /// The robot with what a user should know.
    pub(crate) fn finish(mut self) -> Robot {
        let number: BTreeMap<_, _> =
            self.robot.joints.iter().enumerate().map(|(index, joint)| (joint.name.clone(), index)).collect();
        for joint in &mut self.robot.joints {
            let Some(Following { joint: other, factor, offset }) = self.followings.get(&joint.name) else { continue };
            joint.mimic = number.get(other).map(|&joint| Mimic { joint, factor: *factor, offset: *offset });
            self.robot.warnings.push(format!(
                "joint `{}` mimics `{other}`: its position is computed; a diagnosis measures it, or needs it locked",
                joint.name
            ));
        }
        let massless = |joint: &&RobotJoint| joint.joint.inertia.mass == 0.0 && joint.armature == 0.0;
        let massless = self.robot.joints.iter().filter(massless).map(|joint| joint.link.clone()).collect();
        self.robot.warn_of("without mass, which dynamics takes as none", massless);
        self.robot.warn_of("with moments of inertia that no body has", self.impossible);
        self.robot
    }
}

/// Which joint that moves independently or is locked a joint follows, through all between.
fn direct(name: &str, followings: &Followings, locks: &Locks) -> Result<Following, String> {
    let mut found = Following { joint: name.into(), factor: 1.0, offset: 0.0 };
    for _ in 0..=followings.len() {
        let locked = locks.contains_key(&found.joint);
        let Some(next) = followings.get(&found.joint).filter(|_| !locked) else { return Ok(found) };
        found.offset += found.factor * next.offset;
        found.factor *= next.factor;
        found.joint.clone_from(&next.joint);
    }
    Err(name.into())
}

/// Whether a body can have these moments of inertia: none below zero, none above the sum of the others.
fn is_possible(about_com: &Mat3<f64>) -> bool {
    let moments = about_com.symmetric_eigenvalues();
    let slack = 1e-9 * moments.amax();
    let sum = moments.sum();
    moments.iter().all(|moment| *moment >= -slack && 2.0 * moment <= sum + slack)
}
