//! An image that counts the instructions of code that `darm generate` wrote for one arm, and compares its results with the
//! core's. In the image `bench`, which counts the core's code for any arm, there is no room for it.
//!
//! Nothing interrupts, and SysTick counts freely. Started with `-icount shift=6,sleep=off` the counts are the same in every
//! run. Prints `name value unit`, one a line, through semihosting.
#![no_std]
#![no_main]

#[path = "../bench/count.rs"]
mod count;
#[rustfmt::skip]
mod puma560;
#[expect(dead_code, reason = "the other image needs its tool and limits, too")]
#[path = "../bench/puma560.rs"]
mod tree;

use core::hint::black_box;

use cortex_m_semihosting::{debug, hprintln};
use darm_b_l475e_iot01a::clocks;
use darm_core::dynamics::mass_matrix;
use darm_core::tree::Tree;
use darm_core::tree::puma560::{NEAR_NM, SAMPLE};
use defmt_rtt as _;

/// In flash.
static TREE: Tree<f32, 6> = tree::TREE;

#[inline(never)]
fn generated_torques([q, qd, qdd]: &[[f32; 6]; 3]) -> [f32; 6] {
    let mut torque = [0.0; 6];
    puma560::inverse_dynamics(q, qd, qdd, &mut torque);
    torque
}

#[inline(never)]
fn generated_mass(q: &[f32; 6]) -> [[f32; 6]; 6] {
    let mut rows = [[0.0; 6]; 6];
    puma560::mass_matrix(q, &mut rows);
    rows
}

fn check(what: &str, holds: bool) {
    if !holds {
        hprintln!("failed: {}", what);
        debug::exit(debug::EXIT_FAILURE);
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    check("the clock starts", clocks::start().is_ok());
    let motion = [SAMPLE.q, SAMPLE.qd, SAMPLE.qdd].map(|row| row.map(|x| x as f32));
    let [q, ..] = &motion;
    let near = |(ours, theirs): (&f32, f32)| (*ours - theirs).abs() < NEAR_NM as f32;
    let expected = SAMPLE.torque.map(|x| x as f32);
    check("the torques are the host's", generated_torques(&motion).iter().zip(expected).all(near));
    // Symmetric: rows are columns.
    let (rows, columns) = (generated_mass(q), mass_matrix(black_box(&TREE), q));
    check("the masses are the core's", rows.as_flattened().iter().zip(columns.iter().copied()).all(near));
    // SAFETY: nothing else uses the counter.
    let mut timer = unsafe { cortex_m::Peripherals::steal() }.SYST;
    count::start(&mut timer);
    let torques = count::instructions(|| generated_torques(black_box(&motion)));
    let mass = count::instructions(|| generated_mass(black_box(q)));
    hprintln!("Puma_560.generated_inverse_dynamics {} instructions", torques);
    hprintln!("Puma_560.generated_mass_matrix {} instructions", mass);
    hprintln!("Puma_560.numbers_of_the_arm_for_the_general_code {} bytes", size_of_val(&TREE));
    debug::exit(debug::EXIT_SUCCESS);
    loop {
        cortex_m::asm::wfi();
    }
}
