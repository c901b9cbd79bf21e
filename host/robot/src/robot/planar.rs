//! Arms in the plane, of any number of revolute joints.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::{Inertia, Joint};

use super::{Robot, RobotFrame, RobotJoint};

/// An arm in the plane and its tip: revolute joints about z with links along x of these
/// lengths (m), limits in rad. Links have no mass.
pub fn planar_arm(lengths_m: &[f64], limits: &[[f64; 2]]) -> (Robot, RobotFrame) {
    let last = lengths_m.len().checked_sub(1);
    let before = |index: usize| index.checked_sub(1).and_then(|index| lengths_m.get(index)).copied().unwrap_or(0.0);
    let joint = |(index, limits): (usize, &[f64; 2])| {
        let placement = Pose::at(Vec3::new(before(index), 0.0, 0.0));
        let joint = Joint::revolute(index.checked_sub(1), Vec3::z(), placement, Inertia::none());
        let [name, link] = ["joint", "link"].map(|what| format!("{what}{}", index + 1));
        RobotJoint { limits: Some(*limits), ..RobotJoint::new(name, link, joint) }
    };
    let at = Pose::at(Vec3::new(before(lengths_m.len()), 0.0, 0.0));
    let tip = RobotFrame { name: "tip".into(), joint: last, pose: at, is_end: true };
    let base = RobotFrame { name: "base".into(), joint: None, pose: Pose::identity(), is_end: false };
    let arm = Robot {
        name: format!("planar arm of {} links", lengths_m.len()),
        joints: limits.iter().take(lengths_m.len()).enumerate().map(joint).collect(),
        frames: vec![base, tip.clone()],
        ..Robot::empty()
    };
    (arm, tip)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arm_without_links_ends_at_its_base() {
        let (arm, tip) = planar_arm(&[], &[]);
        assert_eq!(arm.kinematics(&tip, &[]).unwrap().pose_base_frame, Pose::identity());
    }
}
