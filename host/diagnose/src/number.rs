//! Numbers of a diagnosis, each with its unit.

use serde::Serialize;

/// A number with its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Number {
    /// The number.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
}

impl Number {
    /// A number in this unit.
    pub(crate) fn new(value: f64, unit: &'static str) -> Self {
        Self { value, unit }
    }
}
