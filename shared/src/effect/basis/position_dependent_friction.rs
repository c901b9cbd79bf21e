//! Friction that changes along the stroke, as in a bore that is not even.
//!
//! # Model
//!
//! f = c·x·z, z as in `presliding_friction`
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | x | `CoordinateSample::position` | m or rad | position |
//! | d | `distance` | m or rad | distance over which it turns round, > 0 |
//!
//! Valid for a friction that changes in proportion to position; beside `presliding_friction`.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, position_dependent_friction::PositionDependentFriction};
//! let (law, mut memory) = (PositionDependentFriction { distance: 1.0 }, Memory::default());
//! let mut at = |position: f64| law.basis(&CoordinateSample { position, ..CoordinateSample::default() }, &mut memory);
//! let last = [0.0, 90.0, 3.0].map(&mut at)[2];
//! assert!((last - (-3.0)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per, ShapeParameter};
use crate::real::Real;

/// Friction that changes along the stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionDependentFriction<T: Real> {
    /// Presliding distance, m or rad.
    pub distance: T,
}

impl<T: Real> BasisLaw<T> for PositionDependentFriction<T> {
    fn name(&self) -> LawName {
        LawName::PositionDependentFriction
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Length]
    }

    fn coefficient(&self) -> &'static str {
        "slope"
    }

    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        Some(ShapeParameter { name: "presliding distance", value: self.distance, per: Per::Length })
    }

    fn basis(&self, now: &CoordinateSample<T>, memory: &mut Memory<T>) -> T {
        now.position * memory.presliding_state(now.position, self.distance)
    }
}
