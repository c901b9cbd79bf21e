//! What the tests of all drivers use: models of the chip.
pub(crate) mod model;
