//! The same hand as a robot of the core, which checks every answer: another forward kinematics than the one that found it.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::TreeError;

use super::contact::{Configuration, Contacts};
use super::hand::Hand;
use super::layout::{COORDINATES, FINGERS, JOINTS, Links, Pair};
use darm_robot::robot::{Robot, RobotFrame};

/// The robot, and where the hand's fingers are in it.
#[derive(Clone, Debug, PartialEq)]
pub struct CrossCheck {
    /// The robot.
    pub robot: Robot,
    /// The joints of every finger, by their number in the robot.
    pub joints: [[usize; JOINTS]; FINGERS],
    /// Frames of the fingertips.
    pub tips: [RobotFrame; FINGERS],
}

/// The judgement of a configuration.
#[derive(Clone, Copy, Debug)]
pub struct Verdict {
    /// Largest distance of a contact point from the requested one, m.
    pub point_m: f64,
    /// Largest angle between a contact's normal and the requested direction, rad.
    pub direction_rad: f64,
    /// How far the worst angle is past its limit, rad; zero within all.
    pub past_limit_rad: f64,
    /// Two bodies that touch and must not.
    pub collision: Option<Pair>,
}

impl CrossCheck {
    /// Where the links and fingertips are, by the robot's forward kinematics.
    ///
    /// # Errors
    ///
    /// The joints of the robot make no tree.
    pub fn place(&self, configuration: &Configuration) -> Result<(Links, [Pose<f64>; FINGERS]), TreeError> {
        let mut q = vec![0.0; self.robot.joints.len()];
        for (i, joints) in self.joints.iter().enumerate() {
            for (j, joint) in joints.iter().enumerate() {
                q[*joint] = configuration.angles[COORDINATES * i + j];
            }
        }
        let pose = |frame: &RobotFrame| Ok::<_, TreeError>(self.robot.kinematics(frame, &q)?.pose_base_frame);
        let mut links = [Pose::identity(); FINGERS * JOINTS];
        for (link, joint) in links.iter_mut().zip(self.joints.iter().flatten()) {
            let frame = RobotFrame { name: String::new(), joint: Some(*joint), pose: Pose::identity(), is_end: false };
            *link = pose(&frame)?;
        }
        let mut tips = [Pose::identity(); FINGERS];
        for (at, tip) in tips.iter_mut().zip(&self.tips) {
            *at = pose(tip)?;
        }
        Ok((links, tips))
    }

    /// Checks contacts, limits and collisions of a configuration.
    ///
    /// # Errors
    ///
    /// The joints of the robot make no tree.
    pub fn judge(&self, hand: &Hand, configuration: &Configuration, contacts: &Contacts) -> Result<Verdict, TreeError> {
        let (links, tips) = self.place(configuration)?;
        let mut verdict =
            Verdict { point_m: 0.0, direction_rad: 0.0, past_limit_rad: 0.0, collision: hand.shapes.collision(&links) };
        for (i, tip) in tips.iter().enumerate() {
            let [bend, lateral] = [JOINTS, JOINTS + 1].map(|j| configuration.angles[COORDINATES * i + j]);
            let (s, c) = bend.sin_cos();
            // The contact of the two virtual joints, written out: z turned by φ₅ towards x, then by φ₆ towards y.
            let normal = Vec3::new(lateral.cos() * s, lateral.sin(), lateral.cos() * c);
            let to_world = configuration.pose_world_palm * *tip;
            let point = to_world * (normal * hand.fingers[i].tip_radius_m);
            verdict.point_m = verdict.point_m.max((point - contacts[i].point).norm());
            let normal = to_world.rotation * normal;
            let angle = normal.cross(&contacts[i].direction).norm().atan2(normal.dot(&contacts[i].direction));
            verdict.direction_rad = verdict.direction_rad.max(angle);
        }
        for (angle, [low, high]) in configuration.angles.iter().zip(&hand.limits) {
            verdict.past_limit_rad = verdict.past_limit_rad.max(low - angle).max(angle - high);
        }
        Ok(verdict)
    }
}
