//! Pose of the tool of platform3, model 0.
//! Positions in m, angles in rad. The first digit of a word is the actuator next to the base.
//! Platforms solved in closed form: 1.
//! On 400 random words, with the supply within 20 %, the temperature within 20 K and a load up to 1 kg of those that
//! the arm works with, it differs from the iterations of `darm-core` by at most 9.4e-16 m and 5.8e-16 rad, before the
//! rounding of its numbers.
#![allow(dead_code, unreachable_pub, unused_parens, unused_variables, clippy::all)]

/// The conditions that the arm works with: supply (Pa), temperature (K), load besides the payload (kg).
pub const CONDITIONS: [[f32; 3]; 1] = [
    [600000.0, 293.15, 0.0],
];

/// Pose of the tool in the frame of the base for a word, with the effects of the model.
///
/// - `word` and `previous`: the digit of each actuator now, and in the word before; one that is no state counts as the
/// last.
/// - `conditions`: supply (Pa), temperature (K), mass that the tool carries besides the payload (kg).
/// - writes `rotation`: axes of the tool as columns.
/// - writes `position`: origin of the tool, m.
pub fn pose(word: &[u8; 3], previous: &[u8; 3], conditions: &[f32; 3], rotation: &mut [[f32; 3]; 3], position: &mut [f32; 3]) {
    let t2 = 1.0 - 1.6666667e-6 * conditions[0];
    let t11 = (if word[1] == 0 { 1.4142135 } else { 1.767767 - 0.01767767 * t2 });
    let t13 = t11 * t11;
    let t3 = 0.0125 * t2;
    let t4 = 1.25 - t3;
    let t12 = (if word[2] == 0 { 1.0 } else { t4 });
    let t16 = 0.5 * (t13 - t12 * t12);
    let t17 = 0.5 + t16;
    let t18 = t17 * t17;
    let t20 = square_root(t13 - t18);
    let t23 = 1.0 / (t18 + t20 * t20);
    let t8 = (if word[0] == 0 { (if previous[0] == 0 { 1.001 } else { 1.0 }) } else { (if previous[0] == 0 { t4 } else { 1.249 - t3 }) });
    let t24 = t8 * t8;
    let t28 = 0.5 - 0.5 * (t23 * (1.0 - t24));
    let t32 = square_root(t23 * t24 - t28 * t28);
    let t40 = t16 + (0.5 - t17 * t28 + t20 * t32);
    rotation[0][0] = t40;
    let t41 = t20 - (t20 * t28 + t17 * t32);
    rotation[0][1] = -t41;
    rotation[0][2] = 0.0;
    rotation[1][0] = t41;
    rotation[1][1] = t40;
    rotation[1][2] = 0.0;
    rotation[2][0] = 0.0;
    rotation[2][1] = 0.0;
    rotation[2][2] = 1.0;
    position[0] = t16 - 0.5 * t40;
    position[1] = t20 - 0.5 * t41;
    position[2] = 0.0;
}

/// The square root, within 1.2e-7 of itself; not a number below zero.
#[inline(always)]
fn square_root(x: f32) -> f32 {
    let half = 0.5 * x;
    let mut inverse = f32::from_bits(0x5f37_59df_u32.wrapping_sub(x.to_bits() >> 1));
    inverse *= 1.5 - half * inverse * inverse;
    inverse *= 1.5 - half * inverse * inverse;
    inverse *= 1.5 - half * inverse * inverse;
    let root = x * inverse;
    let root = root + 0.5 * inverse * (x - root * root);
    if x > f32::MIN_POSITIVE { root } else if x >= 0.0 { 0.0 } else { f32::NAN }
}
