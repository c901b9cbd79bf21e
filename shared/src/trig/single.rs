//! Sine, cosine, arc tangent and square root in `f32`, which a Cortex-M4F computes without a call.

use core::f32::consts::{FRAC_2_PI, FRAC_PI_2, FRAC_PI_4, PI};

/// Beyond this many quarter turns, 6434 rad, libm's: the remainder of the division by π/2 loses digits. A power of two.
const MAX_QUARTERS: u32 = 1 << 12;
/// 1.5·2²³: adding it rounds to the nearest integer, which then is in the low bits.
const ROUND: f32 = 12_582_912.0;
/// π/2 in three parts: k times the first two is exact for |k| < 2¹³.
const HALF_PI: [f32; 3] = [1.570_312_5, 4.837_513e-4, 7.549_79e-8];
const SINE: [f32; 3] = [-1.666_665_5e-1, 8.332_161e-3, -1.951_529_6e-4];
const COSINE: [f32; 3] = [4.166_664_6e-2, -1.388_731_6e-3, 2.443_315_7e-5];
const ATAN: [f32; 4] = [-3.333_295e-1, 1.997_771_1e-1, -1.387_768_6e-1, 8.053_744_6e-2];
/// tan π/8: an arc tangent beyond it is taken from π/4.
const TAN_PI_8: f32 = 0.414_213_57;

#[inline(always)]
pub(super) fn sin_cos(x: f32) -> (f32, f32) {
    let (pair, quarters) = reduced(x);
    if quarters < 2 * MAX_QUARTERS { pair } else { libm(x) }
}

/// As [`sin_cos`] of each angle, with one look for angles that are too large.
#[inline(always)]
pub(super) fn sin_cos_all<const N: usize>(angle_rad: impl Fn(usize) -> f32) -> [(f32, f32); N] {
    let mut all = 0;
    let mut pairs = core::array::from_fn(|k| {
        let (pair, quarters) = reduced(angle_rad(k));
        all |= quarters;
        pair
    });
    if all >= 2 * MAX_QUARTERS {
        pairs.iter_mut().enumerate().for_each(|(k, pair)| *pair = sin_cos(angle_rad(k)));
    }
    pairs
}

#[cold]
#[inline(never)]
fn libm(x: f32) -> (f32, f32) {
    crate::real::sin_cos(x)
}

/// Reduces x = k·π/2 + r, |r| ≤ π/4, and turns the pair of r by k quarters; and k + [`MAX_QUARTERS`], which is below twice
/// that where the pair holds.
#[inline(always)]
fn reduced(x: f32) -> ((f32, f32), u32) {
    let rounded = x * FRAC_2_PI + ROUND;
    let quarters = rounded.to_bits();
    let k = rounded - ROUND;
    let r = ((x - k * HALF_PI[0]) - k * HALF_PI[1]) - k * HALF_PI[2];
    let z = r * r;
    let [s1, s2, s3] = SINE;
    let [c1, c2, c3] = COSINE;
    let sine = r + r * z * (s1 + z * (s2 + z * s3));
    let cosine = (1.0 - 0.5 * z) + z * z * (c1 + z * (c2 + z * c3));
    let (sine, cosine) = if quarters & 1 == 0 { (sine, cosine) } else { (cosine, sine) };
    let sine = sine.to_bits() ^ ((quarters & 2) << 30);
    let cosine = cosine.to_bits() ^ ((quarters.wrapping_add(1) & 2) << 30);
    let counted = quarters.wrapping_sub(ROUND.to_bits() - MAX_QUARTERS);
    ((f32::from_bits(sine), f32::from_bits(cosine)), counted)
}

pub(super) fn atan2(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let (low, high) = if ay > ax { (ax, ay) } else { (ay, ax) };
    let ratio = if high == 0.0 {
        0.0
    } else if high.is_infinite() {
        if low.is_infinite() { 1.0 } else { 0.0 }
    } else {
        low / high
    };
    let mut angle = atan_of_ratio(ratio);
    if ay > ax {
        angle = FRAC_PI_2 - angle;
    }
    if x.is_sign_negative() {
        angle = PI - angle;
    }
    if high.is_nan() || low.is_nan() { f32::NAN } else { angle.copysign(y) }
}

/// The arc tangent of a ratio within 0..=1.
#[inline(always)]
fn atan_of_ratio(ratio: f32) -> f32 {
    let (start, t) = if ratio > TAN_PI_8 { (FRAC_PI_4, (ratio - 1.0) / (ratio + 1.0)) } else { (0.0, ratio) };
    let z = t * t;
    let [a1, a2, a3, a4] = ATAN;
    start + (t + t * z * (a1 + z * (a2 + z * (a3 + z * a4))))
}

/// One over the root from the exponent's half and three steps of Newton's, then one step on the root itself.
pub(super) fn sqrt(x: f32) -> f32 {
    if x <= f32::MIN_POSITIVE {
        return if x > 0.0 { sqrt(x * 16_777_216.0) * (1.0 / 4096.0) } else { 0.0 };
    }
    if x == f32::INFINITY {
        return x;
    }
    let half = 0.5 * x;
    let mut inverse = f32::from_bits(0x5f37_59df_u32.wrapping_sub(x.to_bits() >> 1));
    for _ in 0..3 {
        inverse *= 1.5 - half * inverse * inverse;
    }
    let root = x * inverse;
    root + 0.5 * inverse * (x - root * root)
}
