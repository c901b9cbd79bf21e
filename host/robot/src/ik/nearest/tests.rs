//! The Hessian against differences, and the nearest posture against many random restarts and a dense grid.

use darm_core::actuator::{Axis, JointKind};
use darm_core::ik::Options;
use darm_core::real::Vec3;
use darm_core::se::Pose;
use proptest::prelude::*;

use super::super::arm::{Arm, ArmJoint, Variable};
use super::*;

/// A serial arm of random axes, whose last joint follows the first where `follows`.
fn arms(follows: bool) -> impl Strategy<Value = Arm> {
    let three = || prop::array::uniform3(-1.0..1.0f64);
    let joint = (three(), three(), three(), 0..5usize, -2.0..0.0f64, 0.2..2.0f64);
    prop::collection::vec(joint, 2..6).prop_map(move |all| {
        let last = all.len() - 1;
        let mut arm = Arm { joints: Vec::new(), tool: Pose::at(Vec3::new(0.2, 0.1, 0.3)), variables: Vec::new() };
        for (number, (place, turn, axis, kind, low, width)) in all.into_iter().enumerate() {
            let direction = (Vec3::from(axis) + Vec3::new(0.0, 0.0, 1.5)).normalize();
            let kind = if kind == 0 { JointKind::Prismatic } else { JointKind::Revolute };
            let is_free = !follows || number < last;
            arm.joints.push(ArmJoint {
                axis: Axis { kind, direction },
                placement: Pose::new(&(Vec3::from(turn) * 2.0), Vec3::from(place) * 0.5),
                variable: Some(if is_free { number } else { 0 }),
                factor: if is_free { 1.0 } else { -0.7 },
                offset: if is_free { 0.0 } else { 0.2 },
            });
            if is_free {
                let is_angle = kind == JointKind::Revolute;
                arm.variables.push(Variable { limits: [low, low + width], is_angle });
            }
        }
        arm
    })
}

fn poses() -> impl Strategy<Value = Pose<f64>> {
    let three = || prop::array::uniform3(-1.0..1.0f64);
    (three(), three()).prop_map(|(turn, place)| Pose::new(&(Vec3::from(turn) * 1.7), Vec3::from(place) * 2.0))
}

fn options(oriented: bool) -> Options<f64> {
    Options { orientation_rad: if oriented { 1e-5 } else { f64::INFINITY }, ..Options::default() }
}

/// ½ of the squared distance.
fn cost(problem: Problem<'_>, x: &[f64]) -> f64 {
    problem.arm.curvature(problem.target, x, problem.options.weights()).cost
}

proptest! {
    #![proptest_config(crate::testing::seeded(48))]

    #[test]
    fn gradient_and_hessian_are_those_of_differences(arm in arms(true), target in poses(), at in -1.0..1.0f64) {
        let x: Vec<f64> = (0..arm.variables.len()).map(|k| at + 0.3 * k as f64).collect();
        let weights = options(true).weights();
        let here = arm.curvature(&target, &x, weights);
        prop_assume!(here.error.angular.norm() < 3.0);
        let step = 1e-5;
        for k in 0..x.len() {
            let moved = |by: f64| {
                let mut x = x.clone();
                x[k] += by;
                arm.curvature(&target, &x, weights)
            };
            let (after, before) = (moved(step), moved(-step));
            prop_assert!(((after.cost - before.cost) / (2.0 * step) - here.gradient[k]).abs() < 1e-7);
            let row = (after.gradient - before.gradient) / (2.0 * step);
            prop_assert!((row - here.hessian.column(k)).amax() < 1e-6, "{}", here.hessian);
        }
    }

    /// No one of many long descents from random starts comes nearer, and what is called a minimum is one.
    #[test]
    fn nothing_is_nearer_than_the_nearest(arm in arms(false), target in poses(), oriented in any::<bool>()) {
        let options = options(oriented);
        let problem = Problem { arm: &arm, target: &target, options: &options };
        let start = vec![0.0; arm.variables.len()];
        let found = solve(problem, &start, |_, _| ());
        prop_assume!(found.status != Status::Reached);
        prop_assert!(found.is_minimum, "{:?}", found);
        let least = cost(problem, &found.x);
        let longer = Options { starts: 400, seed: 99, ..options };
        let other = solve(Problem { options: &longer, ..problem }, &start, |_, _| ());
        prop_assert!(least <= cost(problem, &other.x) * (1.0 + 1e-9), "{} {}", least, cost(problem, &other.x));
        let mut random = ChaCha8Rng::seed_from_u64(7);
        for _ in 0..2000 {
            let any: Vec<f64> =
                arm.bounds().iter().map(|[low, high]| low + (high - low) * random.random::<f64>()).collect();
            prop_assert!(least <= cost(problem, &any) * (1.0 + 1e-9));
            let near: Vec<f64> = found.x.iter().map(|x| x + 1e-4 * (random.random::<f64>() - 0.5)).collect();
            let near = arm.within_limits(&near);
            prop_assert!(least <= cost(problem, &near) * (1.0 + 1e-9) + 1e-18, "a neighbour is nearer");
        }
    }
}

