//! A humanoid on a floating base.

use crate::dynamics_golden::check::{Check, F64, numbers};
use crate::dynamics_golden::file::{
    angular_first, array, flat, golden, gravity, inertia, joint, list, placement, pose,
};
use darm_core::dynamics;
use darm_core::dynamics::floating;
use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist, Wrench};
use darm_core::tree::{Body, Frames, Joint, Tree, singular};
use serde_json::Value;
use std::array::from_fn;

/// Joints of the humanoid without its base.
const HUMANOID: usize = 29;

fn humanoid(file: &Value) -> Tree<f64, HUMANOID> {
    let joints: [Joint<f64>; HUMANOID] = from_fn(|k| joint(&file["joints"][k + 1], 1));
    let mut tree = Tree::new(&joints, gravity(file)).expect("a tree");
    tree.base = Body::from(&inertia(&file["joints"][0]["link"]));
    tree
}

fn base_motion(sample: &Value) -> floating::BaseMotion<f64> {
    let [q, qd, qdd] = ["q", "qd", "qdd"].map(|key| list(&sample[key]));
    let six = |x: &[f64]| Twist { angular: Vec3::new(x[3], x[4], x[5]), linear: Vec3::new(x[0], x[1], x[2]) };
    let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[6], q[3], q[4], q[5]));
    let pose = Pose { rotation: turn.to_rotation_matrix().into_inner(), position: Vec3::new(q[0], q[1], q[2]) };
    floating::BaseMotion { pose, twist: six(&qd), twist_rate: six(&qdd) }
}

/// The base's load with its linear part first, then the torques, as the golden file has them.
fn with_load((load, torques): &(Wrench<f64>, [f64; HUMANOID])) -> Vec<f64> {
    load.force.iter().chain(load.moment.iter()).chain(torques).copied().collect()
}

#[test]
fn humanoid_on_a_floating_base() {
    let file = golden("simple_humanoid_floating");
    let tree = humanoid(&file);
    for (number, sample) in file["samples"].as_array().expect("samples").iter().enumerate() {
        let place = format!("humanoid, sample {number}");
        let check = Check { place: &place, part: F64 };
        let base = base_motion(sample);
        let q: [f64; HUMANOID] = list(&sample["q"])[7..].try_into().expect("29 joints");
        let [qd, qdd]: [[f64; HUMANOID]; 2] =
            ["qd", "qdd"].map(|key| list(&sample[key])[6..].try_into().expect("29 joints"));
        let mut frames = Frames::default();
        tree.place_floating(&base.pose, &q, &mut frames);
        let tau = floating::inverse_dynamics(&tree, &base, [&q, &qd, &qdd], None);
        check.near("tau", with_load(&tau), &list(&sample["tau_rnea"]), 0.0);
        let at_rest = [0.0; HUMANOID];
        let steady =
            floating::BaseMotion { twist_rate: Twist { angular: Vec3::zeros(), linear: Vec3::zeros() }, ..base };
        let bias = floating::inverse_dynamics(&tree, &steady, [&q, &qd, &at_rest], None);
        check.near("bias", with_load(&bias), &list(&sample["nle"]), 0.0);
        check.near("G", with_load(&floating::gravity(&tree, &frames)), &list(&sample["gravity"]), 0.0);
        check_floating_motion(&tree, &base, [&q, &qd, &qdd], sample, &check);
        check_floating_mass(&tree, &frames, &q, sample, &check);
        check_floating_com(&tree, &frames, &base, &qd, sample, &check);
        check_limbs(&file, &tree, &frames, &base, sample, &check);
    }
}

/// The torques of a motion bring that motion about: to 4 ε of the condition of the whole mass matrix, as in a fixed tree.
fn check_floating_motion(
    tree: &Tree<f64, HUMANOID>,
    base: &floating::BaseMotion<f64>,
    [q, qd, qdd]: [&[f64; HUMANOID]; 3],
    sample: &Value,
    check: &Check<'_>,
) {
    const ALL: usize = HUMANOID + 6;
    let tau = list(&sample["tau_rnea"]);
    let on_base = Wrench { moment: Vec3::new(tau[3], tau[4], tau[5]), force: Vec3::new(tau[0], tau[1], tau[2]) };
    let torque = array::<HUMANOID>(&Value::from(tau[6..].to_vec()));
    let (rate, joints) =
        floating::forward_dynamics(tree, (&base.pose, &base.twist), [q, qd, &torque], &on_base, None).expect("mass");
    let mut frames = Frames::default();
    tree.place_floating(&base.pose, q, &mut frames);
    let mass = floating::mass(tree, &frames, q);
    let mut all = nalgebra::SMatrix::<f64, ALL, ALL>::zeros();
    all.fixed_view_mut::<6, 6>(0, 0).copy_from(&mass.base);
    all.fixed_view_mut::<6, HUMANOID>(0, 6).copy_from(&mass.coupling);
    all.fixed_view_mut::<HUMANOID, 6>(6, 0).copy_from(&mass.coupling.transpose());
    all.fixed_view_mut::<HUMANOID, HUMANOID>(6, 6).copy_from(&mass.joints);
    let values = singular::singular_values(&all);
    let loose = Check { place: check.place, part: 4.0 * f64::EPSILON * values[0] / values[ALL - 1] + F64 };
    let expected: Vec<f64> = base.twist_rate.to_vector().iter().chain(qdd).copied().collect();
    loose.near("motion", rate.to_vector().iter().copied().chain(joints), &expected, 0.0);
}

