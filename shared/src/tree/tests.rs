//! Arms whose closed forms the lecture prints, and what makes a tree.

extern crate std;

use core::f64::consts::FRAC_PI_2;

use super::*;
use crate::se::Wrench;
use crate::tree::dh::Row;
use crate::tree::jacobian::{statics, twist};
use crate::tree::singular::{distance_to_singularity, force_ellipsoid, manipulability, rank, rows};

/// The planar robot of the lecture, with its last frame at the tip.
fn planar(l1: f64, l2: f64) -> (Tree<f64, 2>, LinkFrame<f64>) {
    let upper = Joint::revolute(None, Vec3::z(), Pose::identity(), Inertia::none());
    let lower = Joint::revolute(Some(0), Vec3::z(), Pose::at(Vec3::new(l1, 0.0, 0.0)), Inertia::none());
    let tree = Tree::new(&[upper, lower], Vec3::zeros()).unwrap();
    let tip = tree.frame(1, &Pose::at(Vec3::new(l2, 0.0, 0.0)));
    (tree, tip)
}

fn placed<const N: usize>(tree: &Tree<f64, N>, q: &[f64; N]) -> Frames<f64, N> {
    let mut frames = Frames::default();
    tree.place(q, &mut frames);
    frames
}

#[test]
fn planar_jacobian_is_the_lectures() {
    let (l1, l2) = (0.7, 0.4);
    let (tree, tip) = planar(l1, l2);
    for (a, b) in [(0.3, 0.9), (-2.0, 0.1), (1.0, -2.5)] {
        let jacobian = tree.jacobian_base(&tip, &placed(&tree, &[a, b]));
        let (s1, c1, s12, c12) = (f64::sin(a), f64::cos(a), f64::sin(a + b), f64::cos(a + b));
        let lecture = [[-l1 * s1 - l2 * s12, l1 * c1 + l2 * c12], [-l2 * s12, l2 * c12]];
        for (column, [x, y]) in jacobian.data.0.iter().zip(lecture) {
            let [wx, wy, wz, vx, vy, vz] = *column;
            assert_eq!([wx, wy, wz, vz], [0.0, 0.0, 1.0, 0.0]);
            assert!((vx - x).abs() < 1e-15 && (vy - y).abs() < 1e-15);
        }
    }
}

/// "What happens if both angles are 0?": the tip cannot move along the arm, and no torque holds a force along it.
#[test]
fn stretched_out_is_singular() {
    let (tree, tip) = planar(0.7, 0.4);
    let full = tree.jacobian_base(&tip, &placed(&tree, &[0.0, 0.0]));
    let jacobian = rows(&full, &[3, 4]);
    assert_eq!(rank(&jacobian, 1e-12), 1);
    assert!(manipulability(&jacobian) < 1e-15 && distance_to_singularity(&jacobian) < 1e-15);
    let pull = Wrench { moment: Vec3::zeros(), force: Vec3::new(100.0, 0.0, 0.0) };
    assert!(statics(&full, &pull).iter().all(|torque| torque.abs() < 1e-12));
    let bent = rows(&tree.jacobian_base(&tip, &placed(&tree, &[0.4, 1.1])), &[3, 4]);
    assert!((manipulability(&bent) - 0.7 * 0.4 * f64::sin(1.1)).abs() < 1e-15);
    let (motion, force) = (singular::singular_values(&bent), force_ellipsoid(&bent).lengths);
    assert!((motion[0] * force[1] - 1.0).abs() < 1e-14 && (motion[1] * force[0] - 1.0).abs() < 1e-14);
}

/// The Puma 560 of the lecture in modified notation: (α, a, d) before each joint.
fn puma(a2: f64, a3: f64, d3: f64, d4: f64) -> Tree<f64, 6> {
    let table = [
        (0.0, 0.0, 0.0),
        (-FRAC_PI_2, 0.0, 0.0),
        (0.0, a2, d3),
        (-FRAC_PI_2, a3, d4),
        (FRAC_PI_2, 0.0, 0.0),
        (-FRAC_PI_2, 0.0, 0.0),
    ];
    let rows = table.map(|(alpha_rad, a_m, d_m)| Row {
        kind: JointKind::Revolute,
        theta_rad: 0.0,
        d_m,
        a_m,
        alpha_rad,
        inertia: Inertia::none(),
    });
    dh::modified(&rows, Vec3::zeros()).unwrap()
}

/// x, y and z of the wrist as the lecture prints them, with z as in Craig (3.14): −a₂·sin θ₂.
#[test]
fn puma_wrist_is_the_lectures() {
    let (a2, a3, d3, d4) = (0.4318, 0.0203, 0.1245, 0.4318);
    let tree = puma(a2, a3, d3, d4);
    for q in [[0.3, -0.7, 0.9, 1.0, -1.2, 0.4], [-2.0, 1.1, 2.5, -0.3, 0.8, 3.0]] {
        let wrist = placed(&tree, &q).pose(&tree.frame(5, &Pose::identity())).position;
        let [s1, s2, s23] = [q[0], q[1], q[1] + q[2]].map(f64::sin);
        let [c1, c2, c23] = [q[0], q[1], q[1] + q[2]].map(f64::cos);
        let ahead = a2 * c2 + a3 * c23 - d4 * s23;
        let lecture = Vec3::new(c1 * ahead - d3 * s1, s1 * ahead + d3 * c1, -a3 * s23 - a2 * s2 - d4 * c23);
        assert!((wrist - lecture).norm() < 1e-15, "{wrist} {lecture}");
    }
}

