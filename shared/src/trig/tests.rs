//! Errors of the elementary functions against `f64`.

extern crate std;

use super::*;

#[test]
fn double_sine_and_cosine_are_exact_to_the_last_bits() {
    let worst = (-400_000..400_000).map(|k| f64::from(k) * 0.001_234_567).fold(0.0f64, |worst, x| {
        let (s, c) = sin_cos(x);
        worst.max((s - x.sin()).abs()).max((c - x.cos()).abs())
    });
    assert!(worst < 2.3e-16, "{worst:e}");
}
