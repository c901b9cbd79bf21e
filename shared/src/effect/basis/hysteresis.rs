//! Hysteresis: a joint that follows its load with slack.
//!
//! # Model
//!
//! e = c·p, p = min(max(p, L − w), L + w)
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | p | `Memory::state` | its own | play operator of the load; the load itself at the start |
//! | w | `half_width` | its own | half width of the slack, ≥ 0 |
//!
//! Valid where slack and stiffness lie in series.
//! Source: M. A. Krasnosel'skii, A. V. Pokrovskii, Systems with Hysteresis, 1989.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, hysteresis::Hysteresis};
//! let (law, mut memory) = (Hysteresis { half_width: 1.0 }, Memory::default());
//! let mut at = |load: f64| law.basis(&CoordinateSample { load, ..CoordinateSample::default() }, &mut memory);
//! let last = [0.0, 3.0, 2.0].map(&mut at)[2];
//! assert!((last - (2.0)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per, ShapeParameter};
use crate::real::Real;

/// A joint that follows its load with slack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hysteresis<T: Real> {
    /// Half width, in the unit of the load.
    pub half_width: T,
}

impl<T: Real> BasisLaw<T> for Hysteresis<T> {
    fn name(&self) -> LawName {
        LawName::Hysteresis
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Load]
    }

    fn coefficient(&self) -> &'static str {
        "compliance"
    }

    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        Some(ShapeParameter { name: "half width", value: self.half_width, per: Per::Load })
    }

    fn basis(&self, now: &CoordinateSample<T>, memory: &mut Memory<T>) -> T {
        memory.play(now.load, self.half_width)
    }
}
