//! Reference values of Pinocchio 4.1.0 and Robotics Toolbox 1.5 (`data/golden/README.md`): kinematics and dynamics agree.
//!
//! In `f64` to 1e-12 of the largest entry. In `f32` to [`ROUNDINGS`] roundings a joint of the largest term that is summed:
//! on the way to any entry each joint adds a rotation by an angle that is itself rounded, and a handful of products.

mod check;
mod file;
mod humanoid;

use crate::dynamics_golden::check::{Check, F64, ROUNDINGS, by_rows, numbers};
use crate::dynamics_golden::file::{
    angular_first, array, column, flat, golden, gravity, joints, list, placement, pose, square,
};
use darm_core::actuator::JointKind;
use darm_core::real::{Real, Vec3, real, to_f32};
use darm_core::se::{Pose, Wrench};
use darm_core::tree::jacobian::{statics, twist};
use darm_core::tree::puma560::{NEAR_M, NEAR_NM, SAMPLE};
use darm_core::tree::{Frames, Inertia, Joint, LinkFrame, Tree, dh, puma560, singular};
use darm_core::{dynamics, ik};
use serde_json::Value;
use std::array::from_fn;

/// An arm in numbers of type `T` and the largest sizes that its sums run through.
struct Arm<T: Real, const N: usize> {
    tree: Tree<T, N>,
    tool: LinkFrame<T>,
    reach: f64,
}

impl<T: Real, const N: usize> Arm<T, N> {
    fn new(joints: &[Joint<f64>; N], tool: &Pose<f64>, gravity: &Vec3<f64>) -> Self {
        let reach = joints.iter().map(|joint| joint.placement.position.norm()).sum::<f64>() + tool.position.norm();
        let tree = Tree::new(&joints.map(|joint| joint.cast()), gravity.map(real)).expect("a tree");
        Self { tool: tree.frame(N - 1, &tool.cast()), tree, reach }
    }
}

fn numbers_of<T: Real, const N: usize>(sample: &Value, key: &str) -> [T; N] {
    array::<N>(&sample[key]).map(real)
}

fn kinematics<T: Real, const N: usize>(arm: &Arm<T, N>, sample: &Value, check: &Check<'_>) {
    let (q, qd) = (numbers_of(sample, "q"), numbers_of(sample, "qd"));
    let mut frames = Frames::default();
    arm.tree.place(&q, &mut frames);
    check.near("pose", numbers(&frames.pose(&arm.tool)), &numbers(&pose(&sample["T"])), 1.0 + arm.reach);
    check.near("pose alone", numbers(&arm.tree.pose(&arm.tool, &q)), &numbers(&pose(&sample["T"])), 1.0 + arm.reach);
    let jacobian = arm.tree.jacobian_base(&arm.tool, &frames);
    check.near("J", by_rows(&jacobian), &angular_first(&sample["J_world_aligned"]), 1.0 + arm.reach);
    let tool = arm.tree.jacobian_tool(&arm.tool, &frames);
    check.near("J tool", by_rows(&tool), &angular_first(&sample["J_body"]), 1.0 + arm.reach);
    let rate = arm.tree.jacobian_rate(&arm.tool, &qd, &frames);
    let speed = array::<N>(&sample["qd"]).iter().map(|x| x.abs()).sum::<f64>();
    check.near("J rate", by_rows(&rate), &angular_first(&sample["Jdot_world_aligned"]), speed * (1.0 + arm.reach));
    let v = list(&sample["ee_velocity"]);
    let moving = twist(&jacobian, &qd).to_vector();
    check.near("V", moving.iter().copied(), &[v[3], v[4], v[5], v[0], v[1], v[2]], speed * (1.0 + arm.reach));
    let linear = singular::rows(&jacobian, &[3, 4, 5]);
    let size = (1.0 + arm.reach).powi(3);
    if N >= 3 {
        check.near(
            "w of v",
            [singular::manipulability(&linear)],
            &[sample["manipulability_translation"].as_f64().unwrap_or(0.0)],
            size,
        );
    }
    if let Some(expected) = sample["manipulability"].as_f64() {
        let ours = if N >= 6 {
            singular::manipulability(&jacobian)
        } else {
            singular::manipulability(&singular::rows(&jacobian, &[3, 4]))
        };
        check.near("w", [ours], &[expected], size);
    }
}

