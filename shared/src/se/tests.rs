//! Laws of the groups: exp and log are inverse, the adjoint is a representation, the distance is left invariant.

use core::f64::consts::PI;

use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;

use super::*;
use crate::arms::seeded;

fn vector(size: f64) -> impl Strategy<Value = Vec3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vec3::from)
}

fn twist() -> impl Strategy<Value = Twist<f64>> {
    (vector(1.8), vector(3.0)).prop_map(|(angular, linear)| Twist { angular, linear })
}

fn pose2() -> impl Strategy<Value = Pose2<f64>> {
    (-3.0..3.0, -3.0..3.0, -3.0..3.0).prop_map(|(x, y, angle)| Pose2::new(x, y, angle))
}

/// Entries of the products are of size ten at most: a hundred roundings.
const TOLERANCE: f64 = 1e-13;

fn close(a: &Pose<f64>, b: &Pose<f64>) -> bool {
    (a.rotation - b.rotation).norm() < TOLERANCE && (a.position - b.position).norm() < TOLERANCE
}

proptest! {
    #![proptest_config(seeded(256))]

    #[test]
    fn log_undoes_exp(v in twist()) {
        // |ω| ≤ 1.8·√3 = 3.12 < π, so that the least twist is the one given.
        prop_assert!((Pose::exp(&v).log() - v).size(1.0) < 1e-11);
    }

    #[test]
    fn log_undoes_exp_of_small_twists(v in twist(), exponent in -16.0..0.0) {
        let small = v * 10f64.powf(exponent);
        prop_assert!((Pose::exp(&small).log() - small).size(1.0) < TOLERANCE);
    }

    #[test]
    fn exp_undoes_log_near_a_half_turn(axis in vector(1.0), p in vector(2.0), short in -12.0..-1.0) {
        prop_assume!(axis.norm() > 1e-3);
        let w = axis.normalize() * (PI - 10f64.powf(short));
        let pose = Pose::new(&w, p);
        prop_assert!(close(&Pose::exp(&pose.log()), &pose));
        prop_assert!(pose.angle_rad() <= PI + 1e-15);
    }

    #[test]
    fn inverse_undoes(v in twist()) {
        let pose = Pose::exp(&v);
        prop_assert!(close(&(pose * pose.inverse()), &Pose::identity()));
        prop_assert!(close(&Pose::exp(&-v), &pose.inverse()));
    }

    #[test]
    fn adjoint_tells_a_motion_in_another_frame(v in twist(), w in twist()) {
        let pose = Pose::exp(&v);
        prop_assert!(close(&(pose * Pose::exp(&w) * pose.inverse()), &Pose::exp(&pose.adjoint(&w))));
        prop_assert!((pose.adjoint_inverse(&pose.adjoint(&w)) - w).size(1.0) < TOLERANCE);
    }

    #[test]
    fn power_is_the_same_in_both_frames(v in twist(), w in twist(), m in vector(1.0), f in vector(1.0)) {
        let (pose, load) = (Pose::exp(&v), Wrench { moment: m, force: f });
        let here = pose.wrench_inverse(&load).power(&w);
        prop_assert!((here - load.power(&pose.adjoint(&w))).abs() < TOLERANCE);
    }

    #[test]
    fn distance_is_left_invariant(u in twist(), v in twist(), w in twist()) {
        let (g, a, b) = (Pose::exp(&u), Pose::exp(&v), Pose::exp(&w));
        prop_assert!((a.distance(&b, 0.5) - (g * a).distance(&(g * b), 0.5)).abs() < 1e-12);
        prop_assert!((a.distance(&b, 0.5) - b.distance(&a, 0.5)).abs() < 1e-12);
    }

    #[test]
    fn distance_in_the_plane_is_the_one_in_space(a in pose2(), b in pose2(), g in pose2()) {
        let plane = a.distance(&b, 0.5);
        prop_assert!((plane - Pose::from(a).distance(&b.into(), 0.5)).abs() < 1e-12);
        prop_assert!((plane - (g * a).distance(&(g * b), 0.5)).abs() < 1e-12);
    }

    #[test]
    fn motions_of_the_plane_are_those_of_space(a in pose2(), b in pose2()) {
        let (space_a, space_b) = (Pose::from(a), Pose::from(b));
        prop_assert!(close(&(a * b).into(), &(space_a * space_b)));
        prop_assert!(close(&a.inverse().into(), &space_a.inverse()));
        prop_assert!(close(&a.to(&b).into(), &space_a.to(&space_b)));
        prop_assert!(close(&Pose2::exp(&a.log()).into(), &space_a));
        prop_assert!(close(&Pose2::projection(&space_a).into(), &space_a));
        prop_assert!(space_a.is_planar() && (space_a * space_b).is_planar());
        let moved = a * Pose2::exp(&b.log()) * a.inverse();
        prop_assert!(close(&moved.into(), &Pose2::exp(&a.adjoint(&b.log())).into()));
    }

    #[test]
    fn rotation_jacobian_is_the_derivative(w in vector(1.5), turn in vector(1.0)) {
        // The error of a central difference of step h = 1e-5 is h²/6 of a third derivative of size one.
        let h = 1e-5;
        let (before, after) = (rotation_exp(&(w - turn * h)), rotation_exp(&(w + turn * h)));
        let rate = rotation_log(&before.tr_mul(&after)) / (2.0 * h);
        prop_assert!((rate - rotation_jacobian(&w) * turn).norm() < 1e-9);
    }
}

#[test]
fn series_meets_the_closed_form() {
    let below = Factors::of(&Vector3::new(0.0, 0.0, 0.5f64.next_down()));
    let above = Factors::of(&Vector3::new(0.0, 0.0, 0.5));
    assert!((below.sine - above.sine).abs() < 1e-15);
    assert!((below.versine - above.versine).abs() < 1e-15);
    assert!((below.excess() - above.excess()).abs() < 1e-15);
    let below = inverse_excess(&Vector3::new(0.0, 0.5f64.next_down(), 0.0));
    assert!((below - inverse_excess(&Vector3::new(0.0, 0.5, 0.0))).abs() < 1e-15);
}

#[test]
fn a_quarter_turn_on_paper() {
    let quarter = Pose2::new(1.0, 0.0, PI / 2.0);
    let there = quarter * Pose2::new(2.0, 0.0, 0.0);
    assert!((there.position - Vector2::new(1.0, 2.0)).norm() < 1e-15);
}
