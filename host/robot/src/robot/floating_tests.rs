//! Bases that move: reference values, laws of the equation of motion, and the recursion link by link.

use darm_core::actuator::JointKind;
use darm_core::dynamics::floating::BaseMotion;
use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist, Wrench};
use nalgebra::{DMatrix, DVector, Quaternion, UnitQuaternion};
use serde_json::Value;

use super::tests::{golden, list, near, urdf};
use super::{Dynamics, Motion, Robot, base_at_rest};
use crate::assembly::Locks;
use crate::dh;
use crate::testing::puma560;

fn humanoid() -> Robot {
    Robot { floating: true, ..urdf("simple_humanoid") }
}

/// A state of the base and the joints that is not special in any way.
fn moving(robot: &Robot) -> (BaseMotion<f64>, [Vec<f64>; 3]) {
    let wave = |size: f64, step: f64| (0..robot.joints.len()).map(|k| size * (step * (k + 1) as f64).sin()).collect();
    let base = BaseMotion {
        pose: Pose::new(&Vec3::new(0.3, -0.8, 0.5), Vec3::new(0.4, -0.1, 0.9)),
        twist: Twist { angular: Vec3::new(0.7, -0.4, 0.9), linear: Vec3::new(-0.5, 0.8, 0.3) },
        twist_rate: Twist { angular: Vec3::new(1.1, 0.6, -0.7), linear: Vec3::new(0.2, -0.9, 1.3) },
    };
    (base, [wave(0.8, 1.3), wave(1.5, 2.1), wave(2.5, 0.7)])
}

fn equation(robot: &Robot, base: &BaseMotion<f64>, [q, qd, qdd]: &[Vec<f64>; 3]) -> Dynamics {
    robot.dynamics_on(base, &Motion { state: [q, qd, qdd], load: None }).unwrap()
}

/// M of base and joints.
fn mass(equation: &Dynamics) -> DMatrix<f64> {
    let (base, n) = (equation.base.as_ref().unwrap(), equation.mass.nrows());
    let mut mass = DMatrix::zeros(6 + n, 6 + n);
    mass.view_mut((0, 0), (6, 6)).copy_from(&base.mass);
    mass.view_mut((0, 6), (6, n)).copy_from(&base.coupling);
    mass.view_mut((6, 0), (n, 6)).copy_from(&base.coupling.transpose());
    mass.view_mut((6, 6), (n, n)).copy_from(&equation.mass);
    mass
}

/// The load on the base and the torques.
fn loads(equation: &Dynamics) -> DVector<f64> {
    let load = equation.base.as_ref().unwrap().load;
    DVector::from_iterator(
        6 + equation.torque.len(),
        load.moment.iter().chain(&load.force).chain(&equation.torque).copied(),
    )
}

/// Its mass matrix about the origin of the base, from mass, first moment and inertia (Featherstone, eq. 2.63).
#[test]
fn a_single_body_that_floats_has_its_own_mass_matrix() {
    let text = "<robot name=\"one\"><link name=\"a\"><inertial><origin xyz=\"0.1 0 0\"/><mass value=\"2\"/>\
                <inertia ixx=\"1\" iyy=\"2\" izz=\"3\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link></robot>";
    let robot = Robot { floating: true, ..crate::urdf::parse("one.urdf".as_ref(), text, &Locks::default()).unwrap() };
    let (base, state) = moving(&robot);
    let (m, x) = (2.0, 0.1);
    #[rustfmt::skip]
    let expected = DMatrix::from_row_slice(6, 6, &[
        1.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 2.0 + m * x * x, 0.0, 0.0, 0.0, -m * x,
        0.0, 0.0, 3.0 + m * x * x, 0.0, m * x, 0.0,
        0.0, 0.0, 0.0, m, 0.0, 0.0,
        0.0, 0.0, m * x, 0.0, m, 0.0,
        0.0, -m * x, 0.0, 0.0, 0.0, m,
    ]);
    let found = mass(&equation(&robot, &base, &state));
    assert!((&found - &expected).amax() < 1e-14, "{found}");
}

#[test]
fn a_floating_base_without_mass_has_no_acceleration() {
    // Base and link turn about one axis: their masses add up to one inertia, and rounding left 4e-19 of the second.
    let text = r#"<robot name="r"><link name="b"/><joint name="j" type="continuous"><parent link="b"/><child link="l"/>
        <axis xyz="0 0 1"/></joint><link name="l"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
        <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"#;
    let robot = Robot { floating: true, ..crate::urdf::parse("r.urdf".as_ref(), text, &Locks::default()).unwrap() };
    let motion = Motion { state: [&[0.0], &[0.0], &[]], load: None };
    assert_eq!(robot.accelerations(&motion, &[1.0]).unwrap(), None);
}

