//! Instructions of the code that `darm generate` wrote for the Puma 560, and whether its results are the core's.
use core::hint::black_box;

use darm_b_l475e_iot01a::measure::{check, print};
use darm_core::dynamics::mass_matrix;
use darm_core::tree::puma560::{NEAR_NM, SAMPLE};

use crate::general::PUMA;
use crate::{count, generated_puma560};

#[inline(never)]
fn generated_torques([q, qd, qdd]: &[[f32; 6]; 3]) -> [f32; 6] {
    let mut torque = [0.0; 6];
    generated_puma560::inverse_dynamics(q, qd, qdd, &mut torque);
    torque
}

#[inline(never)]
fn generated_mass(q: &[f32; 6]) -> [[f32; 6]; 6] {
    let mut rows = [[0.0; 6]; 6];
    generated_puma560::mass_matrix(q, &mut rows);
    rows
}

/// Counts, checks and prints.
#[inline(never)]
pub(crate) fn measure() {
    let motion = [SAMPLE.q, SAMPLE.qd, SAMPLE.qdd].map(|row| row.map(|x| x as f32));
    let [q, ..] = &motion;
    let near = |(ours, theirs): (&f32, f32)| (*ours - theirs).abs() < NEAR_NM as f32;
    let expected = SAMPLE.torque.map(|x| x as f32);
    check("the generated torques are the host's", generated_torques(&motion).iter().zip(expected).all(near));
    // Symmetric: rows are columns.
    let (rows, columns) = (generated_mass(q), mass_matrix(black_box(&PUMA), q));
    check("the generated masses are the core's", rows.as_flattened().iter().zip(columns.iter().copied()).all(near));
    let torques = count::instructions(|| generated_torques(black_box(&motion)));
    let mass = count::instructions(|| generated_mass(black_box(q)));
    print("Puma_560", "generated_inverse_dynamics", torques, "instructions");
    print("Puma_560", "generated_mass_matrix", mass, "instructions");
    print("Puma_560", "numbers_of_the_arm_for_the_general_code", size_of_val(&PUMA), "bytes");
}
