//! Sine and cosine in `f64` without branches, so that a host computes several side by side.

#[cfg(any(test, target_feature = "avx512f"))]
use core::array::from_fn;
use core::f64::consts::FRAC_2_PI;

/// Beyond this angle the remainder of the division by π/2 loses digits, rad.
const LARGEST: f64 = 1e5;
/// 1.5·2⁵²: adding it rounds to the nearest integer, which then is in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// π/2 in three parts of 33 bits and fewer: k times the first two is exact for |k| < 2²⁰.
const HALF_PI: [f64; 3] = [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];
const SINE: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COSINE: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

#[inline(always)]
pub(super) fn sin_cos(x: f64) -> (f64, f64) {
    if x.abs() < LARGEST { reduced(x) } else { libm(x) }
}

#[inline(always)]
pub(super) fn sin_cos_all<const N: usize>(angles: &[f64; N]) -> [(f64, f64); N] {
    if !angles.iter().all(|x| x.abs() < LARGEST) {
        return angles.map(libm);
    }
    #[cfg(target_feature = "avx512f")]
    if N > 4 && N < 8 {
        return in_full_vector(angles);
    }
    angles.map(reduced)
}

/// Up to eight pairs from a vector of eight: one that five to seven angles leave unfilled is written to memory in pieces and
/// read back masked, for which a Zen 5 waits 12 to 25 ns.
#[cfg(any(test, target_feature = "avx512f"))]
#[inline(always)]
pub(super) fn in_full_vector<const N: usize>(angles: &[f64; N]) -> [(f64, f64); N] {
    let full: [f64; 8] = from_fn(|k| angles.get(k).copied().unwrap_or_default());
    let full = full.map(reduced);
    from_fn(|k| full.get(k).copied().unwrap_or_default())
}

#[cold]
fn libm(x: f64) -> (f64, f64) {
    crate::real::sin_cos(x)
}

/// Reduces x = k·π/2 + r, |r| ≤ π/4, and turns the pair of r by k quarters.
#[inline(always)]
fn reduced(x: f64) -> (f64, f64) {
    let rounded = x * FRAC_2_PI + ROUND;
    let quarters = rounded.to_bits();
    let k = rounded - ROUND;
    let r = ((x - k * HALF_PI[0]) - k * HALF_PI[1]) - k * HALF_PI[2];
    let z = r * r;
    let zz = z * z;
    let [s1, s2, s3, s4, s5, s6] = SINE;
    let [c1, c2, c3, c4, c5, c6] = COSINE;
    let sine = r + r * z * ((s1 + z * s2) + zz * ((s3 + z * s4) + zz * (s5 + z * s6)));
    let tail = zz * ((c1 + z * c2) + zz * ((c3 + z * c4) + zz * (c5 + z * c6)));
    let half = 0.5 * z;
    let leading = 1.0 - half;
    let cosine = leading + (((1.0 - leading) - half) + tail);
    let odd = 0u64.wrapping_sub(quarters & 1);
    let (a, b) = (sine.to_bits(), cosine.to_bits());
    let swap = (a ^ b) & odd;
    let sine = a ^ swap ^ ((quarters & 2) << 62);
    let cosine = b ^ swap ^ ((quarters.wrapping_add(1) & 2) << 62);
    (f64::from_bits(sine), f64::from_bits(cosine))
}
