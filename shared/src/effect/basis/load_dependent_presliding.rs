//! Presliding whose level grows with what presses on the contact.
//!
//! # Model
//!
//! f = µ·L·z, z as in `presliding_friction`
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | L | `CoordinateSample::load` | its own | size of what presses, ≥ 0 |
//! | d | `distance` | m or rad | distance over which it turns round, > 0 |
//!
//! Valid for seals that pressure presses on their bore.
//! Source: as `presliding_friction` and `load_dependent_friction`.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, load_dependent_presliding::LoadDependentPresliding};
//! let (law, mut memory) = (LoadDependentPresliding { distance: 1.0 }, Memory::default());
//! let mut at = |position: f64| law.basis(&CoordinateSample { position, load: 2.0, ..CoordinateSample::default() }, &mut memory);
//! let last = [0.0, 90.0, 3.0].map(&mut at)[2];
//! assert!((last - (-2.0)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per, ShapeParameter};
use crate::real::Real;

/// Presliding whose level grows with what presses on the contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadDependentPresliding<T: Real> {
    /// Presliding distance, m or rad.
    pub distance: T,
}

impl<T: Real> BasisLaw<T> for LoadDependentPresliding<T> {
    fn name(&self) -> LawName {
        LawName::LoadDependentPresliding
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Load]
    }

    fn coefficient(&self) -> &'static str {
        "per load"
    }

    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        Some(ShapeParameter { name: "presliding distance", value: self.distance, per: Per::Length })
    }

    fn basis(&self, now: &CoordinateSample<T>, memory: &mut Memory<T>) -> T {
        now.load.abs() * memory.presliding_state(now.position, self.distance)
    }
}
