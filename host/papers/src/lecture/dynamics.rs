//! The lecture's dynamics: statics, the inertia tensor, the recursion, and the state-space equation.

use std::f64::consts::PI;

use darm_core::actuator::JointKind;
use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, Wrench};
use darm_core::tree::{TreeError, singular};
use darm_robot::dh;
use darm_robot::rigid_body::solid::Solid;
use darm_robot::robot::recursion::LinkState;
use darm_robot::robot::{Motion, Robot, base_at_rest};
use darm_robot::tree::joint_pose;
use nalgebra::DVector;

use super::Row;
use super::draws::{DRAWS, apart, draw, random, row, worst};

/// Points of the quadrature along each axis of a box: two integrate squares exactly.
const GAUSS: [f64; 2] = [-0.577_350_269_189_625_8, 0.577_350_269_189_625_8];

/// An arm of the form of the Stanford arm's first three joints; the third slides.
#[expect(clippy::missing_panics_doc, reason = "its table is constant")]
pub fn sliding_arm() -> Robot {
    let row = |motion: &str, alpha: f64, d: f64, mass: f64| {
        format!(
            "[[row]]\nmotion = \"{motion}\"\nalpha_deg = {alpha:?}\nd_m = {d:?}\nmass_kg = {mass:?}\n\
             center_m = [0.02, -0.11, 0.05]\ninertia_kg_m2 = [0.28, 0.26, 0.07]\n"
        )
    };
    let rows = [("revolute", -90.0, 0.412, 9.29), ("revolute", 90.0, 0.154, 5.01), ("prismatic", 0.0, 0.0, 4.25)];
    let rows: String = rows.map(|(motion, alpha, d, mass)| row(motion, alpha, d, mass)).concat();
    let text = format!("format = 1\nname = \"sliding\"\nnotation = \"standard\"\n{rows}");
    dh::parse(std::path::Path::new("sliding.toml"), &text).expect("the table is valid")
}

/// τ = Jᵀ F does the work of F, and near a singularity a torque balances any force along one direction.
pub(super) fn statics(puma: &Robot, seed: u64) -> Result<Vec<Row>, TreeError> {
    const SECTION: &str = "statics";
    let Some(tool) = puma.tool() else { return Ok(Vec::new()) };
    let mut random = random(seed);
    let mut work = 0.0;
    for _ in 0..DRAWS {
        let (q, qd): ([f64; 6], [f64; 6]) = (draw(&mut random, PI), draw(&mut random, 1.0));
        let wrench = Wrench { moment: draw(&mut random, 10.0).into(), force: draw(&mut random, 50.0).into() };
        let kinematics = puma.kinematics(tool, &q)?;
        let torque = kinematics.statics(&wrench);
        let by_joints: f64 = torque.iter().zip(&qd).map(|(torque, qd)| torque * qd).sum();
        work = worst(work, (wrench.power(&kinematics.twist(&qd)) - by_joints).abs());
    }
    // The wrist straight: the direction that the joints cannot move along takes no torque.
    let kinematics = puma.kinematics(tool, &[0.3, 0.7, -1.5, 0.4, 0.0, 0.2])?;
    let ellipsoid = singular::manipulability_ellipsoid(&kinematics.compact_jacobian());
    let lost = ellipsoid.axes.column(5).into_owned();
    let wrench = Wrench { moment: Vec3::new(lost[0], lost[1], lost[2]), force: Vec3::new(lost[3], lost[4], lost[5]) };
    let torque = kinematics.statics(&wrench).iter().fold(0.0, |largest: f64, torque| largest.max(torque.abs()));
    Ok(vec![
        row(SECTION, "work of F less work of τ", work, "W"),
        row(SECTION, "torque of a unit wrench along the lost direction", torque, "N·m"),
    ])
}

/// I_xx = ∫ (y² + z²) ρ dv, I_xy = ∫ x y ρ dv over a box that is turned and displaced.
pub(super) fn inertia_tensor() -> Vec<Row> {
    let edges = [0.1, 0.25, 0.4];
    let pose = Pose::new(&Vec3::new(0.4, -0.9, 0.6), Vec3::new(0.3, -0.2, 0.5));
    let ours =
        Solid::cuboid(edges).with_density(1200.0).placed(&pose.rotation, &pose.position).about_origin().to_matrix();
    let mut sum = Mat3::zeros();
    let part = 1200.0 * edges.iter().product::<f64>() / 8.0;
    for k in 0..8 {
        let at = Vec3::from_fn(|axis, _| 0.5 * edges[axis] * GAUSS[k >> axis & 1]);
        let p = pose * at;
        sum += (Mat3::from_diagonal_element(p.norm_squared()) - p * p.transpose()) * part;
    }
    vec![row("inertia tensor", "turned box less the integral", (ours - sum).amax(), "kg·m²")]
}

/// Differences of the recursion as printed on the slides of single joints, and of its summary.
#[derive(Default)]
struct Differences {
    angular: f64,
    linear: f64,
    angular_acceleration: f64,
    linear_acceleration: f64,
    com: f64,
    torque: f64,
    /// As printed on the slides, where that is wrong.
    turning_printed: f64,
    sliding_printed: f64,
    com_printed: f64,
}

