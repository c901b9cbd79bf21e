//! How the links of a robot move, and the loads that their inertial parameters cause: columns of the regressor in f64 for
//! any number of joints and a base that may move.
//!
//! Of a link with origin o, angular velocity ω, angular acceleration α and acceleration a of its origin less free fall, all
//! told in its frame, the load per parameter (m, m·c, I) is force (a, \[α\] + \[ω\]², 0) and moment (0, −\[a\], L(α) + \[ω\]L(ω))
//! with L(w)·(xx, xy, yy, xz, yz, zz) = I·w. Source: as [`darm_core::dynamics::regressor`], which a test holds beside this.

use darm_core::actuator::JointKind;
use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, rotation_exp};
use nalgebra::{Matrix4, SMatrix};

use crate::linearise::experiment::{Candidate, Mass, Value};
use darm_robot::robot::Robot;

/// Load of a body per inertial parameter: force, then moment about the origin of the world, told in the world.
pub type Load = SMatrix<f64, 6, 10>;

/// Names and units of the ten inertial parameters.
pub const TEN: [(&str, &str); 10] = [
    ("m", "kg"),
    ("m·cx", "kg·m"),
    ("m·cy", "kg·m"),
    ("m·cz", "kg·m"),
    ("Ixx", "kg·m²"),
    ("Ixy", "kg·m²"),
    ("Iyy", "kg·m²"),
    ("Ixz", "kg·m²"),
    ("Iyz", "kg·m²"),
    ("Izz", "kg·m²"),
];

/// A frame and how it moves, told in the world.
#[derive(Clone, Copy, Debug)]
pub struct Moving {
    /// Where it is.
    pub pose: Pose<f64>,
    /// Angular velocity, rad/s.
    pub turning: Vec3<f64>,
    /// Angular acceleration, rad/s².
    pub turning_rate: Vec3<f64>,
    /// Acceleration of its origin less that of free fall, m/s².
    pub acceleration: Vec3<f64>,
}

impl Moving {
    /// A base that rests in this field of free fall.
    pub fn resting(gravity: &Vec3<f64>) -> Self {
        let zero = Vec3::zeros();
        Self { pose: Pose::identity(), turning: zero, turning_rate: zero, acceleration: -gravity }
    }
}

/// How each link moves on a moving base; positions, rates and accelerations of the joints.
pub fn links(robot: &Robot, base: &Moving, [q, qd, qdd]: [&[f64]; 3]) -> Vec<Moving> {
    let mut all: Vec<Moving> = Vec::with_capacity(robot.joints.len());
    for (k, joint) in robot.joints.iter().enumerate() {
        let joint = &joint.joint;
        let on = joint.parent.and_then(|parent| all.get(parent)).copied().unwrap_or(*base);
        let arm = on.pose.rotation * joint.placement.position;
        let stand = on.pose.rotation * joint.placement.rotation;
        let axis = stand * joint.axis.direction;
        let carried = on.acceleration + on.turning_rate.cross(&arm) + on.turning.cross(&on.turning.cross(&arm));
        let position = on.pose.position + arm;
        all.push(match joint.axis.kind {
            JointKind::Revolute => Moving {
                pose: Pose { rotation: stand * rotation_exp(&(joint.axis.direction * q[k])), position },
                turning: on.turning + axis * qd[k],
                turning_rate: on.turning_rate + axis * qdd[k] + on.turning.cross(&axis) * qd[k],
                acceleration: carried,
            },
            JointKind::Prismatic => {
                let slid = axis * q[k];
                let more = on.turning_rate.cross(&slid) + on.turning.cross(&on.turning.cross(&slid));
                Moving {
                    pose: Pose { rotation: stand, position: position + slid },
                    turning: on.turning,
                    turning_rate: on.turning_rate,
                    acceleration: carried + more + on.turning.cross(&axis) * (2.0 * qd[k]) + axis * qdd[k],
                }
            }
        });
    }
    all
}

fn cross_matrix(w: &Vec3<f64>) -> Mat3<f64> {
    Mat3::new(0.0, -w.z, w.y, w.z, 0.0, -w.x, -w.y, w.x, 0.0)
}

