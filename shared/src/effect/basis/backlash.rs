//! Backlash: a position that lags behind its target by half a gap, whichever way it was reached.
//!
//! # Model
//!
//! e = h·z, z as in `presliding_friction` of the target
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | h | size | m or rad | half the gap, ≥ 0 |
//! | d | `distance` | m or rad | distance over which it crosses the gap, > 0 |
//!
//! Valid where friction holds the joint at the side that it came from.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, backlash::Backlash};
//! let (law, mut memory) = (Backlash { distance: 1.0 }, Memory::default());
//! let mut at = |position: f64| law.basis(&CoordinateSample { position, ..CoordinateSample::default() }, &mut memory);
//! let last = [0.0, 90.0, 3.0].map(&mut at)[2];
//! assert!((last - (-1.0)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per, ShapeParameter};
use crate::real::Real;

/// A position that lags behind its target by half a gap, whichever way it was reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Backlash<T: Real> {
    /// Memory of direction, m or rad.
    pub distance: T,
}

impl<T: Real> BasisLaw<T> for Backlash<T> {
    fn name(&self) -> LawName {
        LawName::Backlash
    }

    fn per(&self) -> &'static [Per] {
        &[]
    }

    fn coefficient(&self) -> &'static str {
        "half width"
    }

    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        Some(ShapeParameter { name: "memory of direction", value: self.distance, per: Per::Length })
    }

    fn basis(&self, now: &CoordinateSample<T>, memory: &mut Memory<T>) -> T {
        memory.presliding_state(now.position, self.distance)
    }
}
