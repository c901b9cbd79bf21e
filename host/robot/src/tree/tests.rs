//! Trees of any size against the core's trees of fixed size, and a chain longer than any of those.

use std::path::{Path, PathBuf};

use darm_core::dynamics::{self, floating};
use darm_core::se::Twist;
use darm_core::tree::{Frames, Tree};
use nalgebra::DMatrix;

use super::*;
use crate::robot::{Motion as JointMotion, Robot};
use crate::urdf::{Locks, read};

const N: usize = 32;

fn humanoid() -> Robot {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../tests/data/urdf/simple_humanoid.urdf"].iter().collect();
    let mut robot = read(&path, &Locks::new()).unwrap();
    robot.floating = true;
    robot
}

fn state() -> [[f64; N]; 3] {
    std::array::from_fn(|k| std::array::from_fn(|j| ((7 * k + 3 * j) as f64).sin()))
}

#[track_caller]
fn near<'a>(ours: impl IntoIterator<Item = &'a f64>, theirs: impl IntoIterator<Item = &'a f64>) {
    let (ours, theirs): (Vec<f64>, Vec<f64>) =
        (ours.into_iter().copied().collect(), theirs.into_iter().copied().collect());
    assert_eq!(ours.len(), theirs.len());
    let scale = theirs.iter().fold(1.0, |scale: f64, x| scale.max(x.abs()));
    ours.iter().zip(&theirs).for_each(|(a, b)| assert!((a - b).abs() <= 1e-12 * scale, "{a} is not {b}"));
}

fn base() -> floating::BaseMotion<f64> {
    floating::BaseMotion {
        pose: Pose::new(&Vec3::new(0.4, -0.3, 0.8), Vec3::new(0.5, -2.0, 1.0)),
        twist: Twist { angular: Vec3::new(0.3, 0.2, -0.5), linear: Vec3::new(0.1, 0.9, 0.4) },
        twist_rate: Twist { angular: Vec3::new(1.0, 0.6, 0.2), linear: Vec3::new(-1.0, 0.3, 2.0) },
    }
}

/// The same tree in the core's numbers, its links placed on the base.
fn core_tree(robot: &Robot, base: &Pose<f64>, q: &[f64; N]) -> (Tree<f64, N>, Frames<f64, N>) {
    let (tree, mut frames) = (robot.tree::<N>().unwrap(), Frames::default());
    tree.place_floating(base, q, &mut frames);
    (tree, frames)
}

#[test]
fn poses_and_jacobians_are_those_of_the_core() {
    let (robot, [q, ..], base) = (humanoid(), state(), base());
    let n = robot.joints.len();
    let (expected, frames) = core_tree(&robot, &base.pose, &q);
    let tree = robot.link_tree().unwrap();
    let links = tree.place(&base.pose, &q);
    for frame in &robot.frames {
        let theirs = frame.in_tree(&expected);
        let (a, b) = (links.pose(frame.joint, &frame.pose), frames.pose(&theirs));
        near(a.position.iter().chain(a.rotation.iter()), b.position.iter().chain(b.rotation.iter()));
        let jacobian = expected.jacobian_base(&theirs, &frames);
        near(&tree.jacobian(&links, frame.joint, &frame.pose), jacobian.columns(0, n).iter());
    }
}

#[test]
fn floating_dynamics_are_those_of_the_core() {
    let (robot, [q, qd, qdd], base) = (humanoid(), state(), base());
    let n = robot.joints.len();
    let (expected, frames) = core_tree(&robot, &base.pose, &q);
    let tree = robot.link_tree().unwrap();
    let links = tree.place(&base.pose, &q);
    let screws = links.base_screws();
    let motion =
        Motion { velocity: screws * base.twist.to_vector(), acceleration: screws * base.twist_rate.to_vector() };
    let (wrench, torques) = tree.inverse_dynamics(&links, &motion, [&qd, &qdd]);
    let (load, theirs) = floating::inverse_dynamics(&expected, &base, [&q, &qd, &qdd], None);
    near(&screws.tr_mul(&wrench), load.moment.iter().chain(load.force.iter()));
    near(&torques, &theirs[..n]);
    let (mass, theirs) = (tree.mass_matrix(&links), floating::mass(&expected, &frames, &q));
    near(&(screws.tr_mul(&mass.base) * screws), &theirs.base);
    near(&screws.tr_mul(&mass.coupling), theirs.coupling.columns(0, n).iter());
    near(&mass.joints, theirs.joints.view((0, 0), (n, n)).iter());
    let (com, theirs) = (tree.centre_of_mass(&links, true), floating::com_jacobian(&expected, &frames));
    near(&com.position, &theirs.position);
    near(&com.joints, theirs.joints.columns(0, n).iter());
}

