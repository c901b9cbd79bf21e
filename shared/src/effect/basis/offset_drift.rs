//! Drift of an offset: something that grows evenly with time.
//!
//! # Model
//!
//! f = r·t
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | t | `CoordinateSample::time_s` | s | time since the measurement began |
//!
//! Valid over one measurement; it does not say what drifts.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, offset_drift::OffsetDrift};
//! let law = OffsetDrift;
//! let now = CoordinateSample { time_s: 60.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (60.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per};
use crate::real::Real;

/// Something that grows evenly with time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffsetDrift;

impl<T: Real> BasisLaw<T> for OffsetDrift {
    fn name(&self) -> LawName {
        LawName::OffsetDrift
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Time]
    }

    fn coefficient(&self) -> &'static str {
        "rate"
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        now.time_s
    }
}