fn by_inertia(w: &Vec3<f64>) -> SMatrix<f64, 3, 6> {
    SMatrix::from_row_slice(&[
        w.x, w.y, 0.0, w.z, 0.0, 0.0, //
        0.0, w.x, w.y, 0.0, w.z, 0.0, //
        0.0, 0.0, 0.0, w.x, w.y, w.z,
    ])
}

/// The load of a link per inertial parameter in its frame.
pub fn load(link: &Moving) -> Load {
    let turn = &link.pose.rotation;
    let own = |v: &Vec3<f64>| turn.tr_mul(v);
    let (w, rate, a) = (own(&link.turning), own(&link.turning_rate), own(&link.acceleration));
    let spin = cross_matrix(&w);
    let mut force = SMatrix::<f64, 3, 10>::zeros();
    force.set_column(0, &a);
    force.fixed_view_mut::<3, 3>(0, 1).copy_from(&(cross_matrix(&rate) + spin * spin));
    let mut moment = SMatrix::<f64, 3, 10>::zeros();
    moment.fixed_view_mut::<3, 3>(0, 1).copy_from(&-cross_matrix(&a));
    moment.fixed_view_mut::<3, 6>(0, 4).copy_from(&(by_inertia(&rate) + spin * by_inertia(&w)));
    let force = turn * force;
    let moment = turn * moment + cross_matrix(&link.pose.position) * force;
    let mut load = Load::zeros();
    load.fixed_view_mut::<3, 10>(0, 0).copy_from(&force);
    load.fixed_view_mut::<3, 10>(3, 0).copy_from(&moment);
    load
}

/// What a load asks of a joint, per parameter: N·m or N.
pub fn of_joint(robot: &Robot, joint: usize, at: &Moving, load: &Load) -> [f64; 10] {
    let axis = at.pose.rotation * robot.joints[joint].joint.axis.direction;
    let (force, moment) = (load.fixed_view::<3, 10>(0, 0), load.fixed_view::<3, 10>(3, 0));
    let row = match robot.joints[joint].joint.axis.kind {
        JointKind::Revolute => axis.transpose() * (moment - cross_matrix(&at.pose.position) * force),
        JointKind::Prismatic => axis.transpose() * force,
    };
    std::array::from_fn(|k| row[k])
}

/// A candidate that changes the ten parameters of a body, with how far they may be off, and the body as it is.
///
/// Half its mass; its first moment by half its radius of gyration; its inertia by as much as it has. What has nearly no mass
/// of its own may have a hundredth of the whole robot's.
pub fn candidate(
    index: usize,
    link: &str,
    ten: &[f64; 10],
    whole_kg: f64,
    columns: [Vec<f64>; 10],
) -> (Candidate, Mass) {
    let mass = ten[0].max(0.01 * whole_kg);
    let inertia = ten[4].max(ten[6]).max(ten[9]).max(mass * 0.0025);
    let radius_m = (inertia / mass).sqrt();
    let prior = |k: usize| match k {
        0 => 0.5 * mass,
        1..=3 => 0.5 * mass * radius_m,
        _ => inertia,
    };
    let value = |(k, column): (usize, Vec<f64>)| Value {
        name: TEN[k].0.into(),
        unit: TEN[k].1.into(),
        prior: prior(k),
        column,
    };
    let candidate = Candidate {
        law: "mass-distribution",
        place: link.into(),
        shape: None,
        values: columns.into_iter().enumerate().map(value).collect(),
    };
    (candidate, Mass { candidate: index, ten: *ten })
}

/// The least mass as a share of what the body was said to have.
pub const LEAST_MASS: f64 = 0.1;
/// The least second moment as a share of their sum.
const LEAST_MOMENT: f64 = 1e-4;