fn check_floating_mass(
    tree: &Tree<f64, HUMANOID>,
    frames: &Frames<f64, HUMANOID>,
    q: &[f64; HUMANOID],
    sample: &Value,
    check: &Check<'_>,
) {
    let mass = floating::mass(tree, frames, q);
    let reorder = [3, 4, 5, 0, 1, 2];
    let ours = reorder.iter().flat_map(|row| {
        let base = reorder.iter().map(|column| mass.base[(*row, *column)]);
        let joints = (0..HUMANOID).map(|column| mass.coupling[(*row, column)]);
        base.chain(joints).collect::<Vec<_>>()
    });
    check.near("M, first rows", ours, &flat(&sample["M_diag_and_first6rows"][1]), 0.0);
    let diagonal = list(&sample["M_diag_and_first6rows"][0]);
    check.near("M, diagonal", (0..HUMANOID).map(|k| mass.joints[(k, k)]), &diagonal[6..], 0.0);
}

fn check_floating_com(
    tree: &Tree<f64, HUMANOID>,
    frames: &Frames<f64, HUMANOID>,
    base: &floating::BaseMotion<f64>,
    qd: &[f64; HUMANOID],
    sample: &Value,
    check: &Check<'_>,
) {
    let com = floating::com_jacobian(tree, frames);
    check.near("com", com.position.iter().copied(), &list(&sample["com"]), 1.0);
    let ours = (0..3).flat_map(|row| {
        let base = [3, 4, 5, 0, 1, 2].map(|column| com.base[(row, column)]);
        base.into_iter().chain((0..HUMANOID).map(move |column| com.joints[(row, column)])).collect::<Vec<_>>()
    });
    check.near("J com", ours, &flat(&sample["J_com"]), 0.0);
    let velocity = com.base * base.twist.to_vector() + com.joints * nalgebra::SVector::from(*qd);
    check.near("v com", velocity.iter().copied(), &list(&sample["com_velocity"]), 1.0);
    let axes = base.pose.rotation;
    let moving = Twist { angular: axes * base.twist.angular, linear: axes * base.twist.linear };
    let momentum = dynamics::momentum(tree, frames, &moving, qd);
    let ours = momentum.linear.iter().chain(momentum.angular.iter()).copied();
    check.near("momentum", ours, &list(&sample["centroidal_momentum"]), 0.0);
}

fn check_limbs(
    file: &Value,
    tree: &Tree<f64, HUMANOID>,
    frames: &Frames<f64, HUMANOID>,
    base: &floating::BaseMotion<f64>,
    sample: &Value,
    check: &Check<'_>,
) {
    for (name, limb) in file["frames"].as_object().expect("frames") {
        let link = limb["parent"].as_u64().expect("a link") as usize - 1;
        let frame = tree.frame(link, &placement(limb));
        let expected = pose(&sample["frames"][name]["T"]);
        check.near(name, numbers(&frames.pose(&frame)), &numbers(&expected), 1.0);
        let jacobian = tree.jacobian_base(&frame, frames);
        let axes = base.pose.rotation;
        let away = expected.position - base.pose.position;
        let ours = (0..6).flat_map(|row| {
            let linear = (0..3).map(|k| if row < 3 { 0.0 } else { axes[(row - 3, k)] }).collect::<Vec<_>>();
            let angular = (0..3).map(|k| {
                let axis = Vec3::from(axes.column(k));
                if row < 3 { axis[row] } else { axis.cross(&away)[row - 3] }
            });
            let joints = (0..HUMANOID).map(|column| jacobian[(row, column)]);
            linear.into_iter().chain(angular).chain(joints).collect::<Vec<_>>()
        });
        check.near(name, ours, &angular_first(&sample["frames"][name]["J_world_aligned"]), 1.0);
    }
}