/// Two links and their limits: every posture of a grid of 0.1°, and the closed form where the arm is stretched.
#[test]
fn a_planar_arm_is_as_near_as_a_grid_of_all_postures() {
    for (limits, point) in [
        ([[-1.0, 1.0], [0.2, 2.0]], [-0.6, 0.1]),
        ([[-3.0, 3.0], [-3.0, 3.0]], [1.5, 0.4]),
        ([[0.0, 1.5], [-2.5, -0.5]], [0.05, -0.3]),
        ([[-0.3, 0.3], [-0.3, 0.3]], [-0.2, 0.0]),
    ] {
        let joint = |number: usize, length: f64| ArmJoint {
            axis: Axis { kind: JointKind::Revolute, direction: Vec3::z() },
            placement: Pose::at(Vec3::new(length, 0.0, 0.0)),
            variable: Some(number),
            factor: 1.0,
            offset: 0.0,
        };
        let variables = limits.map(|limits| Variable { limits, is_angle: true }).to_vec();
        let tool = Pose::at(Vec3::new(0.3, 0.0, 0.0));
        let arm = Arm { joints: vec![joint(0, 0.0), joint(1, 0.5)], tool, variables };
        let (target, options) = (Pose::at(Vec3::new(point[0], point[1], 0.0)), options(false));
        let problem = Problem { arm: &arm, target: &target, options: &options };
        let found = solve(problem, &[0.0, 0.0], |_, _| ());
        let distance = |x: &[f64]| (2.0 * cost(problem, x)).sqrt();
        let grid = |[low, high]: [f64; 2]| (0..=1000).map(move |k| low + (high - low) * f64::from(k) / 1000.0);
        let all = grid(limits[0]).flat_map(|a| grid(limits[1]).map(move |b| [a, b]));
        let least = all.map(|x| distance(&x)).fold(f64::INFINITY, f64::min);
        assert!(found.is_minimum && distance(&found.x) <= least + 1e-12, "{found:?} {} {least}", distance(&found.x));
    }
}

/// At full stretch away from the target the gradient vanishes, and it is the farthest posture.
#[test]
fn the_farthest_posture_is_no_minimum() {
    let (arm, tip) = crate::robot::planar::planar_arm(&[0.5, 0.3], &[[-3.1, 3.1]; 2]);
    let options = Options { starts: 1, ..options(false) };
    let target = Pose::at(Vec3::new(-2.0, 0.0, 0.0));
    let found = arm.inverse(super::super::Method::LevenbergMarquardt, &tip, &target, &[0.0, 0.0], &options).unwrap();
    // A joint of 3.1 rad cannot turn back altogether; the other takes the rest.
    assert!(found.is_minimum && found.error_m < 1.21, "{found:?}");
}
