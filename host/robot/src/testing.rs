//! What the property tests of this crate have in common.

use proptest::test_runner::{Config, RngSeed};

/// The number of cases, the same ones in every run.
pub(crate) fn seeded(cases: u32) -> Config {
    Config { cases, rng_seed: RngSeed::Fixed(6), failure_persistence: None, ..Config::default() }
}

/// The Puma 560 of the examples.
pub(crate) fn puma560() -> crate::robot::Robot {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/puma560.toml");
    crate::dh::read(&path).expect("the example is valid")
}
