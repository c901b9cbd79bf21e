//! Presliding whose level grows with what presses on the contact.
//!
//! # Model
//!
//! f = µ·L·z, z as in `presliding_friction`
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | L | `Moment::load` | its own | size of what presses, ≥ 0 |
//! | d | `distance` | m or rad | distance over which it turns round, > 0 |
//!
//! Valid for seals that pressure presses on their bore.
//! Source: as `presliding_friction` and `load_dependent_friction`.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::along::{Along, Memory, Moment, load_dependent_presliding::LoadDependentPresliding};
//! let (law, mut memory) = (LoadDependentPresliding { distance: 1.0 }, Memory::default());
//! let mut at = |position: f64| law.shape(&Moment { position, load: 2.0, ..Moment::default() }, &mut memory);
//! let last = [0.0, 90.0, 3.0].map(&mut at)[2];
//! assert!((last - (-2.0)).abs() < 1e-12);
//! ```

use super::{Along, Constant, LawName, Memory, Moment, Per};
use crate::real::Real;

/// Presliding whose level grows with what presses on the contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadDependentPresliding<T: Real> {
    /// Presliding distance, m or rad.
    pub distance: T,
}

impl<T: Real> Along<T> for LoadDependentPresliding<T> {
    fn name(&self) -> LawName {
        LawName::LoadDependentPresliding
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Load]
    }

    fn size(&self) -> &'static str {
        "per load"
    }

    fn constant(&self) -> Option<Constant<T>> {
        Some(Constant { name: "presliding distance", value: self.distance, per: Per::Length })
    }

    fn shape(&self, now: &Moment<T>, memory: &mut Memory<T>) -> T {
        now.load.abs() * memory.turn(now.position, self.distance)
    }
}
