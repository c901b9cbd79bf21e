//! What the property tests of this crate have in common.

use proptest::test_runner::{Config, RngSeed};

/// The number of cases, the same ones in every run.
pub(crate) fn seeded(cases: u32) -> Config {
    Config { cases, rng_seed: RngSeed::Fixed(6), failure_persistence: None, ..Config::default() }
}
