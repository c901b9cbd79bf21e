//! Instructions of kinematics and dynamics for arms of six joints in `f32`, and whether the values are the host's.
//!
//! Nothing interrupts, and SysTick counts freely.
use core::hint::black_box;

use darm_b_l475e_iot01a::measure::{check, print};
use darm_core::dynamics::{inverse_dynamics, mass_matrix};
use darm_core::ik;
use darm_core::real::{Mat6, Vec3};
use darm_core::se::{Pose, Twist};
use darm_core::tree::puma560::{NEAR_M, NEAR_NM, SAMPLE};
use darm_core::tree::{Frames, Inertia, Joint, LinkFrame, Tree};
use darm_firmware::stack::StackMemory;

use crate::{count, puma560};

/// In flash.
pub(crate) static PUMA: Tree<f32, 6> = puma560::TREE;
static TOOL: LinkFrame<f32> = puma560::TOOL;

#[inline(never)]
fn forward(tree: &Tree<f32, 6>, tool: &LinkFrame<f32>, q: &[f32; 6]) -> Pose<f32> {
    tree.pose(tool, q)
}

#[inline(never)]
fn forward_and_jacobian(
    tree: &Tree<f32, 6>,
    tool: &LinkFrame<f32>,
    q: &[f32; 6],
    (frames, jacobian): (&mut Frames<f32, 6>, &mut Mat6<f32>),
) -> Pose<f32> {
    tree.place(q, frames);
    tree.jacobian_base_into(tool, frames, jacobian);
    frames.pose(tool)
}

#[inline(never)]
fn damped(jacobian: &Mat6<f32>, error: &Twist<f32>) -> [f32; 6] {
    ik::damped_step(jacobian, error, 0.01)
}

#[inline(never)]
fn torques(tree: &Tree<f32, 6>, [q, qd, qdd]: &[[f32; 6]; 3]) -> [f32; 6] {
    inverse_dynamics(tree, q, qd, qdd, None)
}

#[inline(never)]
fn mass(tree: &Tree<f32, 6>, q: &[f32; 6]) -> Mat6<f32> {
    mass_matrix(tree, q)
}

/// The instructions of one arm, as `name`s beside them.
#[inline(never)]
fn counts(tree: &Tree<f32, 6>, tool: &LinkFrame<f32>, motion: &[[f32; 6]; 3]) -> [(&'static str, u32); 6] {
    let (mut frames, mut jacobian) = (Frames::default(), Mat6::zeros());
    let [q, ..] = motion;
    let error = Twist { angular: Vec3::repeat(0.01), linear: Vec3::repeat(0.01) };
    let pose = count::instructions(|| forward(tree, tool, black_box(q)));
    let both = count::instructions(|| {
        forward_and_jacobian(black_box(tree), black_box(tool), black_box(q), (&mut frames, &mut jacobian))
    });
    let step = count::instructions(|| damped(black_box(&jacobian), black_box(&error)));
    let limits = [[-3.0, 3.0]; 6];
    let arm = ik::Arm { tree, tool, limits: &limits };
    let target = tree.pose(tool, &q.map(|q| q + 0.1));
    let full_step = count::instructions(|| ik::iterate(&arm, black_box(&target), &mut q.clone(), 1, (0.5, 1e-3)));
    let inverse = count::instructions(|| torques(tree, black_box(motion)));
    let matrix = count::instructions(|| mass(tree, black_box(q)));
    [
        ("forward_kinematics", pose),
        ("forward_kinematics_and_Jacobian", both),
        ("damped_least_squares_step", step),
        ("complete_step_of_inverse_kinematics_and_check", full_step),
        ("inverse_dynamics", inverse),
        ("mass_matrix", matrix),
    ]
}

/// Joints that turn about z and y in turn, each 0.1 m ahead and 0.2 m above the one before.
fn alternating() -> Option<Tree<f32, 6>> {
    let body = Inertia::none();
    let joint = |index: usize| {
        let axis = if index % 2 == 0 { Vec3::z() } else { Vec3::y() };
        Joint::revolute(index.checked_sub(1), axis, Pose::at(Vec3::new(0.1, 0.0, 0.2)), body)
    };
    Tree::new(&core::array::from_fn(joint), Vec3::new(0.0, 0.0, -9.81)).ok()
}

/// The chip's values are those of the doctest and of the host's test.
fn check_values(tree: &Tree<f32, 6>, tool: &LinkFrame<f32>, motion: &[[f32; 6]; 3]) {
    let [q, ..] = motion;
    let away = tree.pose(tool, q).position - SAMPLE.tool().map(|x| x as f32);
    check("the tool is where the host has it", away.norm() < NEAR_M as f32);
    let near = |(ours, theirs): (&f32, &f64)| (*ours - *theirs as f32).abs() < NEAR_NM as f32;
    check("the torques are the host's", torques(tree, motion).iter().zip(&SAMPLE.torque).all(near));
    let arm = ik::Arm { tree, tool, limits: &puma560::LIMITS };
    let target = tree.pose(tool, q);
    let options = ik::Options { position_m: 1e-5, orientation_rad: 1e-5, ..ik::Options::default() };
    let found = ik::solve(&arm, &target, &q.map(|q| q + 0.2), &options);
    check("the inverse leads back", found.status == ik::Status::Reached);
}

/// Counts, checks and prints; the stack is what all of this needs.
#[inline(never)]
pub(crate) fn measure(stack: &StackMemory) {
    let motion = [SAMPLE.q, SAMPLE.qd, SAMPLE.qdd].map(|row| row.map(|x| x as f32));
    let Some(plain) = alternating() else { return check("the arm is an arm", false) };
    check_values(&PUMA, &TOOL, &motion);
    let of_puma = counts(&PUMA, &TOOL, &motion);
    let of_plain = counts(&plain, &plain.frame(5, &Pose::identity()), &motion);
    let used = stack.usage().used;
    for (arm, counts) in [("z_y_arm", of_plain), ("Puma_560", of_puma)] {
        counts.iter().for_each(|(name, count)| print(arm, name, count, "instructions"));
    }
    print("kinematics", "stack", used, "bytes");
}