#[test]
fn a_humanoid_whose_base_moves_is_that_of_the_reference() {
    let (robot, file) = (humanoid(), golden("simple_humanoid_floating"));
    // Pinocchio takes children by the order of their names.
    let theirs: Vec<_> = file["joints"].as_array().unwrap()[1..].iter().map(|j| j["name"].as_str().unwrap()).collect();
    let order: Vec<_> = theirs.iter().map(|name| robot.joints.iter().position(|j| j.name == *name).unwrap()).collect();
    for sample in file["samples"].as_array().unwrap() {
        let state = [("q", 7), ("qd", 6), ("qdd", 6)].map(|(key, skip)| {
            let mut ours = vec![0.0; order.len()];
            order.iter().zip(&list(&sample[key])[skip..]).for_each(|(at, value)| ours[*at] = *value);
            ours
        });
        let equation = equation(&robot, &base_of(sample), &state);
        let linear_first = |load: &Wrench<f64>, torques: &[f64]| -> Vec<f64> {
            let torques = order.iter().map(|&k| torques[k]);
            load.force.iter().chain(&load.moment).copied().chain(torques).collect()
        };
        let base = equation.base.as_ref().unwrap();
        near(&linear_first(&base.load, &equation.torque), &list(&sample["tau_rnea"]), 1e-12);
        let biased: Vec<f64> = order.iter().map(|&k| equation.velocity_torque[k] + equation.gravity[k]).collect();
        near(&biased, &list(&sample["nle"])[6..], 1e-12);
        let joints: Vec<f64> = order.iter().map(|&k| equation.mass[(k, k)]).collect();
        near(&joints, &list(&sample["M_diag_and_first6rows"][0])[6..], 1e-12);
    }
}

fn base_of(sample: &Value) -> BaseMotion<f64> {
    let q = list(&sample["q"]);
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(q[6], q[3], q[4], q[5]));
    let twist = |key: &str| {
        let v = list(&sample[key]);
        Twist { angular: [v[3], v[4], v[5]].into(), linear: [v[0], v[1], v[2]].into() }
    };
    let pose = Pose { rotation: turn.to_rotation_matrix().into_inner(), position: [q[0], q[1], q[2]].into() };
    BaseMotion { pose, twist: twist("qd"), twist_rate: twist("qdd") }
}

/// The loads are M a + C v + G, and with C of Christoffel's symbols dM/dt − 2C is skew.
#[test]
fn the_equation_of_motion_is_made_of_its_parts() {
    let (robot, (base, state)) = (humanoid(), moving(&humanoid()));
    let complete = equation(&robot, &base, &state);
    let n = state[0].len();
    let six = |twist: &Twist<f64>| twist.to_vector();
    let v = DVector::from_iterator(6 + n, six(&base.twist).iter().chain(&state[1]).copied());
    let a = DVector::from_iterator(6 + n, six(&base.twist_rate).iter().chain(&state[2]).copied());
    let still = BaseMotion { twist: Twist::zero(), twist_rate: Twist::zero(), ..base };
    let gravity = loads(&equation(&robot, &still, &[state[0].clone(), vec![0.0; n], vec![0.0; n]]));
    let coriolis = &complete.base.as_ref().unwrap().coriolis;
    let sum = mass(&complete) * a + coriolis * &v + gravity;
    near(sum.as_slice(), loads(&complete).as_slice(), 1e-12);
    near(&complete.velocity_torque, &(coriolis * &v).as_slice()[6..], 1e-12);
    assert!((0.5 * v.dot(&(mass(&complete) * &v)) - complete.kinetic_j).abs() < 1e-10);
    let step = 1e-5;
    let at = |t: f64| {
        let base = BaseMotion { pose: base.pose * Pose::exp(&Twist::from_vector(&(six(&base.twist) * t))), ..base };
        let q = state[0].iter().zip(&state[1]).map(|(q, qd)| q + t * qd).collect();
        mass(&equation(&robot, &base, &[q, state[1].clone(), state[2].clone()]))
    };
    let skew = (at(step) - at(-step)) / (2.0 * step) - coriolis * 2.0;
    assert!((&skew + skew.transpose()).amax() < 1e-6, "{}", (&skew + skew.transpose()).amax());
}

/// A robot that nothing but gravity acts on falls: its centre of mass accelerates with g wherever it is and however it turns.
#[test]
fn a_robot_that_turns_in_the_air_falls() {
    let (robot, (base, [q, qd, _])) = (humanoid(), moving(&humanoid()));
    let motion = Motion { state: [&q, &qd, &[]], load: None };
    let free = robot.accelerations_on(&base, &motion, &vec![0.0; q.len()]).unwrap().unwrap();
    let base = BaseMotion { twist_rate: free.base.unwrap(), ..base };
    let links = robot.recursion(&base, &Motion { state: [&q, &qd, &free.joints], load: None }).unwrap();
    assert!(links[0].joint_force.norm() < 1e-9 && links[0].joint_moment.norm() < 1e-9, "{:?}", links[0]);
}

