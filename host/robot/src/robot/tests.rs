//! The commands of a robot against reference values and laws: pose, torques, base parameters, inverse kinematics.

use std::io::Read as _;
use std::path::{Path, PathBuf};

use darm_core::se::Wrench;
use serde_json::Value;

use super::base_parameters::{BaseParameters, Inertial};
use super::*;
use crate::ik::{Method, Options, Status};
use crate::{dh, urdf};

fn at(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(name)
}

fn puma() -> Robot {
    dh::read(&at("examples/puma560.toml")).unwrap()
}

pub(super) fn urdf(name: &str) -> Robot {
    urdf::read(&at(&format!("tests/data/urdf/{name}.urdf")), &urdf::Locks::new()).unwrap()
}

pub(super) fn golden(name: &str) -> Value {
    let mut text = String::new();
    let file = std::fs::File::open(at(&format!("tests/data/golden/{name}.json.gz"))).unwrap();
    flate2::read::GzDecoder::new(file).read_to_string(&mut text).unwrap();
    serde_json::from_str(&text).unwrap()
}

pub(super) fn list(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().flat_map(|x| x.as_f64().map_or_else(|| list(x), |x| vec![x])).collect()
}

#[track_caller]
pub(super) fn near(ours: &[f64], theirs: &[f64], part: f64) {
    assert_eq!(ours.len(), theirs.len());
    let scale = theirs.iter().fold(1.0, |scale: f64, x| scale.max(x.abs()));
    for (a, b) in ours.iter().zip(theirs) {
        assert!((a - b).abs() <= part * scale, "{a} is not {b}");
    }
}

fn rows(matrix: &nalgebra::DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().iter().copied().collect()
}

/// The torques sum terms of 60 N m: weight times reach.
#[test]
fn the_table_of_the_puma_is_that_of_the_reference() {
    let (robot, file) = (puma(), golden("puma560_dh"));
    let tool = robot.tool().unwrap();
    for sample in file["samples"].as_array().unwrap() {
        let [q, qd, qdd] = ["q", "qd", "qdd"].map(|key| list(&sample[key]));
        let pose = robot.kinematics(tool, &q).unwrap().pose_base_frame;
        let expected = list(&sample["T"]);
        near(pose.position.as_slice(), &[expected[3], expected[7], expected[11]], 1e-12);
        let w = list(&sample["ee_wrench_world_aligned"]);
        let load = Wrench { moment: [w[3], w[4], w[5]].into(), force: [w[0], w[1], w[2]].into() };
        let motion = Motion { state: [&q, &qd, &qdd], load: Some((tool, load)) };
        let equation = robot.dynamics(&motion).unwrap();
        near(&equation.torque, &list(&sample["tau_rnea_with_wrench"]), 1e-12);
        near(&rows(&equation.mass), &list(&sample["M"]), 1e-12);
        near(&equation.gravity, &list(&sample["gravity"]), 1e-12);
        near(&equation.velocity_torque, &list(&sample["coriolis_times_qd"]), 1e-12);
        near(&[equation.kinetic_j], &[sample["kinetic_energy"].as_f64().unwrap()], 1e-12);
        // Solving loses as many digits as the condition of M has.
        let values = equation.mass.clone().singular_values();
        let free = Motion { load: None, ..motion };
        let found = robot.accelerations(&free, &list(&sample["tau_fd"])).unwrap().unwrap();
        near(&found.joints, &list(&sample["qdd_aba"]), 4.0 * f64::EPSILON * values.max() / values.min() + 1e-12);
        let com = robot.com(&q).unwrap();
        near(com.position.as_slice(), &list(&sample["com"]), 1e-12);
        near(&rows(&com.jacobian), &list(&sample["J_com"]), 1e-12);
    }
}