fn forces<T: Real, const N: usize>(arm: &Arm<T, N>, sample: &Value, check: &Check<'_>) {
    let tree = &arm.tree;
    let [q, qd, qdd]: [[T; N]; 3] = ["q", "qd", "qdd"].map(|key| numbers_of(sample, key));
    let mut frames = Frames::default();
    tree.place(&q, &mut frames);
    let largest =
        |keys: &[&str]| keys.iter().flat_map(|key| list(&sample[*key])).fold(0.0, |most: f64, x| most.max(x.abs()));
    let torque = largest(&["tau_rnea", "gravity", "coriolis_times_qd"]).max(heaviest(arm));
    let tau = dynamics::inverse_dynamics(tree, &q, &qd, &qdd, None);
    check.near("tau", tau, &list(&sample["tau_rnea"]), torque);
    check.near("M", by_rows(&dynamics::mass_matrix(tree, &q)), &flat(&sample["M"]), 0.0);
    check.near("G", dynamics::gravity(tree, &frames), &list(&sample["gravity"]), torque);
    check.near("V", dynamics::velocity_torque(tree, &q, &qd), &list(&sample["coriolis_times_qd"]), torque);
    let coriolis = dynamics::coriolis_matrix(tree, &frames, &qd) * nalgebra::SVector::from(qd);
    check.near("C qd", coriolis.iter().copied(), &list(&sample["coriolis_times_qd"]), torque);
    let kinetic = sample["kinetic_energy"].as_f64().expect("an energy");
    check.near("kinetic", [dynamics::kinetic_energy(tree, &frames, &qd)], &[kinetic], 0.0);
    let potential = sample["potential_energy"].as_f64().expect("an energy");
    check.near("potential", [dynamics::potential_energy(tree, &frames)], &[potential], torque);
    let (com, jacobian) = dynamics::com_jacobian(tree, &frames);
    check.near("com", com.iter().copied(), &list(&sample["com"]), arm.reach);
    check.near("com", dynamics::center_of_mass(tree, &frames).1.iter().copied(), &list(&sample["com"]), arm.reach);
    check.near("J com", by_rows(&jacobian), &flat(&sample["J_com"]), arm.reach);
    let w = list(&sample["ee_wrench_world_aligned"]);
    let load = Wrench { moment: Vec3::new(w[3], w[4], w[5]).map(real), force: Vec3::new(w[0], w[1], w[2]).map(real) };
    let by_load = statics(&tree.jacobian_base(&arm.tool, &frames), &load);
    let with: [T; N] = from_fn(|k| tau[k] - by_load[k]);
    check.near("tau with load", with, &list(&sample["tau_rnea_with_wrench"]), torque + 20.0 * (1.0 + arm.reach));
}

/// A torque that no entry of the sums exceeds by much: all weight at the whole reach.
fn heaviest<T: Real, const N: usize>(arm: &Arm<T, N>) -> f64 {
    let mass: f64 = arm.tree.links.iter().map(|link| nalgebra::convert_unchecked::<T, f64>(link.body.mass)).sum();
    9.81 * mass * arm.reach
}

fn regressor<const N: usize>(arm: &Arm<f64, N>, file: &Value, sample: &Value, check: &Check<'_>) {
    let tree = &arm.tree;
    let [q, qd, qdd]: [[f64; N]; 3] = ["q", "qd", "qdd"].map(|key| numbers_of(sample, key));
    let mut frames = Frames::default();
    tree.place(&q, &mut frames);
    let mut y = [[[0.0; 10]; N]; N];
    dynamics::regressor(tree, &frames, [&q, &qd, &qdd], &mut y);
    check.near("Y", y.iter().flatten().flatten().copied(), &flat(&sample["torque_regressor"]), 0.0);
    let phi: [[f64; 10]; N] = from_fn(|k| tree.parameters(k));
    check.near("phi", phi.iter().flatten().copied(), &list(&file["phi"]), 0.0);
    check.near("Y phi", dynamics::torque_of(&y, &phi), &list(&sample["tau_rnea"]), heaviest(arm));
}