/// One step of the recursion outwards by the printed equations, from the library's state of the link before.
fn step(robot: &Robot, [before, after]: [&LinkState; 2], k: usize, [q, qd, qdd]: [f64; 3], d: &mut Differences) {
    let joint = &robot.joints[k].joint;
    let pose = joint_pose(joint, &Pose::identity(), q);
    let (p, z) = (pose.position, joint.axis.direction);
    let turn = |v: Vec3<f64>| pose.rotation.tr_mul(&v);
    let LinkState { angular_velocity: w, velocity: v, angular_acceleration: dw, acceleration: dv, .. } = *before;
    let common = |first: Vec3<f64>| turn(first.cross(&p) + w.cross(&w.cross(&p)) + dv);
    let is_turning = joint.axis.kind == JointKind::Revolute;
    let [w1, v1, dw1, dv1] = if is_turning {
        let spin = z * qd;
        [turn(w) + spin, turn(v + w.cross(&p)), turn(dw) + turn(w).cross(&spin) + z * qdd, common(dw)]
    } else {
        let w1 = turn(w);
        let slide = z * qd;
        [w1, turn(v + w.cross(&p)) + slide, turn(dw), common(dw) + w1.cross(&slide) * 2.0 + z * qdd]
    };
    d.angular = worst(d.angular, apart(&w1, &after.angular_velocity));
    d.linear = worst(d.linear, apart(&v1, &after.velocity));
    d.angular_acceleration = worst(d.angular_acceleration, apart(&dw1, &after.angular_acceleration));
    d.linear_acceleration = worst(d.linear_acceleration, apart(&dv1, &after.acceleration));
    if is_turning {
        d.turning_printed = worst(d.turning_printed, apart(&common(w), &after.acceleration));
    } else {
        d.sliding_printed = worst(d.sliding_printed, apart(&turn(w), &after.angular_acceleration));
    }
    let center = robot.joints[k].joint.inertia.com;
    let (w, dw, dv) = (after.angular_velocity, after.angular_acceleration, after.acceleration);
    let com = |inner: Vec3<f64>| dw.cross(&center) + w.cross(&inner) + dv;
    d.com = worst(d.com, apart(&com(w.cross(&center)), &after.com_acceleration));
    d.com_printed = worst(d.com_printed, apart(&com(w + center), &after.com_acceleration));
}

/// The recursion of a turning and of a sliding joint, and τ of its moments and forces.
pub(super) fn recursion(arms: [&Robot; 2], seed: u64) -> Result<Vec<Row>, TreeError> {
    const SECTION: &str = "Newton-Euler";
    let (mut random, mut d) = (random(seed), Differences::default());
    for robot in arms {
        for _ in 0..DRAWS {
            let [q, qd, qdd]: [[f64; 6]; 3] = [draw(&mut random, PI), draw(&mut random, 2.0), draw(&mut random, 5.0)];
            let n = robot.joints.len();
            let motion = Motion { state: [&q[..n], &qd[..n], &qdd[..n]], load: None };
            let links = robot.recursion(&base_at_rest(), &motion)?;
            let torque = robot.dynamics(&motion)?.torque;
            for (k, link) in links.iter().enumerate() {
                if let Some(before) = robot.joints[k].joint.parent {
                    step(robot, [&links[before], link], k, [q[k], qd[k], qdd[k]], &mut d);
                }
                let axis = robot.joints[k].joint.axis;
                let ours = if axis.kind == JointKind::Revolute { link.joint_moment } else { link.joint_force };
                d.torque = worst(d.torque, (ours.dot(&axis.direction) - torque[k]).abs());
            }
        }
    }
    Ok(vec![
        row(SECTION, "ω", d.angular, "rad/s"),
        row(SECTION, "v", d.linear, "m/s"),
        row(SECTION, "rate of ω, summary", d.angular_acceleration, "rad/s²"),
        row(SECTION, "rate of v, summary", d.linear_acceleration, "m/s²"),
        row(SECTION, "rate of v of a turning joint, as printed, wrong", d.turning_printed, "m/s²"),
        row(SECTION, "rate of ω of a sliding joint, as printed, wrong", d.sliding_printed, "rad/s²"),
        row(SECTION, "acceleration of the centre of mass, summary", d.com, "m/s²"),
        row(SECTION, "acceleration of the centre of mass, as printed, wrong", d.com_printed, "m/s²"),
        row(SECTION, "τ of the recursion less that of spatial vectors", d.torque, "N·m"),
    ])
}

/// τ = M q̈ + V + G + Jᵀ f, with f what the tool exerts.
pub(super) fn state_space(puma: &Robot, seed: u64) -> Result<Vec<Row>, TreeError> {
    const SECTION: &str = "state space";
    let Some(tool) = puma.tool() else { return Ok(Vec::new()) };
    let (mut random, mut sum, mut forward) = (random(seed), 0.0, 0.0);
    for _ in 0..DRAWS {
        let [q, qd, qdd]: [[f64; 6]; 3] = [draw(&mut random, PI), draw(&mut random, 2.0), draw(&mut random, 5.0)];
        let by_tool = Wrench { moment: draw(&mut random, 5.0).into(), force: draw(&mut random, 20.0).into() };
        let on_tool = Wrench { moment: -by_tool.moment, force: -by_tool.force };
        let motion = Motion { state: [&q, &qd, &qdd], load: Some((tool, on_tool)) };
        let equation = puma.dynamics(&motion)?;
        let inertial = &equation.mass * DVector::from_column_slice(&qdd);
        let by_load = puma.kinematics(tool, &q)?.statics(&by_tool);
        for k in 0..6 {
            let printed = inertial[k] + equation.velocity_torque[k] + equation.gravity[k] + by_load[k];
            sum = worst(sum, (equation.torque[k] - printed).abs());
        }
        let found = puma.accelerations(&motion, &equation.torque)?;
        let apart = found
            .map_or(f64::NAN, |found| found.joints.iter().zip(&qdd).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max));
        forward = worst(forward, apart);
    }
    Ok(vec![
        row(SECTION, "τ less M q̈ + V + G + Jᵀ f", sum, "N·m"),
        row(SECTION, "accelerations of these torques less q̈", forward, "rad/s²"),
    ])
}