#[test]
fn a_table_says_what_is_wrong_with_it() {
    let refused = |rows: &str| {
        let text = format!("format = 1\nname = \"t\"\nnotation = \"modified\"\n\n[[row]]\n{rows}\n");
        dh::parse(Path::new("t.toml"), &text).unwrap_err().to_string()
    };
    assert_eq!(refused("mass_kg = -1"), "t.toml:5:1: the mass -1 kg is below zero; give at least 0");
    assert_eq!(
        refused("min_deg = 1"),
        "t.toml:5:1: the limits of a revolute joint are min_deg and max_deg; give both, the lower one first"
    );
    assert!(refused("inertia_kg_m2 = [1, 2]").contains("2 moments of inertia, give 3"));
    assert!(refused("d_m = inf").contains("the number has to be finite"));
    let empty = dh::parse(Path::new("t.toml"), "format = 1\nname = \"t\"\nnotation = \"standard\"").unwrap_err();
    assert_eq!(empty.to_string(), "t.toml:1:10: the table has no rows; add one [[row]] per joint");
}

fn words(robot: &Robot) -> Vec<String> {
    let found = robot.base_parameters(1).unwrap();
    found.base.iter().map(|parameter| BaseParameters::words(parameter, robot)).collect()
}

/// The textbook's six of the planar robot of two links, l₁ = 0.5 m.
#[test]
fn base_parameters_of_the_planar_robot_are_the_textbooks() {
    let robot = dh::read(&at("examples/planar2.toml")).unwrap();
    let expected =
        ["mx link 1 + 0.5 m link 2", "my link 1", "Izz link 1 + 0.25 m link 2", "mx link 2", "my link 2", "Izz link 2"];
    assert_eq!(words(&robot), expected);
    assert_eq!(words(&puma()).len(), 36);
}

/// What is in one sum goes to its first parameter, and what has no effect to nothing: no torque changes.
#[test]
fn base_parameters_alone_give_the_same_torques() {
    let mut floating = urdf("ur10");
    floating.floating = true;
    for robot in [urdf("tx40"), puma(), floating] {
        let whole = robot.tree::<8>().unwrap();
        let value = |inertial: &Inertial| match inertial.joint {
            Some(joint) => whole.parameters(joint)[inertial.number],
            None => whole.base.parameters()[inertial.number],
        };
        let mut bare = whole;
        (0..8).for_each(|link| bare.set_parameters(link, &[0.0; 10]));
        bare.base = darm_core::tree::Body::none();
        for parameter in &robot.base_parameters(7).unwrap().base {
            let grouped: f64 = parameter.grouped.iter().map(|(factor, inertial)| factor * value(inertial)).sum();
            let (leading, sum) = (&parameter.leading, value(&parameter.leading) + grouped);
            match leading.joint {
                Some(joint) => {
                    let mut ten = bare.parameters(joint);
                    ten[leading.number] = sum;
                    bare.set_parameters(joint, &ten);
                }
                None => {
                    let mut ten = bare.base.parameters();
                    ten[leading.number] = sum;
                    bare.base = darm_core::tree::Body::from_parameters(&ten);
                }
            }
        }
        let state: [[f64; 8]; 3] = std::array::from_fn(|k| std::array::from_fn(|j| ((7 * k + 3 * j) as f64).sin()));
        let base = darm_core::dynamics::floating::BaseMotion {
            pose: Pose::new(&Vec3::new(0.4, -0.3, 0.8), Vec3::zeros()),
            twist: darm_core::se::Twist { angular: Vec3::new(0.3, 0.2, -0.5), linear: Vec3::new(0.1, 0.9, 0.4) },
            twist_rate: darm_core::se::Twist { angular: Vec3::new(1.0, 0.6, 0.2), linear: Vec3::new(-1.0, 0.3, 2.0) },
        };
        let still = darm_core::dynamics::floating::BaseMotion {
            pose: Pose::identity(),
            twist: darm_core::se::Twist::zero(),
            twist_rate: darm_core::se::Twist::zero(),
        };
        let base = if robot.floating { base } else { still };
        let [q, qd, qdd] = &state;
        let torques = |tree: &Tree<f64, 8>| {
            let (load, torques) = darm_core::dynamics::floating::inverse_dynamics(tree, &base, [q, qd, qdd], None);
            let on_base = load.moment.iter().chain(load.force.iter()).take(if robot.floating { 6 } else { 0 });
            on_base.chain(&torques).copied().collect::<Vec<_>>()
        };
        near(&torques(&bare), &torques(&whole), 1e-8);
    }
}

