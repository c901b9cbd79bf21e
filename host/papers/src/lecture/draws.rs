//! Random postures of a section, and the largest of the differences that they give.

use darm_core::real::Vec3;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::Row;

/// Postures in which an equation is compared.
pub(super) const DRAWS: usize = 1000;

/// A row of a section.
pub(super) fn row(section: &'static str, what: &'static str, value: f64, unit: &'static str) -> Row {
    Row { section, what, value, unit }
}

/// Random numbers of a section.
pub(super) fn random(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// `N` numbers from −size to size.
pub(super) fn draw<const N: usize>(random: &mut ChaCha8Rng, size: f64) -> [f64; N] {
    std::array::from_fn(|_| random.random_range(-size..size))
}

/// The larger of a difference and the largest so far; not a number stays one.
pub(super) fn worst(so_far: f64, difference: f64) -> f64 {
    if so_far.is_nan() || difference.is_nan() { f64::NAN } else { so_far.max(difference) }
}

/// Largest entry of the difference of two vectors.
pub(super) fn apart(a: &Vec3<f64>, b: &Vec3<f64>) -> f64 {
    (a - b).amax()
}
