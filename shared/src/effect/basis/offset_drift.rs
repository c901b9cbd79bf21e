//! Drift of an offset: something that grows evenly with time.
//!
//! # Model
//!
//! f = r·t
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | t | `Moment::time_s` | s | time since the measurement began |
//!
//! Valid over one measurement; it does not say what drifts.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::along::{Along, Memory, Moment, offset_drift::OffsetDrift};
//! let law = OffsetDrift;
//! let now = Moment { time_s: 60.0, ..Moment::default() };
//! assert!((law.shape(&now, &mut Memory::default()) - (60.0f64)).abs() < 1e-12);
//! ```

use super::{Along, LawName, Memory, Moment, Per};
use crate::real::Real;

/// Something that grows evenly with time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffsetDrift;

impl<T: Real> Along<T> for OffsetDrift {
    fn name(&self) -> LawName {
        LawName::OffsetDrift
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Time]
    }

    fn size(&self) -> &'static str {
        "rate"
    }

    fn shape(&self, now: &Moment<T>, _memory: &mut Memory<T>) -> T {
        now.time_s
    }
}
