//! An offset that grows with speed whichever way the motion goes, as the lag of a valve.
//!
//! # Model
//!
//! f = c·|v|
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | v | `CoordinateSample::velocity` | m/s or rad/s | velocity |
//!
//! Valid where flow or switching, not friction, costs force.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, speed_dependent_offset::SpeedDependentOffset};
//! let law = SpeedDependentOffset;
//! let now = CoordinateSample { velocity: -2.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (2.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per};
use crate::real::Real;

/// An offset that grows with speed whichever way the motion goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedDependentOffset;

impl<T: Real> BasisLaw<T> for SpeedDependentOffset {
    fn name(&self) -> LawName {
        LawName::SpeedDependentOffset
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Speed]
    }

    fn coefficient(&self) -> &'static str {
        "coefficient"
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        now.velocity.abs()
    }
}
