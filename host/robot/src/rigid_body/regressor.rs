//! How the links of a robot move, and the wrenches that their inertial parameters cause: the rigid-body regressor in f64 for
//! any number of joints and a base that may move.
//!
//! For a link with origin o, angular velocity ω, angular acceleration α and acceleration a of its origin minus free fall, all
//! in its own frame, the wrench per parameter (m, m·c, I) is moment (0, −\[a\], L(α) + \[ω\]L(ω)) and
//! force (a, \[α\] + \[ω\]², 0) with L(w)·(xx, xy, yy, xz, yz, zz) = I·w. Source: as
//! [`darm_core::dynamics::regressor`]; a test compares both.

use darm_core::actuator::JointKind;
use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, rotation_exp};
use nalgebra::SMatrix;

use crate::robot::Robot;

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
}

/// The motion of each link on a moving base, from positions, rates and accelerations of the joints.
pub fn link_motions(robot: &Robot, base: &BodyMotion, [q, qd, qdd]: [&[f64]; 3]) -> Vec<BodyMotion> {
    let mut all: Vec<BodyMotion> = Vec::with_capacity(robot.joints.len());
    for (k, joint) in robot.joints.iter().enumerate() {
        let joint = &joint.joint;
        let parent = joint.parent.and_then(|index| all.get(index)).copied().unwrap_or(*base);
        let arm = parent.pose.rotation * joint.placement.position;
        let rotation = parent.pose.rotation * joint.placement.rotation;
        let axis = rotation * joint.axis.direction;
        let carried = parent.acceleration + parent.alpha.cross(&arm) + parent.omega.cross(&parent.omega.cross(&arm));
        let position = parent.pose.position + arm;
        all.push(match joint.axis.kind {
            JointKind::Revolute => BodyMotion {
                pose: Pose { rotation: rotation * rotation_exp(&(joint.axis.direction * q[k])), position },
                omega: parent.omega + axis * qd[k],
                alpha: parent.alpha + axis * qdd[k] + parent.omega.cross(&axis) * qd[k],
                acceleration: carried,
            },
            JointKind::Prismatic => {
                let slide = axis * q[k];
                let centripetal = parent.alpha.cross(&slide) + parent.omega.cross(&parent.omega.cross(&slide));
                BodyMotion {
                    pose: Pose { rotation, position: position + slide },
                    omega: parent.omega,
                    alpha: parent.alpha,
                    acceleration: carried + centripetal + parent.omega.cross(&axis) * (2.0 * qd[k]) + axis * qdd[k],
                }
            }
        });
    }
    all
}

fn cross_matrix(w: &Vec3<f64>) -> Mat3<f64> {
    Mat3::new(0.0, -w.z, w.y, w.z, 0.0, -w.x, -w.y, w.x, 0.0)
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
    let spin = cross_matrix(&w);
    let mut force = SMatrix::<f64, 3, 10>::zeros();
    force.set_column(0, &a);
    force.fixed_view_mut::<3, 3>(0, 1).copy_from(&(cross_matrix(&alpha) + spin * spin));
    let mut moment = SMatrix::<f64, 3, 10>::zeros();
    moment.fixed_view_mut::<3, 3>(0, 1).copy_from(&-cross_matrix(&a));
    moment.fixed_view_mut::<3, 6>(0, 4).copy_from(&(inertia_product(&alpha) + spin * inertia_product(&w)));
    let force = rotation * force;
    let moment = rotation * moment + cross_matrix(&link.pose.position) * force;
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
        JointKind::Revolute => axis.transpose() * (moment - cross_matrix(&at.pose.position) * force),
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
