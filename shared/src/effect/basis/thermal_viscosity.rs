//! Viscous friction that changes with temperature, as that of grease.
//!
//! # Model
//!
//! f = c·v·Δϑ
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | v | `CoordinateSample::velocity` | m/s or rad/s | velocity |
//! | Δϑ | `CoordinateSample::temperature_rise_k` | K | temperature less that of reference |
//!
//! Valid beside `viscous_friction`, near the temperature of reference; c is negative of grease.
//! Source: first order of the Andrade–Reynolds law of viscosity.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, thermal_viscosity::ThermalViscosity};
//! let law = ThermalViscosity;
//! let now = CoordinateSample { velocity: 2.0, temperature_rise_k: 10.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (20.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per};
use crate::real::Real;

/// Viscous friction that changes with temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThermalViscosity;

impl<T: Real> BasisLaw<T> for ThermalViscosity {
    fn name(&self) -> LawName {
        LawName::ThermalViscosity
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Speed, Per::Kelvin]
    }

    fn coefficient(&self) -> &'static str {
        "slope"
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        now.velocity * now.temperature_rise_k
    }
}