/// Three joints of the Stanford arm, the third of which slides.
fn stanford() -> Robot {
    let row = |kind: &str, d_m: f64, alpha_deg: f64, mass_kg: f64| {
        format!(
            "[[row]]\nmotion = \"{kind}\"\nd_m = {d_m}\nalpha_deg = {alpha_deg}\nmass_kg = {mass_kg}\n\
             center_m = [0.1, -0.1, 0.2]\ninertia_kg_m2 = [0.3, 0.1, 0.25]\n"
        )
    };
    let rows =
        row("revolute", 0.412, -90.0, 9.29) + &row("revolute", 0.154, 90.0, 5.01) + &row("prismatic", 0.0, 0.0, 4.25);
    let text = format!("format = 1\nname = \"stanford\"\nnotation = \"standard\"\n{rows}");
    dh::parse(std::path::Path::new("stanford.toml"), &text).unwrap()
}

/// Velocities and accelerations of the recursion are differences of poses, and its moments and forces project to the torques.
#[test]
fn the_recursion_agrees_with_poses_and_torques() {
    for robot in [puma560(), stanford(), humanoid()] {
        let (base, state) = moving(&robot);
        let base = if robot.floating { base } else { base_at_rest() };
        let load = Wrench { moment: Vec3::new(1.0, -2.0, 0.5), force: Vec3::new(7.0, 3.0, -9.0) };
        let tool = robot.tool().unwrap();
        let motion = Motion { state: [&state[0], &state[1], &state[2]], load: Some((tool, load)) };
        let links = robot.recursion(&base, &motion).unwrap();
        let equation = robot.dynamics_on(&base, &motion).unwrap();
        for link in &links {
            let Some(k) = link.joint else {
                let load = equation.base.as_ref().unwrap().load;
                near(link.joint_force.as_slice(), load.force.as_slice(), 1e-10);
                near(link.joint_moment.as_slice(), load.moment.as_slice(), 1e-10);
                continue;
            };
            let axis = robot.joints[k].joint.axis;
            let torque = match axis.kind {
                JointKind::Revolute => link.joint_moment.dot(&axis.direction),
                JointKind::Prismatic => link.joint_force.dot(&axis.direction),
            };
            assert!((torque - equation.torque[k]).abs() < 1e-10 * (1.0 + torque.abs()), "{} joint {k}", robot.name);
        }
        check_differences(&robot, &base, &state);
    }
}

fn check_differences(robot: &Robot, base: &BaseMotion<f64>, [q, qd, qdd]: &[Vec<f64>; 3]) {
    let step = 1e-4;
    // Two orders of the motion: the twist of the base grows by its rate.
    let at = |t: f64| {
        let twist = base.twist.to_vector() * t + base.twist_rate.to_vector() * (0.5 * t * t);
        let pose = base.pose * Pose::exp(&Twist::from_vector(&twist));
        let q: Vec<f64> = (0..q.len()).map(|k| q[k] + t * qd[k] + 0.5 * t * t * qdd[k]).collect();
        robot.placed_on(&pose, &q).unwrap().links
    };
    let (before, now, after) = (at(-step), at(0.0), at(step));
    let links = robot.recursion(base, &Motion { state: [q, qd, qdd], load: None }).unwrap();
    for link in &links {
        let pose = |links: &crate::tree::Links| links.pose(link.joint, &Pose::identity());
        let (a, b, c) = (pose(&before), pose(&now), pose(&after));
        let in_link = |v: Vec3<f64>| b.rotation.tr_mul(&v);
        let velocity = in_link((c.position - a.position) / (2.0 * step));
        let acceleration = in_link((c.position - b.position * 2.0 + a.position) / (step * step));
        assert!((velocity - link.velocity).amax() < 1e-5, "{velocity} {}", link.velocity);
        assert!((acceleration - link.acceleration).amax() < 1e-4, "{acceleration} {}", link.acceleration);
        let spin = b.rotation.transpose() * (c.rotation - a.rotation) / (2.0 * step);
        assert!((spin - link.angular_velocity.cross_matrix()).amax() < 1e-5);
        let turning = b.rotation.transpose() * (c.rotation - b.rotation * 2.0 + a.rotation) / (step * step);
        // Rᵀ R̈ = [ω̇]× + [ω]×².
        let w = link.angular_velocity.cross_matrix();
        assert!((turning - link.angular_acceleration.cross_matrix() - w * w).amax() < 1e-4, "{turning}");
    }
}
