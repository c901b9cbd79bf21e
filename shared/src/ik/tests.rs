//! Each method against its own equation, and what the search promises on arms drawn at random.

extern crate std;

use core::f64::consts::PI;

use proptest::prelude::*;

use super::*;
use crate::arms::seeded;
use crate::real::Vec3;
use crate::tree::jacobian::twist;
use crate::tree::singular::rows;
use crate::tree::{Inertia, Joint};

/// A serial arm of six joints that turn, 0.3 m to 0.6 m apart, about axes of any direction.
fn six_joints() -> impl Strategy<Value = Tree<f64, 6>> {
    let link = (prop::array::uniform3(-1.0..1.0f64), prop::array::uniform3(-1.5..1.5f64));
    prop::collection::vec(link, 6).prop_filter_map("a link without length", |links| {
        let mut joints = [Joint::revolute(None, Vec3::z(), Pose::identity(), Inertia::none()); 6];
        for (index, (joint, (way, turn))) in joints.iter_mut().zip(links).enumerate() {
            let way = Vec3::from(way).try_normalize(0.1)?;
            joint.parent = index.checked_sub(1);
            joint.placement = Pose::new(&Vec3::from(turn), way * (0.3 + 0.05 * index as f64));
        }
        Tree::new(&joints, Vec3::zeros()).ok()
    })
}

fn positions(most: f64) -> impl Strategy<Value = [f64; 6]> {
    prop::array::uniform6(-most..most)
}

fn tool(tree: &Tree<f64, 6>) -> LinkFrame<f64> {
    tree.frame(5, &Pose::at(Vec3::new(0.1, 0.0, 0.05)))
}

proptest! {
    #![proptest_config(seeded(96))]

    #[test]
    fn forward_of_inverse_is_identity(tree in six_joints(), q in positions(2.5), start in positions(2.5)) {
        let tool = tool(&tree);
        let arm = Arm { tree: &tree, tool: &tool, limits: &[[-2.5, 2.5]; 6] };
        let target = tree.pose(&tool, &q);
        let found = solve(&arm, &target, &start, &Options { starts: 1000, ..Options::default() });
        prop_assert_eq!(found.status, Status::Reached, "{:?}", found);
        prop_assert_eq!(found.q, arm.within_limits(&found.q));
        let left = error(&target, &tree.pose(&tool, &found.q));
        prop_assert!(left.linear.norm() <= 1e-5 && left.angular.norm() <= 1e-5);
    }

    #[test]
    fn steps_solve_their_equations(tree in six_joints(), q in positions(2.5), turn in prop::array::uniform6(-1.0..1.0f64)) {
        let tool = tool(&tree);
        let mut frames = Frames::default();
        tree.place(&q, &mut frames);
        let jacobian = tree.jacobian_base(&tool, &frames);
        let [a, b, c, x, y, z] = turn;
        let wanted = Twist { angular: Vec3::new(a, b, c), linear: Vec3::new(x, y, z) };
        let least = crate::tree::singular::distance_to_singularity(&jacobian);
        prop_assume!(least > 1e-3);
        let near = |step: &[f64; 6], bound: f64| (twist(&jacobian, step) - wanted).size(1.0) <= bound;
        let step = inverse_step(&jacobian, &wanted).unwrap();
        prop_assert!(near(&step, 1e-9));
        let pseudo = pseudo_inverse_step(&jacobian, &wanted);
        prop_assert!(near(&pseudo, 1e-8));
        // |J x − ε| of the damped step is at most μ/(σ² + μ) of |ε|.
        let damping = 1e-4;
        prop_assert!(near(&damped_step(&jacobian, &wanted, damping), 2.5 * damping / (least * least + damping)));
        // The transpose leaves less than there was.
        prop_assert!(near(&transpose_step(&jacobian, &wanted), wanted.size(1.0)));
    }

    #[test]
    fn what_is_too_far_is_told(tree in six_joints(), start in positions(2.5), away in 3.2..100.0f64) {
        let tool = tool(&tree);
        let arm = Arm { tree: &tree, tool: &tool, limits: &[[-2.5, 2.5]; 6] };
        let target = Pose::at(Vec3::new(0.0, 0.0, away));
        let found = solve(&arm, &target, &start, &Options { starts: 12, ..Options::default() });
        prop_assert_eq!(found.status, Status::OutOfReach);
        prop_assert!((found.pose.position - target.position).norm() - found.error_m < 1e-12);
        prop_assert_eq!(found.q, arm.within_limits(&found.q));
    }
}

