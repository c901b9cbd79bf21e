//! Presliding: friction that turns round over a distance, as bristles bend before they slide.
//!
//! # Model
//!
//! f = f_c·z,  dz = (sign(dx) − z)·|dx|/d
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | x | `CoordinateSample::position` | m or rad | position |
//! | z | `Memory::state` | 1 | −1 after going down by several d, +1 after going up; 0 at the start |
//! | d | `distance` | m or rad | distance over which it turns round, > 0 |
//!
//! Valid from rest to slow motion; solved exactly for a motion that keeps its way between two moments.
//! Source: P. R. Dahl, A Solid Friction Model, Aerospace Corporation, 1968, with the exponent 1.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, presliding_friction::PreslidingFriction};
//! let (law, mut memory) = (PreslidingFriction { distance: 1.0 }, Memory::default());
//! let mut at = |position: f64| law.basis(&CoordinateSample { position, ..CoordinateSample::default() }, &mut memory);
//! let last = [0.0, 90.0, 3.0].map(&mut at)[2];
//! assert!((last - (-1.0)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per, ShapeParameter};
use crate::real::Real;

/// Friction that turns round over a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreslidingFriction<T: Real> {
    /// Presliding distance, m or rad.
    pub distance: T,
}

impl<T: Real> BasisLaw<T> for PreslidingFriction<T> {
    fn name(&self) -> LawName {
        LawName::PreslidingFriction
    }

    fn per(&self) -> &'static [Per] {
        &[]
    }

    fn coefficient(&self) -> &'static str {
        "level"
    }

    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        Some(ShapeParameter { name: "presliding distance", value: self.distance, per: Per::Length })
    }

    fn takes_power(&self) -> bool {
        true
    }

    fn basis(&self, now: &CoordinateSample<T>, memory: &mut Memory<T>) -> T {
        memory.presliding_state(now.position, self.distance)
    }
}