/// p, t and a of the lecture are the angles about z, the new y and the newest z. Its formulas are Craig's (3.14) with slips of
/// the pen: `s14s5` is s₁s₄s₅; in t the inner arc tangent is p; in a the numerator's c₄c₅s₆ has the sign + and its last
/// factor is s₆.
#[test]
fn puma_orientation_is_the_lectures() {
    let tree = puma(0.4318, 0.0203, 0.1245, 0.4318);
    for q in [[0.3, -0.7, 0.9, 1.0, -1.2, 0.4], [-2.0, 1.1, 2.5, -0.3, 0.8, 3.0]] {
        let rotation = placed(&tree, &q).pose(&tree.frame(5, &Pose::identity())).rotation;
        let [s1, s23, s4, s5, s6] = [q[0], q[1] + q[2], q[3], q[4], q[5]].map(f64::sin);
        let [c1, c23, c4, c5, c6] = [q[0], q[1] + q[2], q[3], q[4], q[5]].map(f64::cos);
        let across = c23 * c4 * s5 + s23 * c5;
        let p = (-(s1 * across - c1 * s4 * s5)).atan2(-(c1 * across + s1 * s4 * s5));
        let t = ((-s1 * across + c1 * s4 * s5) / p.sin()).atan2(s23 * c4 * s5 - c23 * c5);
        let a =
            (s23 * (s4 * c6 + c4 * c5 * s6) + c23 * s5 * s6).atan2(-(s23 * (s4 * s6 - c4 * c5 * c6) - c23 * s5 * c6));
        let about = |axis: Vec3<f64>, angle: f64| crate::se::rotation_exp(&(axis * angle));
        let lecture = about(Vec3::z(), p) * about(Vec3::y(), t) * about(Vec3::z(), a);
        assert!((rotation - lecture).norm() < 1e-14, "{rotation} {lecture}");
    }
}

#[test]
fn a_wrist_with_two_axes_in_line_is_singular() {
    let tree = puma(0.4318, 0.0203, 0.1245, 0.4318);
    let wrist = tree.frame(5, &Pose::identity());
    let rank_at = |bend: f64| {
        let frames = placed(&tree, &[0.3, -0.7, 0.9, 1.0, bend, 0.4]);
        rank(&tree.jacobian_tool(&wrist, &frames), 1e-9)
    };
    assert_eq!((rank_at(0.0), rank_at(0.5)), (5, 6));
}

/// Standard and modified notation of one arm differ in their frames alone.
#[test]
fn both_notations_move_alike() {
    let tree = puma(0.4, 0.02, 0.15, 0.43);
    let row = |alpha_rad, a_m, d_m| Row {
        kind: JointKind::Revolute,
        theta_rad: 0.0,
        d_m,
        a_m,
        alpha_rad,
        inertia: Inertia::none(),
    };
    let rows = [
        row(-FRAC_PI_2, 0.0, 0.0),
        row(0.0, 0.4, 0.0),
        row(-FRAC_PI_2, 0.02, 0.15),
        row(FRAC_PI_2, 0.0, 0.43),
        row(-FRAC_PI_2, 0.0, 0.0),
        row(0.0, 0.0, 0.0),
    ];
    let (standard, far_end) = dh::standard(&rows, Vec3::zeros()).unwrap();
    let q = [0.3, -0.7, 0.9, 1.0, -1.2, 0.4];
    let a = placed(&tree, &q).pose(&tree.frame(5, &Pose::identity()));
    let b = placed(&standard, &q).pose(&standard.frame(5, &far_end));
    assert!(a.distance(&b, 1.0) < 1e-14);
}

#[test]
fn a_sliding_joint_moves_its_link_along_its_axis() {
    let slide =
        Joint::prismatic(None, Vec3::x(), Pose::new(&Vec3::new(0.0, 0.0, FRAC_PI_2), Vec3::z()), Inertia::none());
    let tree = Tree::new(&[slide], Vec3::zeros()).unwrap();
    let link = tree.frame(0, &Pose::identity());
    let frames = placed(&tree, &[2.0]);
    assert!((frames.pose(&link).position - Vec3::new(0.0, 2.0, 1.0)).norm() < 1e-15);
    let v = twist(&tree.jacobian_base(&link, &frames), &[1.0]);
    assert!(v.angular.norm() == 0.0 && (v.linear - Vec3::y()).norm() < 1e-15);
}

#[test]
fn parents_come_first_and_axes_are_units() {
    let joint = |parent, axis| Joint::revolute(parent, axis, Pose::<f64>::identity(), Inertia::none());
    let first = joint(None, Vec3::z());
    let error = Tree::new(&[first, joint(Some(1), Vec3::z())], Vec3::zeros()).unwrap_err();
    assert_eq!(error, TreeError::Parent { joint: 1, parent: 1 });
    let error = Tree::new(&[first, joint(Some(0), Vec3::zeros())], Vec3::zeros()).unwrap_err();
    assert_eq!(error, TreeError::Axis { joint: 1, length: 0.0 });
}

#[test]
fn parallel_axis_of_a_rod() {
    // A rod of 3 kg and 2 m along x: m l²/12 about its middle, m l²/3 about its end.
    let about_com = Mat3::from_diagonal(&Vec3::new(0.0, 1.0, 1.0));
    let rod = Inertia { mass: 3.0, com: Vec3::new(1.0, 0.0, 0.0), about_com };
    assert_eq!(rod.about_origin().to_matrix(), Mat3::from_diagonal(&Vec3::new(0.0, 4.0, 4.0)));
    let half = |x: f64| Inertia { mass: 1.5, com: Vec3::new(x, 0.0, 0.0), about_com: about_com / 8.0 };
    assert_eq!(half(0.5).joined(&half(1.5)), rod);
}