/// A tool's load given to the recursion itself, and the motion of given torques: ill-conditioned, so in `f64` alone.
fn loads_and_motion<const N: usize>(arm: &Arm<f64, N>, tool: &Pose<f64>, sample: &Value, check: &Check<'_>) {
    let tree = &arm.tree;
    let [q, qd, qdd]: [[f64; N]; 3] = ["q", "qd", "qdd"].map(|key| numbers_of(sample, key));
    let w = list(&sample["ee_wrench_world_aligned"]);
    let axes = pose(&sample["T"]).rotation;
    let force = tool.rotation * axes.tr_mul(&Vec3::new(w[0], w[1], w[2]));
    let moment = tool.rotation * axes.tr_mul(&Vec3::new(w[3], w[4], w[5])) + tool.position.cross(&force);
    let mut loads = [Wrench::zero(); N];
    loads[N - 1] = Wrench { moment, force };
    let tau = dynamics::inverse_dynamics(tree, &q, &qd, &qdd, Some(&loads));
    check.near("tau with load", tau, &list(&sample["tau_rnea_with_wrench"]), heaviest(arm) + 20.0 * (1.0 + arm.reach));
    let torque = array::<N>(&sample["tau_fd"]);
    let accelerations = dynamics::forward_dynamics(tree, &q, &qd, &torque).expect("a regular mass matrix");
    let wanted = dynamics::inverse_dynamics(tree, &q, &qd, &accelerations, None);
    check.near("forward and back", wanted, &torque, heaviest(arm));
    let mut frames = Frames::default();
    tree.place(&q, &mut frames);
    let values = singular::singular_values(&dynamics::mass_matrix(tree, &q));
    let condition = values[0] / values[N - 1];
    let loose = Check { place: check.place, part: 4.0 * f64::EPSILON * condition + F64 };
    loose.near("qdd", accelerations, &list(&sample["qdd_aba"]), 0.0);
    let articulated = dynamics::articulated_dynamics(tree, [&q, &qd, &torque]).expect("every joint moves mass");
    loose.near("qdd by articulated bodies", articulated, &list(&sample["qdd_aba"]), 0.0);
}

fn check_arm<const N: usize>(name: &str) {
    let file = golden(name);
    let tool = placement(&file["ee"]);
    let joints = joints::<N>(&file);
    let exact = Arm::<f64, N>::new(&joints, &tool, &gravity(&file));
    let single = Arm::<f32, N>::new(&joints, &tool, &gravity(&file));
    for (number, sample) in file["samples"].as_array().expect("samples").iter().enumerate() {
        let place = format!("{name}, sample {number}, f64");
        let check = Check { place: &place, part: F64 };
        kinematics(&exact, sample, &check);
        forces(&exact, sample, &check);
        regressor(&exact, &file, sample, &check);
        loads_and_motion(&exact, &tool, sample, &check);
        let place = format!("{name}, sample {number}, f32");
        let check = Check { place: &place, part: ROUNDINGS * N as f64 * f64::from(f32::EPSILON) };
        kinematics(&single, sample, &check);
        forces(&single, sample, &check);
    }
}

/// The values that the doctest of the Puma 560 and the chip's image have too.
fn check_sample<T: Real>(near_m: f64, near_nm: f64) {
    let (tree, tool) = puma560::arm::<T>().expect("the Puma is an arm");
    let [q, qd, qdd] = [SAMPLE.q, SAMPLE.qd, SAMPLE.qdd].map(|row| row.map(real::<T>));
    let away = tree.pose(&tool, &q).position - SAMPLE.tool().map(real);
    assert!(to_f32(away.norm()) < near_m as f32, "{away}");
    let torques = dynamics::inverse_dynamics(&tree, &q, &qd, &qdd, None);
    let off = torques.iter().zip(&SAMPLE.torque).map(|(ours, theirs)| to_f32((*ours - real(*theirs)).abs()));
    assert!(off.clone().all(|off| off < near_nm as f32), "{:?}", off.collect::<Vec<_>>());
}

#[test]
fn the_sample_of_the_puma_in_both_precisions() {
    check_sample::<f64>(1e-11, 1e-9);
    check_sample::<f32>(NEAR_M, NEAR_NM);
}