/// The nearest ten parameters of a body that can be, with its mass and first moment as they are; one with hardly any
/// mass left becomes the `nominal` one with all ten scaled to the least mass.
///
/// A body is possible when its pseudo-inertia, [Σ, m·c; (m·c)ᵀ, m] with Σ = ½tr(I)·1 − I, is positive definite, which is
/// m > 0 and a positive definite Σ − m·c·cᵀ: eigenvalues of that below a least one are raised. Source: P. M. Wensing, S.
/// Kim, J.-J. Slotine, IEEE Robotics and Automation Letters 3 (2018) 60.
pub fn possible(ten: &[f64; 10], nominal: &[f64; 10]) -> [f64; 10] {
    let [mass, x, y, z, ..] = *ten;
    if mass < LEAST_MASS * nominal[0] || mass <= 0.0 {
        return nominal.map(|parameter| LEAST_MASS * parameter);
    }
    let moment = Vec3::new(x, y, z);
    let second = pseudo_inertia(ten).fixed_view::<3, 3>(0, 0).into_owned();
    let offset = moment * moment.transpose() / mass;
    let mut eigen = (second - offset).symmetric_eigen();
    let least = LEAST_MOMENT * eigen.eigenvalues.iter().map(|l| l.abs()).sum::<f64>();
    if eigen.eigenvalues.min() >= least {
        return *ten;
    }
    eigen.eigenvalues.apply(|l| *l = l.max(least));
    let s = eigen.recompose() + offset;
    let [a, b, c] = [s.m22 + s.m33, s.m11 + s.m33, s.m11 + s.m22];
    [mass, x, y, z, a, -s.m12, b, -s.m13, -s.m23, c]
}

/// [Σ, m·c; (m·c)ᵀ, m] with Σ = ½tr(I)·1 − I, of m, m·c and I.
pub fn pseudo_inertia(&[m, x, y, z, xx, xy, yy, xz, yz, zz]: &[f64; 10]) -> Matrix4<f64> {
    let half = 0.5 * (xx + yy + zz);
    Matrix4::new(half - xx, -xy, -xz, x, -xy, half - yy, -yz, y, -xz, -yz, half - zz, z, x, y, z, m)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_core::dynamics::inverse_dynamics;
    use darm_core::tree::Body;

    use super::*;
    use darm_robot::urdf::{Locks, parse};

    #[test]
    fn columns_times_parameters_are_inverse_dynamics() {
        let text = include_str!("../../../../tests/data/measured/tx40.urdf");
        let robot = parse(Path::new("tx40.urdf"), text, &Locks::new()).unwrap();
        let tree = robot.tree::<6>().unwrap();
        let [q, v, a] =
            [[0.3, -0.5, 0.7, 1.1, -0.4, 0.2], [1.0, -2.0, 0.5, 3.0, -1.0, 2.0], [4.0, 1.0, -3.0, 2.0, 5.0, -6.0]];
        let expected = inverse_dynamics(&tree, &q, &v, &a, None);
        let moving = links(&robot, &Moving::resting(&robot.gravity), [&q, &v, &a]);
        for joint in 0..6 {
            let torque: f64 = (joint..6)
                .map(|link| {
                    let ten = Body::from(&robot.joints[link].joint.inertia).parameters();
                    let row = of_joint(&robot, joint, &moving[joint], &load(&moving[link]));
                    row.iter().zip(&ten).map(|(y, p)| y * p).sum::<f64>()
                })
                .sum();
            assert!((torque - expected[joint]).abs() < 1e-9, "joint {joint}: {torque} {}", expected[joint]);
        }
    }

    #[test]
    fn a_possible_body_stays_and_an_impossible_one_becomes_possible() {
        let ball = [2.0, 0.0, 0.0, 0.1, 0.02, 0.0, 0.02, 0.0, 0.0, 0.02];
        assert_eq!(possible(&ball, &ball), ball);
        let far = possible(&[1.0, 0.5, 0.0, 0.0, 0.01, 0.0, 0.01, 0.0, 0.0, 0.01], &ball);
        assert!(far[0] > 0.0 && far[0] * far[6] > far[1] * far[1], "{far:?}");
        assert_eq!(possible(&[-1.0; 10], &ball)[0], 0.2);
    }
}
