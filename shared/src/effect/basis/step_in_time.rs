//! Step in time: from one moment on something is off, as after a bump or a slipped belt.
//!
//! # Model
//!
//! f = s·(t < t₀ ? 0 : 1)
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | t | `CoordinateSample::time_s` | s | time since the measurement began |
//! | t₀ | `at_s` | s | when it happened |
//!
//! Valid for one step; before it the ideal holds.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, step_in_time::StepInTime};
//! let law = StepInTime { at_s: 10.0 };
//! let now = CoordinateSample { time_s: 12.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (1.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per, ShapeParameter};
use crate::real::Real;

/// From one moment on something is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepInTime<T: Real> {
    /// Time of the step, s.
    pub at_s: T,
}

impl<T: Real> BasisLaw<T> for StepInTime<T> {
    fn name(&self) -> LawName {
        LawName::StepInTime
    }

    fn per(&self) -> &'static [Per] {
        &[]
    }

    fn coefficient(&self) -> &'static str {
        "step"
    }

    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        Some(ShapeParameter { name: "time of the step", value: self.at_s, per: Per::Time })
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        if now.time_s < self.at_s { T::zero() } else { T::one() }
    }
}