#[test]
fn planar_arms() {
    check_arm::<2>("planar2r");
    check_arm::<4>("planar4r");
}

#[test]
fn arms_with_prismatic_joints() {
    check_arm::<4>("scara_dh");
    check_arm::<6>("stanford_dh");
}

#[test]
fn industrial_arms() {
    check_arm::<6>("puma560_dh");
    check_arm::<6>("puma560_mdh");
    check_arm::<6>("ur10_urdf");
}

#[test]
fn redundant_arms() {
    check_arm::<7>("panda_mdh");
    check_arm::<7>("panda_urdf");
}

fn row(value: &Value) -> dh::Row<f64> {
    let number = |key: &str| value[key].as_f64().expect("a number");
    let kind = if value["type"] == "R" { JointKind::Revolute } else { JointKind::Prismatic };
    let inertia = Inertia { mass: number("m"), com: column(&value["r"]), about_com: square(&value["I"]) };
    dh::Row {
        kind,
        theta_rad: number("theta"),
        d_m: number("d"),
        a_m: number("a"),
        alpha_rad: number("alpha"),
        inertia,
    }
}

fn check_table<const N: usize>(name: &str) {
    let file = golden(name);
    let rows: [dh::Row<f64>; N] = from_fn(|k| row(&file["dh_rows"][k]));
    let (tree, tool) = if file["dh_convention"] == "standard" {
        dh::standard(&rows, gravity(&file)).expect("a tree")
    } else {
        (dh::modified(&rows, gravity(&file)).expect("a tree"), Pose::identity())
    };
    let arm = Arm { tool: tree.frame(N - 1, &tool), tree, reach: 1.0 };
    for (number, sample) in file["samples"].as_array().expect("samples").iter().enumerate() {
        let place = format!("{name} by its table, sample {number}");
        kinematics(&arm, sample, &Check { place: &place, part: F64 });
        forces(&arm, sample, &Check { place: &place, part: F64 });
    }
}

#[test]
fn tables_of_denavit_and_hartenberg() {
    check_table::<2>("planar2r");
    check_table::<4>("planar4r");
    check_table::<4>("scara_dh");
    check_table::<6>("stanford_dh");
    check_table::<6>("puma560_dh");
    check_table::<6>("puma560_mdh");
    check_table::<7>("panda_mdh");
}

/// Success on the targets of `ik_targets_*`: each reached within the limits, to 1e-5 m and 1e-5 rad by forward kinematics.
fn check_targets<const N: usize>(name: &str) {
    let file = golden(name);
    let tree = Tree::new(&joints::<N>(&file), gravity(&file)).expect("a tree");
    let tool = tree.frame(N - 1, &placement(&file["ee"]));
    let targets = golden(&format!("ik_targets_{name}"));
    let [low, high] = [&targets["limits"][0], &targets["limits"][1]].map(array::<N>);
    let limits = from_fn(|joint| [low[joint], high[joint]]);
    let arm = ik::Arm { tree: &tree, tool: &tool, limits: &limits };
    let rows = targets["targets"].as_array().expect("targets");
    assert_eq!(rows.len(), 1000);
    for row in rows.iter().map(list) {
        let (start, six) = row.split_first_chunk::<N>().expect("a start");
        let target = Pose::new(&Vec3::from_column_slice(&six[..3]), Vec3::from_column_slice(&six[3..]));
        let found = ik::solve(&arm, &target, start, &ik::Options::default());
        let stands = tree.pose(&tool, &found.q).to(&target);
        assert_eq!(found.status, ik::Status::Reached, "{name} {row:?}: {found:?}");
        assert!(stands.position.norm() <= 1e-5 && stands.angle_rad() <= 1e-5, "{name} {row:?}");
        assert!(found.q.iter().zip(&limits).all(|(q, [low, high])| (low..=high).contains(&q)), "{name} {row:?}");
    }
}

#[test]
fn inverse_kinematics_reaches_every_target() {
    check_targets::<7>("panda_urdf");
    check_targets::<6>("ur10_urdf");
    check_targets::<6>("puma560_dh");
}
