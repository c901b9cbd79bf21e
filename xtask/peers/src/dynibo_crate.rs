//! The crate `dynibo`, whose robots have a size at run time: it reads URDF files and checks what it is given and what it gives.
//!
//! Its acceleration of free fall is 9.80665 m/s², ours 9.81: what gravity adds is corrected outside of what is timed.

use std::error::Error;
use std::fmt::Write as _;
use std::hint::black_box;

use darm_core::actuator::JointKind;
use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use dynibo::Robot;

use super::{Measured, time};
use crate::models::Arm;

/// By how much of its gravity ours is more.
const MORE_GRAVITY: f64 = 9.81 / 9.80665 - 1.0;

pub(crate) fn measure<const N: usize>(into: &mut Measured, arm: &Arm<N>) -> Result<(), Box<dyn Error>> {
    let path = std::env::temp_dir().join(format!("peers-{}-{}.urdf", arm.name, std::process::id()));
    std::fs::write(&path, urdf(arm))?;
    let robot = Robot::from_urdf(&path);
    std::fs::remove_file(&path)?;
    let mut robot = robot?;
    let tool = robot.link_id("end")?;
    // What is refused shows in the sums, which are compared.
    time(into, arm, "pose", |[q, ..]| {
        let pose = black_box(robot.forward_kinematics(black_box(q), tool));
        pose.map_or(f64::NAN, |pose| pose.translation.vector.sum())
    });
    let mut jacobian = vec![0.0; 6 * N];
    time(into, arm, "jacobian", |[q, ..]| {
        let result = robot.jacobian(black_box(q), tool, &mut jacobian);
        let jacobian = black_box(&jacobian);
        result.map_or(f64::NAN, |()| jacobian[3] + jacobian[6 * (N - 1) + 2] + jacobian[6 * (N / 2) + 4])
    });
    let mut torque = vec![0.0; N];
    time(into, arm, "inverse-dynamics", |[q, qd, qdd]| {
        let result = robot.inverse_dynamics(black_box(q), qd, qdd, &[], &mut torque);
        let torque = black_box(&torque);
        result.map_or(f64::NAN, |()| torque.iter().sum())
    });
    time(into, arm, "gravity", |[q, ..]| {
        let result = robot.gravity(black_box(q), &[], &mut torque);
        let torque = black_box(&torque);
        result.map_or(f64::NAN, |()| torque.iter().sum())
    });
    let mut mass = vec![0.0; N * N];
    time(into, arm, "mass-matrix", |[q, ..]| {
        let result = robot.mass_matrix(black_box(q), &mut mass);
        let mass = black_box(&mass);
        result.map_or(f64::NAN, |()| mass[0] + mass[N * (N - 1)] + mass[N * (N / 2) + N / 2])
    });
    let gravity: f64 = into.get(&format!("{} gravity", arm.name)).map_or(f64::NAN, |(_, sum)| *sum);
    for work in ["inverse-dynamics", "gravity"] {
        if let Some((_, sum)) = into.get_mut(&format!("{} {work}", arm.name)) {
            *sum += gravity * MORE_GRAVITY;
        }
    }
    Ok(())
}

/// The arm as a URDF.
fn urdf<const N: usize>(arm: &Arm<N>) -> String {
    let mut text = format!("<robot name=\"{}\">\n<link name=\"base\"/>\n", arm.name);
    let name = |link: Option<usize>| link.map_or_else(|| "base".to_owned(), |link| format!("link{link}"));
    for (index, joint) in arm.joints.iter().enumerate() {
        let body = &joint.inertia;
        let i = &body.about_com;
        _ = writeln!(
            text,
            "<link name=\"{}\"><inertial><origin xyz=\"{}\"/><mass value=\"{:e}\"/><inertia ixx=\"{:e}\" ixy=\"{:e}\" \
             ixz=\"{:e}\" iyy=\"{:e}\" iyz=\"{:e}\" izz=\"{:e}\"/></inertial></link>",
            name(Some(index)),
            triple(&body.com),
            body.mass,
            i[(0, 0)],
            i[(0, 1)],
            i[(0, 2)],
            i[(1, 1)],
            i[(1, 2)],
            i[(2, 2)]
        );
        let kind = match joint.axis.kind {
            JointKind::Revolute => "revolute",
            JointKind::Prismatic => "prismatic",
        };
        _ = writeln!(
            text,
            "<joint name=\"joint{index}\" type=\"{kind}\"><parent link=\"{}\"/><child link=\"{}\"/>{}<axis xyz=\"{}\"/>\
             <limit lower=\"-10\" upper=\"10\" effort=\"1000\" velocity=\"100\"/></joint>",
            name(joint.parent),
            name(Some(index)),
            origin(&joint.placement),
            triple(&joint.axis.direction)
        );
    }
    _ = writeln!(
        text,
        "<link name=\"end\"/>\n<joint name=\"to_end\" type=\"fixed\"><parent link=\"{}\"/><child link=\"end\"/>{}</joint>\n</robot>",
        name(N.checked_sub(1)),
        origin(&arm.end)
    );
    text
}

fn triple(v: &Vec3<f64>) -> String {
    format!("{:e} {:e} {:e}", v.x, v.y, v.z)
}

fn origin(pose: &Pose<f64>) -> String {
    format!("<origin xyz=\"{}\" rpy=\"{}\"/>", triple(&pose.position), triple(&roll_pitch_yaw(&pose.rotation)))
}

/// The angles of Rz(yaw)·Ry(pitch)·Rx(roll), exact near ±90° of pitch, too, where an arc sine would lose half of its digits.
fn roll_pitch_yaw(r: &Mat3<f64>) -> Vec3<f64> {
    let across = r[(0, 0)].hypot(r[(1, 0)]);
    let pitch = (-r[(2, 0)]).atan2(across);
    if across < 1e-14 {
        return Vec3::new(0.0, pitch, (-r[(0, 1)]).atan2(r[(1, 1)]));
    }
    Vec3::new(r[(2, 1)].atan2(r[(2, 2)]), pitch, r[(1, 0)].atan2(r[(0, 0)]))
}