/// The lecture's planar robot with its tip.
fn planar() -> (Tree<f64, 2>, LinkFrame<f64>) {
    let upper = Joint::revolute(None, Vec3::z(), Pose::identity(), Inertia::none());
    let lower = Joint::revolute(Some(0), Vec3::z(), Pose::at(Vec3::new(0.5, 0.0, 0.0)), Inertia::none());
    let tree = Tree::new(&[upper, lower], Vec3::zeros()).unwrap();
    let tip = tree.frame(1, &Pose::at(Vec3::new(0.3, 0.0, 0.0)));
    (tree, tip)
}

/// Steps from a bent posture towards (0.4, 0.4) m until the error is below 1e-9 m.
fn steps_of(method: impl Fn(&SMatrix<f64, 6, 2>, &Twist<f64>) -> [f64; 2]) -> usize {
    let (tree, tip) = planar();
    let arm = Arm { tree: &tree, tool: &tip, limits: &[[-PI, PI]; 2] };
    let (mut q, mut frames) = ([0.3, 1.2], Frames::default());
    for step in 0..10_000 {
        let (mut error, mut jacobian) = arm.linearised(&Pose::at(Vec3::new(0.4, 0.4, 0.0)), &q, &mut frames);
        if error.linear.norm() < 1e-9 {
            return step;
        }
        scale(&mut error, &mut jacobian, [0.0, 1.0]);
        let step = method(&jacobian, &error);
        q = [q[0] + step[0], q[1] + step[1]];
    }
    10_000
}

#[test]
fn the_methods_of_the_lecture_converge() {
    let inverse = steps_of(|jacobian, error| inverse_step(jacobian, error).unwrap());
    let pseudo = steps_of(pseudo_inverse_step);
    let damped = steps_of(|jacobian, error| damped_step(jacobian, error, 1e-6));
    let transpose = steps_of(transpose_step);
    assert!(inverse <= 6 && pseudo == inverse && damped <= inverse + 1, "{inverse} {pseudo} {damped}");
    assert!(transpose > inverse && transpose < 1000, "{transpose}");
}

#[test]
fn a_jacobian_without_inverse_has_none() {
    let (tree, tip) = planar();
    let mut frames = Frames::default();
    tree.place(&[0.3, 0.0], &mut frames);
    let whole = tree.jacobian_base(&tip, &frames);
    let ahead = Twist { angular: Vec3::zeros(), linear: Vec3::x() };
    assert_eq!(inverse_step(&whole, &ahead), None, "three rows, two joints");
    let mut flat = whole;
    scale(&mut ahead.clone(), &mut flat, [0.0, 1.0]);
    assert_eq!(inverse_step(&flat, &ahead), None, "stretched out");
    assert!(rows(&flat, &[0, 1, 2]).iter().all(|entry| *entry == 0.0));
}

#[test]
fn a_target_beyond_a_limit_is_approached_to_the_limit() {
    let (tree, tip) = planar();
    let arm = Arm { tree: &tree, tool: &tip, limits: &[[-0.5, 0.5], [0.0, 0.0]] };
    let options = Options { orientation_rad: f64::INFINITY, ..Options::default() };
    let found = solve(&arm, &Pose::at(Vec3::new(0.0, 0.8, 0.0)), &[0.0, 0.0], &options);
    assert_eq!((found.status, found.q), (Status::OutOfReach, [0.5, 0.0]));
}

#[test]
fn orientation_alone_can_be_asked_for() {
    let (tree, tip) = planar();
    let arm = Arm { tree: &tree, tool: &tip, limits: &[[-PI, PI]; 2] };
    let options = Options { position_m: f64::INFINITY, ..Options::default() };
    let turned = Pose::new(&Vec3::new(0.0, 0.0, 1.0), Vec3::new(9.0, 9.0, 9.0));
    assert_eq!(solve(&arm, &turned, &[0.0, 0.0], &options).status, Status::Reached);
}

#[test]
fn a_fixed_number_of_steps_is_enough_nearby() {
    let (tree, tip) = planar();
    let arm = Arm { tree: &tree, tool: &tip, limits: &[[-PI, PI]; 2] };
    let mut q = [0.3, 1.2];
    let left = iterate(&arm, &tree.pose(&tip, &[0.5, 1.0]), &mut q, 8, (0.5, 1e-4));
    assert!(left.size(1.0) < 1e-6, "{left:?}");
}

#[test]
fn no_number_breaks_the_search() {
    let (tree, tip) = planar();
    for limits in [[[f64::NAN; 2]; 2], [[1.0, -1.0]; 2], [[f64::NEG_INFINITY, f64::INFINITY]; 2]] {
        let arm = Arm { tree: &tree, tool: &tip, limits: &limits };
        for value in [f64::NAN, f64::INFINITY, 1e300] {
            let target = Pose::at(Vec3::new(value, 0.0, 0.0));
            let found = solve(&arm, &target, &[value, 0.0], &Options { starts: 3, ..Options::default() });
            assert!(found.status != Status::Reached);
        }
    }
}
