//! Viscous friction that grows with load, as that of a seal under pressure.
//!
//! # Model
//!
//! f = b·L·v
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | v | `CoordinateSample::velocity` | m/s or rad/s | velocity |
//! | L | `CoordinateSample::load` | its own | what presses |
//!
//! Valid beside `viscous_friction`.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, load_dependent_viscosity::LoadDependentViscosity};
//! let law = LoadDependentViscosity;
//! let now = CoordinateSample { velocity: 2.0, load: 3.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (6.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per};
use crate::real::Real;

/// Viscous friction that grows with load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadDependentViscosity;

impl<T: Real> BasisLaw<T> for LoadDependentViscosity {
    fn name(&self) -> LawName {
        LawName::LoadDependentViscosity
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Speed, Per::Load]
    }

    fn coefficient(&self) -> &'static str {
        "coefficient"
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        now.load * now.velocity
    }
}
