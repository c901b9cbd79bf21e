//! An image that does kinematics and dynamics in `f32` and nothing else: `cargo xtask test` looks for a way to panic in it.
//!
//! Tree and motion pass through black boxes, so that no value is known when it is compiled.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;

use darm_core::dynamics::{inverse_dynamics, mass_matrix};
use darm_core::ik;
use darm_core::real::Mat6;
use darm_core::tree::puma560::{self, LIMITS_RAD, SAMPLE};
use darm_core::tree::{Frames, Tree};
// The interrupt vectors.
use stm32_metapac as _;

/// Never linked where nothing panics.
#[panic_handler]
fn panicked(_: &PanicInfo) -> ! {
    rest()
}

fn rest() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let Ok((tree, tool)) = puma560::arm::<f32>() else { rest() };
    let tree: Tree<f32, 6> = *black_box(&tree);
    let motion = [SAMPLE.q, SAMPLE.qd, SAMPLE.qdd].map(|row| row.map(|x| x as f32));
    let limits = LIMITS_RAD.map(|limits| limits.map(|q| q as f32));
    let arm = ik::Arm { tree: &tree, tool: &tool, limits: &limits };
    let (mut frames, mut jacobian) = (Frames::default(), Mat6::zeros());
    loop {
        let [q, qd, qdd] = black_box(&motion);
        let pose = black_box(tree.pose(&tool, q));
        tree.place(q, &mut frames);
        tree.jacobian_base_into(&tool, &frames, &mut jacobian);
        let error = ik::error(black_box(&pose), &frames.pose(&tool));
        black_box(ik::damped_step(black_box(&jacobian), &error, 0.01));
        black_box(ik::inverse_step(&jacobian, &error));
        black_box(ik::transpose_step(&jacobian, &error));
        black_box(ik::pseudo_inverse_step(&jacobian, &error));
        let mut reached = *q;
        black_box(ik::iterate(&arm, &pose, &mut reached, 3, (0.5, 1e-3)));
        black_box(ik::solve(&arm, &pose, qd, &ik::Options::default()));
        black_box(inverse_dynamics(&tree, q, qd, qdd, None));
        black_box(mass_matrix(&tree, q));
    }
}
