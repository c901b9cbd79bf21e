//! How the links of a robot move, and the wrenches that their inertial parameters cause: the rigid-body regressor in f64 for
//! any number of joints and a base that may move.
//!
//! For a link with origin o, angular velocity ω, angular acceleration α and acceleration a of its origin minus free fall, all
//! in its own frame, the wrench per parameter (m, m·c, I) is moment (0, −\[a\], L(α) + \[ω\]L(ω)) and
//! force (a, \[α\] + \[ω\]², 0) with L(w)·(xx, xy, yy, xz, yz, zz) = I·w. Source: as
//! [`darm_core::dynamics::regressor`]; a test compares both.

use darm_core::actuator::JointKind;
use darm_core::real::Vec3;
use darm_core::se::Pose;
use nalgebra::SMatrix;

use crate::robot::Robot;
use crate::tree;
use crate::tree::spatial::{Motion, halves, six};

/// Wrench of a body per inertial parameter, about the origin of the world and in its axes: moment, then force, as
/// [`Wrench`](darm_core::se::Wrench).
pub type WrenchRegressor = SMatrix<f64, 6, 10>;

/// A frame and how it moves, in the axes of the world.
#[derive(Clone, Copy, Debug)]
pub struct BodyMotion {
    /// Pose of the frame in the world.
    pub pose: Pose<f64>,
    /// Angular velocity, rad/s.
    pub omega: Vec3<f64>,
    /// Angular acceleration, rad/s².
    pub alpha: Vec3<f64>,
    /// Acceleration of its origin minus that of free fall, m/s².
    pub acceleration: Vec3<f64>,
}

impl BodyMotion {
    /// A base at rest in this field of free fall.
    pub fn resting(gravity: &Vec3<f64>) -> Self {
        let zero = Vec3::zeros();
        Self { pose: Pose::identity(), omega: zero, alpha: zero, acceleration: -gravity }
    }

    /// The motion of a frame with this pose on a body that moves so.
    fn at(pose: Pose<f64>, motion: &Motion) -> Self {
        let ((omega, v), (alpha, a)) = (halves(&motion.velocity), halves(&motion.acceleration));
        let velocity = v + omega.cross(&pose.position);
        Self { pose, omega, alpha, acceleration: a + alpha.cross(&pose.position) + omega.cross(&velocity) }
    }

    /// The motion of its body about the world's origin, in a world whose origin moves with the frame's.
    fn spatial(&self) -> Motion {
        let (omega, alpha, position) = (&self.omega, &self.alpha, &self.pose.position);
        let velocity = -omega.cross(position);
        Motion {
            velocity: six(omega, &velocity),
            acceleration: six(alpha, &(self.acceleration - alpha.cross(position))),
        }
    }
}

/// The motion of each link on a moving base, from positions, rates and accelerations of the joints.
pub fn link_motions(robot: &Robot, base: &BodyMotion, [q, qd, qdd]: [&[f64]; 3]) -> Vec<BodyMotion> {
    let joints = || robot.joints.iter().map(|joint| &joint.joint);
    let poses = tree::place(joints(), &base.pose, q);
    let motions = tree::motions(joints(), &poses, &base.spatial(), [qd, qdd]);
    poses.into_iter().zip(&motions).map(|(pose, motion)| BodyMotion::at(pose, motion)).collect()
}

/// L(w) with L(w)·(xx, xy, yy, xz, yz, zz) = I·w.
fn inertia_product(w: &Vec3<f64>) -> SMatrix<f64, 3, 6> {
    SMatrix::from_row_slice(&[
        w.x, w.y, 0.0, w.z, 0.0, 0.0, //
        0.0, w.x, w.y, 0.0, w.z, 0.0, //
        0.0, 0.0, 0.0, w.x, w.y, w.z,
    ])
}

/// The wrench of a link per inertial parameter of its frame.
pub fn wrench_regressor(link: &BodyMotion) -> WrenchRegressor {
    let rotation = &link.pose.rotation;
    let in_link = |v: &Vec3<f64>| rotation.tr_mul(v);
    let (w, alpha, a) = (in_link(&link.omega), in_link(&link.alpha), in_link(&link.acceleration));
    let spin = w.cross_matrix();
    let mut force = SMatrix::<f64, 3, 10>::zeros();
    force.set_column(0, &a);
    force.fixed_view_mut::<3, 3>(0, 1).copy_from(&(alpha.cross_matrix() + spin * spin));
    let mut moment = SMatrix::<f64, 3, 10>::zeros();
    moment.fixed_view_mut::<3, 3>(0, 1).copy_from(&-a.cross_matrix());
    moment.fixed_view_mut::<3, 6>(0, 4).copy_from(&(inertia_product(&alpha) + spin * inertia_product(&w)));
    let force = rotation * force;
    let moment = rotation * moment + link.pose.position.cross_matrix() * force;
    let mut wrench = WrenchRegressor::zeros();
    wrench.fixed_view_mut::<3, 10>(0, 0).copy_from(&moment);
    wrench.fixed_view_mut::<3, 10>(3, 0).copy_from(&force);
    wrench
}

/// Torque (N·m) or force (N) of a joint per inertial parameter of a link that it carries; `at` is the motion of the joint's
/// own link.
pub fn joint_regressor(robot: &Robot, joint: usize, at: &BodyMotion, wrench: &WrenchRegressor) -> [f64; 10] {
    let axis = at.pose.rotation * robot.joints[joint].joint.axis.direction;
    let (moment, force) = (wrench.fixed_view::<3, 10>(0, 0), wrench.fixed_view::<3, 10>(3, 0));
    let row = match robot.joints[joint].joint.axis.kind {
        JointKind::Revolute => axis.transpose() * (moment - at.pose.position.cross_matrix() * force),
        JointKind::Prismatic => axis.transpose() * force,
    };
    std::array::from_fn(|k| row[k])
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_core::dynamics::inverse_dynamics;
    use darm_core::tree::Body;

    use super::*;
    use crate::urdf::{Locks, parse};

    #[test]
    fn columns_times_parameters_are_inverse_dynamics() {
        let text = include_str!("../../../../tests/data/measured/tx40.urdf");
        let robot = parse(Path::new("tx40.urdf"), text, &Locks::new()).unwrap();
        let tree = robot.tree::<6>().unwrap();
        let [q, v, a] =
            [[0.3, -0.5, 0.7, 1.1, -0.4, 0.2], [1.0, -2.0, 0.5, 3.0, -1.0, 2.0], [4.0, 1.0, -3.0, 2.0, 5.0, -6.0]];
        let expected = inverse_dynamics(&tree, &q, &v, &a, None);
        let moving = link_motions(&robot, &BodyMotion::resting(&robot.gravity), [&q, &v, &a]);
        for joint in 0..6 {
            let torque: f64 = (joint..6)
                .map(|link| {
                    let parameters = Body::from(&robot.joints[link].joint.inertia).parameters();
                    let row = joint_regressor(&robot, joint, &moving[joint], &wrench_regressor(&moving[link]));
                    row.iter().zip(&parameters).map(|(y, p)| y * p).sum::<f64>()
                })
                .sum();
            assert!((torque - expected[joint]).abs() < 1e-9, "joint {joint}: {torque} {}", expected[joint]);
        }
    }
}
