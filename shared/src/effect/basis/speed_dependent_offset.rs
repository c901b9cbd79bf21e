//! An offset that grows with speed whichever way the motion goes, as the lag of a valve.
//!
//! # Model
//!
//! f = c·|v|
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | v | `Moment::velocity` | m/s or rad/s | velocity |
//!
//! Valid where flow or switching, not friction, costs force.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::along::{Along, Memory, Moment, speed_dependent_offset::SpeedDependentOffset};
//! let law = SpeedDependentOffset;
//! let now = Moment { velocity: -2.0, ..Moment::default() };
//! assert!((law.shape(&now, &mut Memory::default()) - (2.0f64)).abs() < 1e-12);
//! ```

use super::{Along, LawName, Memory, Moment, Per};
use crate::real::Real;

/// An offset that grows with speed whichever way the motion goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedDependentOffset;

impl<T: Real> Along<T> for SpeedDependentOffset {
    fn name(&self) -> LawName {
        LawName::SpeedDependentOffset
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Speed]
    }

    fn size(&self) -> &'static str {
        "coefficient"
    }

    fn shape(&self, now: &Moment<T>, _memory: &mut Memory<T>) -> T {
        now.velocity.abs()
    }
}
