//! Backlash that a load decides: the joint lies at the side of its gap that the load presses it to.
//!
//! # Model
//!
//! e = h·tanh(L/L₀)
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | L | `CoordinateSample::load` | its own | load, with its sign |
//! | L₀ | `seating` | its own | load that presses the joint to 76 % of the way, > 0 |
//!
//! Valid where the load, not friction, moves the joint within its gap.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, backlash_by_load::BacklashByLoad};
//! let law = BacklashByLoad { seating: 0.1 };
//! let now = CoordinateSample { load: -9.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (-1.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per, ShapeParameter};
use crate::real::{Real, tanh};

/// The joint lies at the side of its gap that the load presses it to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BacklashByLoad<T: Real> {
    /// Load that seats, in the unit of the load.
    pub seating: T,
}

impl<T: Real> BasisLaw<T> for BacklashByLoad<T> {
    fn name(&self) -> LawName {
        LawName::BacklashByLoad
    }

    fn per(&self) -> &'static [Per] {
        &[]
    }

    fn coefficient(&self) -> &'static str {
        "half width"
    }

    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        Some(ShapeParameter { name: "load that seats", value: self.seating, per: Per::Load })
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        tanh(now.load / self.seating)
    }
}
