//! Trees of any number of joints, in `f64`: where links are, how they move, and the Jacobians of frames.
//!
//! The core's [`Tree`](darm_core::tree::Tree) has its size at compile time and serves the chip; this one serves robots that
//! are read from files. Everything is in the axes of the world and about its origin, moments and angular velocities first;
//! [`dynamics`] adds masses.
//! Source: R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 2 and 4.

pub mod dynamics;
pub mod spatial;

use darm_core::actuator::JointKind;
use darm_core::real::{Mat6, Vec3, Vec6};
use darm_core::se::{Pose, rotation_about};
use darm_core::tree::{Body, Joint, TreeError};
use nalgebra::Matrix6xX;

use spatial::{Motion, cross, six};

/// Joints with their links, parents before children, on a base that is fixed or floats.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkTree {
    joints: Vec<Joint<f64>>,
    /// Inertial parameters of each link in its frame.
    pub bodies: Vec<Body<f64>>,
    /// Inertial parameters of the base in its frame; they count when it floats.
    pub base: Body<f64>,
    /// Acceleration of free fall in the world, m/s².
    pub gravity: Vec3<f64>,
}

/// Poses of all links in one posture.
#[derive(Clone, Debug, PartialEq)]
pub struct Links {
    /// Pose of the base in the world.
    pub base: Pose<f64>,
    /// Pose of each link in the world.
    pub poses: Vec<Pose<f64>>,
}

impl LinkTree {
    /// A tree of these joints, parents before children, without a mass of the base.
    ///
    /// # Errors
    ///
    /// A parent that does not come before its joint, or an axis that is no unit vector.
    pub fn new(joints: Vec<Joint<f64>>, gravity: Vec3<f64>) -> Result<Self, TreeError> {
        for (index, joint) in joints.iter().enumerate() {
            joint.check(index)?;
        }
        let bodies = joints.iter().map(|joint| Body::from(&joint.inertia)).collect();
        Ok(Self { joints, bodies, base: Body::none(), gravity })
    }

    /// Number of joints.
    pub fn len(&self) -> usize {
        self.joints.len()
    }

    /// Whether there is no joint.
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    /// Places all links for a pose of the base and positions of the joints, rad or m; a missing position is 0.
    pub fn place(&self, base: &Pose<f64>, q: &[f64]) -> Links {
        Links { base: *base, poses: place(self.joints.iter(), base, q) }
    }

    /// Motion of all links for that of the base and the rates of the joints; a missing rate is 0.
    pub fn motions(&self, links: &Links, base: &Motion, qd: &[f64], qdd: &[f64]) -> Vec<Motion> {
        motions(self.joints.iter(), &links.poses, base, [qd, qdd])
    }

    /// Whether the base carries a link through this joint, directly or through others: the joint and all before it.
    pub fn path(&self, joint: Option<usize>) -> impl Iterator<Item = usize> {
        std::iter::successors(joint, |&joint| self.joints[joint].parent)
    }

    /// Velocity of each link about the world's origin per unit of its joint.
    pub fn screws(&self, links: &Links) -> Vec<Vec6<f64>> {
        self.joints.iter().zip(&links.poses).map(|(joint, pose)| screw(joint, pose)).collect()
    }

    /// Twist of a frame about its own origin, in the axes of the world, per unit of each joint: 6 × n, angular rows first.
    pub fn jacobian(&self, links: &Links, joint: Option<usize>, pose: &Pose<f64>) -> Matrix6xX<f64> {
        let point = links.pose(joint, pose).position;
        let mut jacobian = Matrix6xX::zeros(self.len());
        for k in self.path(joint) {
            let screw = screw(&self.joints[k], &links.poses[k]);
            let (angular, linear) = (screw.fixed_rows::<3>(0).into_owned(), screw.fixed_rows::<3>(3).into_owned());
            jacobian.set_column(k, &six(&angular, &(linear + angular.cross(&point))));
        }
        jacobian
    }
}

impl Links {
    /// Pose in the world of a frame that is fixed to the link of a joint, or to the base.
    pub fn pose(&self, joint: Option<usize>, pose: &Pose<f64>) -> Pose<f64> {
        joint.map_or(self.base, |joint| self.poses[joint]) * *pose
    }

    /// Velocity about the world's origin per unit of the base's twist in its own frame: 6 × 6.
    pub fn base_screws(&self) -> Mat6<f64> {
        let mut screws = Mat6::zeros();
        for (k, axis) in self.base.rotation.column_iter().enumerate() {
            screws.set_column(k, &six(&axis.into(), &self.base.position.cross(&axis)));
            screws.set_column(3 + k, &six(&Vec3::zeros(), &axis.into()));
        }
        screws
    }
}

/// Poses of the links of these joints, parents before children; a missing position is 0.
pub fn place<'a>(joints: impl Iterator<Item = &'a Joint<f64>>, base: &Pose<f64>, q: &[f64]) -> Vec<Pose<f64>> {
    let mut poses: Vec<Pose<f64>> = Vec::with_capacity(joints.size_hint().0);
    for (k, joint) in joints.enumerate() {
        let parent = joint.parent.map_or(base, |parent| &poses[parent]);
        poses.push(joint_pose(joint, parent, q.get(k).copied().unwrap_or(0.0)));
    }
    poses
}

/// Pose of a joint's link at the position `q` (rad or m) when that of its parent is `parent`.
pub fn joint_pose(joint: &Joint<f64>, parent: &Pose<f64>, q: f64) -> Pose<f64> {
    let at = *parent * joint.placement;
    match joint.axis.kind {
        JointKind::Revolute => Pose { rotation: at.rotation * rotation_about(&joint.axis.direction, q), ..at },
        JointKind::Prismatic => Pose { position: at.position + at.rotation * joint.axis.direction * q, ..at },
    }
}

/// Motion of the links of these joints at their poses, from velocities and accelerations; a missing one is 0.
pub fn motions<'a>(
    joints: impl Iterator<Item = &'a Joint<f64>>,
    poses: &[Pose<f64>],
    base: &Motion,
    [qd, qdd]: [&[f64]; 2],
) -> Vec<Motion> {
    let mut motions: Vec<Motion> = Vec::with_capacity(poses.len());
    for (k, (joint, pose)) in joints.zip(poses).enumerate() {
        let parent = joint.parent.map_or(base, |parent| &motions[parent]);
        let screw = screw(joint, pose);
        let [rate, acceleration] = [qd, qdd].map(|all| all.get(k).copied().unwrap_or(0.0));
        motions.push(Motion {
            velocity: parent.velocity + screw * rate,
            acceleration: parent.acceleration + cross(&parent.velocity, &screw) * rate + screw * acceleration,
        });
    }
    motions
}

fn screw(joint: &Joint<f64>, pose: &Pose<f64>) -> Vec6<f64> {
    let axis = pose.rotation * joint.axis.direction;
    match joint.axis.kind {
        JointKind::Revolute => six(&axis, &pose.position.cross(&axis)),
        JointKind::Prismatic => six(&Vec3::zeros(), &axis),
    }
}

#[cfg(test)]
mod tests;
