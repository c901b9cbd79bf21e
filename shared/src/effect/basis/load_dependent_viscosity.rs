//! Viscous friction that grows with load, as that of a seal under pressure.
//!
//! # Model
//!
//! f = b·L·v
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | v | `Moment::velocity` | m/s or rad/s | velocity |
//! | L | `Moment::load` | its own | what presses |
//!
//! Valid beside `viscous_friction`.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::along::{Along, Memory, Moment, load_dependent_viscosity::LoadDependentViscosity};
//! let law = LoadDependentViscosity;
//! let now = Moment { velocity: 2.0, load: 3.0, ..Moment::default() };
//! assert!((law.shape(&now, &mut Memory::default()) - (6.0f64)).abs() < 1e-12);
//! ```

use super::{Along, LawName, Memory, Moment, Per};
use crate::real::Real;

/// Viscous friction that grows with load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadDependentViscosity;

impl<T: Real> Along<T> for LoadDependentViscosity {
    fn name(&self) -> LawName {
        LawName::LoadDependentViscosity
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Speed, Per::Load]
    }

    fn size(&self) -> &'static str {
        "coefficient"
    }

    fn shape(&self, now: &Moment<T>, _memory: &mut Memory<T>) -> T {
        now.load * now.velocity
    }
}