/// A free base bears nothing, and each joint the torque that drives it.
#[test]
fn what_torques_do_takes_those_torques() {
    let mut robot = puma();
    robot.floating = true;
    let about_com = nalgebra::Matrix3::from_diagonal(&Vec3::new(1.0, 0.8, 0.9));
    robot.base = darm_core::tree::Inertia { mass: 20.0, com: Vec3::new(0.1, 0.2, -0.1), about_com };
    let of = |k: usize| -> Vec<f64> { (0..6).map(|j| ((7 * k + 3 * j) as f64).sin()).collect() };
    let (q, qd, torque) = (of(0), of(1), of(2));
    let tool = robot.tool().unwrap();
    let load = Wrench { moment: Vec3::new(1.0, -2.0, 3.0), force: Vec3::new(-20.0, 10.0, 30.0) };
    let at_rest = Motion { state: [&q, &qd, &[]], load: Some((tool, load)) };
    let found = robot.accelerations(&at_rest, &torque).unwrap().unwrap();
    let base = darm_core::dynamics::floating::BaseMotion {
        pose: Pose::identity(),
        twist: darm_core::se::Twist::zero(),
        twist_rate: found.base.unwrap(),
    };
    let tree = robot.tree::<6>().unwrap();
    let [q, qd, qdd]: [[f64; 6]; 3] = [q, qd, found.joints].map(|list| list.try_into().unwrap());
    let mut frames = darm_core::tree::Frames::default();
    tree.place(&q, &mut frames);
    let at = frames.pose(&tool.in_tree(&tree));
    let on_link = Wrench { moment: at.rotation.tr_mul(&load.moment), force: at.rotation.tr_mul(&load.force) };
    let moment = on_link.moment + tool.pose.position.cross(&(tool.pose.rotation * on_link.force));
    assert_eq!(tool.pose.rotation, nalgebra::Matrix3::identity());
    let mut loads = [Wrench::zero(); 6];
    loads[5] = Wrench { moment, force: on_link.force };
    let (left, torques) = darm_core::dynamics::floating::inverse_dynamics(&tree, &base, [&q, &qd, &qdd], Some(&loads));
    near(left.moment.as_slice(), &[0.0; 3], 1e-11);
    near(left.force.as_slice(), &[0.0; 3], 1e-11);
    near(&torques, &torque, 1e-11);
}

/// Energy rises by m g h when the base is raised, whatever the joints do: its centre is that of the whole robot.
#[test]
fn a_floating_base_has_potential_energy() {
    let mut robot = puma();
    robot.base = darm_core::tree::Inertia { mass: 20.0, com: Vec3::new(0.1, 0.2, -0.1), ..robot.base };
    let q = [0.3, 0.8, -1.2, 0.5, 0.9, -0.4];
    let energy = |robot: &Robot| robot.dynamics(&Motion { state: [&q, &[], &[]], load: None }).unwrap().potential_j;
    let links = energy(&robot);
    robot.floating = true;
    assert!((energy(&robot) - links - 20.0 * 9.81 * -0.1).abs() < 1e-9);
    let com = robot.com(&q).unwrap();
    assert!((energy(&robot) + com.mass_kg * com.position.dot(&robot.gravity)).abs() < 1e-9);
}

#[test]
fn inverse_kinematics_meets_its_own_poses_and_tells_what_is_out_of_reach() {
    let robot = puma();
    let tool = robot.tool().unwrap();
    let target = robot.kinematics(tool, &[0.3, 0.8, -1.2, 0.5, 0.9, -0.4]).unwrap().pose_base_frame;
    for method in [Method::LevenbergMarquardt, Method::Inverse, Method::PseudoInverse, Method::DampedLeastSquares] {
        let found =
            robot.inverse(method, tool, &target, &[0.2, 0.7, -1.1, 0.4, 0.8, -0.3], &Options::default()).unwrap();
        assert_eq!(found.status, Status::Reached, "{method}");
        let back = robot.kinematics(tool, &found.q).unwrap().pose_base_frame;
        assert!((back.position - target.position).norm() < 1e-5, "{method}");
        assert!(found.history.len() == found.steps + 1 && found.q.len() == 6);
    }
    let far = Pose::at(Vec3::new(5.0, 0.0, 0.0));
    let found = robot.inverse(Method::LevenbergMarquardt, tool, &far, &[0.1; 6], &Options::default()).unwrap();
    assert_eq!(found.status, Status::OutOfReach);
}
