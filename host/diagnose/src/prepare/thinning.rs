//! A few rows in place of many.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Seed of the draw: the same rows each time.
const SEED: u64 = 1;

/// Numbers of `max` of `n` rows in their order, one drawn from each of as many equal parts; all of fewer rows. Every n-th row
/// of a motion that repeats would be in one phase of it.
pub(crate) fn one_of_each_part(n: usize, max: usize) -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let of_part = |part: usize| rng.random_range(part * n / max..(part + 1) * n / max);
    if n <= max { (0..n).collect() } else { (0..max).map(of_part).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_all_parts_are_in_order_and_not_in_one_phase() {
        assert_eq!(one_of_each_part(3, 5), [0, 1, 2]);
        let rows = one_of_each_part(1000, 100);
        assert!(rows.len() == 100 && rows.windows(2).all(|pair| pair[0] < pair[1]));
        let of_phase = |phase: usize| rows.iter().filter(|row| **row % 10 == phase).count();
        assert!((0..10).all(|phase| (1..=25).contains(&of_phase(phase))), "{rows:?}");
    }
}
