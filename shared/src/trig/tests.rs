//! Errors of the elementary functions against `f64`: the bounds in the module's table.
//!
//! Of the `f32` within ±π/4 every 97th, which meets every exponent and, as 97 divides no power of two, all parts of the
//! mantissa; every one of them when `DARM_EXHAUSTIVE` is set in the environment (about two minutes).

extern crate std;

use super::*;

/// Steps through the bit patterns between two positive numbers.
fn strided(low: f32, high: f32, step: usize) -> impl Iterator<Item = f32> {
    (low.to_bits()..=high.to_bits()).step_by(step).map(f32::from_bits)
}

fn worst_of_sines(numbers: impl Iterator<Item = f32>) -> f64 {
    numbers.fold(0.0, |worst: f64, x| {
        let (s, c) = sin_cos(x);
        let (exact_s, exact_c) = sin_cos(f64::from(x));
        worst.max((f64::from(s) - exact_s).abs()).max((f64::from(c) - exact_c).abs())
    })
}

#[test]
fn double_sine_and_cosine_are_exact_to_the_last_bits() {
    let worst = (-400_000..400_000).map(|k| f64::from(k) * 0.001_234_567).fold(0.0f64, |worst, x| {
        let (s, c) = sin_cos(x);
        worst.max((s - x.sin()).abs()).max((c - x.cos()).abs())
    });
    assert!(worst < 2.3e-16, "{worst:e}");
}

#[test]
fn many_at_once_are_the_same_as_one_by_one() {
    let angles = [0.3, -2.0, 7.5, 1e3, -0.0, 3.0, 99.0];
    let pairs: [(f64, f64); 7] = sin_cos_all(|k| angles[k]);
    assert_eq!(pairs, angles.map(sin_cos));
    assert_eq!(double::in_full_vector(&angles), pairs);
    assert_eq!(sin_cos_all(|_| 1e9_f64), [(1e9_f64.sin(), 1e9_f64.cos())]);
}

#[test]
fn single_sine_and_cosine_in_the_reduced_range() {
    let step = if std::env::var_os("DARM_EXHAUSTIVE").is_some() { 1 } else { 97 };
    let worst = worst_of_sines(strided(0.0, core::f32::consts::FRAC_PI_4, step));
    assert!(worst < SINE_BOUND, "{worst:e}");
}

#[test]
fn single_sine_and_cosine_over_many_turns() {
    let worst = worst_of_sines(strided(0.78, 8192.0, 29).flat_map(|x| [x, -x]));
    assert!(worst < SINE_BOUND, "{worst:e}");
    assert!(worst_of_sines(strided(8192.0, 1e30, 99_991)) < SINE_BOUND);
}

#[test]
fn single_arc_tangent_in_every_octant() {
    let mut worst = 0.0f64;
    for t in strided(1e-30, 1e30, 9973) {
        for (y, x) in [(t, 1.0), (-t, 1.0), (t, -1.0), (-t, -1.0)] {
            let exact = f64::from(y).atan2(f64::from(x));
            worst = worst.max(((f64::from(atan2(y, x)) - exact) / exact).abs());
        }
    }
    assert!(worst < 3.0e-7, "{worst:e}");
    assert_eq!(atan2(0.0f32, 1.0), 0.0);
    assert_eq!(atan2(0.0f32, -1.0), core::f32::consts::PI);
    assert_eq!(atan2(-0.0f32, -1.0), -core::f32::consts::PI);
    assert_eq!(atan2(0.0f32, 0.0), 0.0);
    assert!(atan2(f32::NAN, 1.0).is_nan());
    assert_eq!(atan2(f32::INFINITY, 1.0), core::f32::consts::FRAC_PI_2);
}

#[test]
fn single_root_of_every_size() {
    let worst = strided(f32::from_bits(1), f32::MAX, 4999).fold(0.0f64, |worst, x| {
        let exact = f64::from(x).sqrt();
        worst.max(((f64::from(sqrt(x)) - exact) / exact).abs())
    });
    assert!(worst < 1.2e-7, "{worst:e}");
    assert_eq!(sqrt(0.0f32), 0.0);
    assert_eq!(sqrt(-1.0f32), 0.0);
    assert_eq!(sqrt(f32::INFINITY), f32::INFINITY);
}

#[test]
fn many_single_ones_are_the_same_as_one_by_one() {
    for angles in [[0.3f32, -2.0, 6000.0, -6000.0, -0.0], [0.3, 7000.0, 1e9, -2.0, -1e30]] {
        assert_eq!(sin_cos_all(|k| angles[k]), angles.map(sin_cos));
    }
    let [(sine, cosine)] = sin_cos_all(|_| f32::NAN);
    assert!(sine.is_nan() && cosine.is_nan());
}

/// Stated in the module's table.
const SINE_BOUND: f64 = 1.2e-7;