#[test]
fn dynamics_on_a_fixed_base_are_those_of_the_core() {
    let (mut robot, [q, qd, qdd]) = (humanoid(), state());
    robot.floating = false;
    let n = robot.joints.len();
    let (expected, frames) = core_tree(&robot, &Pose::identity(), &q);
    let ours = robot.dynamics(&JointMotion { state: [&q[..n], &qd[..n], &qdd[..n]], load: None }).unwrap();
    let square = |matrix: &nalgebra::SMatrix<f64, N, N>| DMatrix::from_fn(n, n, |a, b| matrix[(a, b)]);
    near(&ours.torque, &dynamics::inverse_dynamics(&expected, &q, &qd, &qdd, None)[..n]);
    near(&ours.coriolis, &square(&dynamics::coriolis_matrix(&expected, &frames, &qd)));
    near(&ours.velocity_torque, &dynamics::velocity_torque(&expected, &q, &qd)[..n]);
    near(&ours.gravity, &dynamics::gravity(&expected, &frames)[..n]);
    let [kinetic, potential] =
        [dynamics::kinetic_energy(&expected, &frames, &qd), dynamics::potential_energy(&expected, &frames)];
    near(&[ours.kinetic_j, ours.potential_j], &[kinetic, potential]);
}

/// A hundred joints about z, 10 mm apart, in a URDF.
#[test]
fn a_chain_of_a_hundred_joints_bends_and_weighs() {
    const JOINTS: usize = 100;
    let link = |k: usize| {
        format!(
            "<link name=\"l{k}\"><inertial><mass value=\"0.1\"/><inertia ixx=\"1e-6\" ixy=\"0\" ixz=\"0\" iyy=\"1e-6\" iyz=\"0\" izz=\"1e-6\"/></inertial></link>"
        )
    };
    let joint = |k: usize| {
        format!(
            "<joint name=\"j{k}\" type=\"continuous\"><origin xyz=\"{} 0 0\"/><parent link=\"l{}\"/><child link=\"l{k}\"/><axis xyz=\"0 1 0\"/></joint>",
            if k == 1 { 0.0 } else { 0.01 },
            k - 1
        )
    };
    let body: String = (1..=JOINTS).map(|k| link(k) + &joint(k)).collect();
    let text = format!("<robot name=\"snake\"><link name=\"l0\"/>{body}</robot>");
    let robot = crate::urdf::parse(Path::new("snake.urdf"), &text, &Locks::new()).unwrap();
    let tip = robot.frame("l100").unwrap();
    let bend = [std::f64::consts::TAU / JOINTS as f64; JOINTS];
    let closed = robot.kinematics(tip, &bend).unwrap().pose_base_frame.position;
    // 99 of the hundred equal steps of a closed polygon: the last step is missing, whatever its direction.
    assert!((closed.norm() - 0.01).abs() < 1e-12, "{closed}");
    let straight = robot.dynamics(&JointMotion { state: [&[0.0; JOINTS], &[], &[]], load: None }).unwrap();
    let expected = -0.1 * 9.81 * 0.01 * (0..JOINTS).sum::<usize>() as f64;
    assert!((straight.gravity[0] - expected).abs() < 1e-9, "{} {expected}", straight.gravity[0]);
    let near_base = robot.frame("l20").unwrap();
    let target = robot.kinematics(near_base, &bend).unwrap().pose_base_frame;
    let options = crate::ik::Options { orientation_rad: f64::INFINITY, ..Default::default() };
    let found =
        robot.inverse(crate::ik::Method::LevenbergMarquardt, near_base, &target, &[0.05; JOINTS], &options).unwrap();
    assert_eq!((found.status, found.q.len(), found.q[60]), (crate::ik::Status::Reached, JOINTS, 0.05));
    let there = robot.kinematics(near_base, &found.q).unwrap().pose_base_frame.position;
    assert!((there - target.position).norm() < 1e-5);
    let target = robot.kinematics(tip, &bend).unwrap().pose_base_frame;
    let far = robot.inverse(crate::ik::Method::LevenbergMarquardt, tip, &target, &[0.05; JOINTS], &options).unwrap();
    assert_eq!((far.status, far.q.len()), (crate::ik::Status::Reached, JOINTS));
}
