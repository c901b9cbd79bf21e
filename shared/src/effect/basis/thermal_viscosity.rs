//! Viscous friction that changes with temperature, as that of grease.
//!
//! # Model
//!
//! f = c·v·Δϑ
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | v | `Moment::velocity` | m/s or rad/s | velocity |
//! | Δϑ | `Moment::temperature_rise_k` | K | temperature less that of reference |
//!
//! Valid beside `viscous_friction`, near the temperature of reference; c is negative of grease.
//! Source: first order of the Andrade–Reynolds law of viscosity.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::along::{Along, Memory, Moment, thermal_viscosity::ThermalViscosity};
//! let law = ThermalViscosity;
//! let now = Moment { velocity: 2.0, temperature_rise_k: 10.0, ..Moment::default() };
//! assert!((law.shape(&now, &mut Memory::default()) - (20.0f64)).abs() < 1e-12);
//! ```

use super::{Along, LawName, Memory, Moment, Per};
use crate::real::Real;

/// Viscous friction that changes with temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThermalViscosity;

impl<T: Real> Along<T> for ThermalViscosity {
    fn name(&self) -> LawName {
        LawName::ThermalViscosity
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Speed, Per::Kelvin]
    }

    fn size(&self) -> &'static str {
        "slope"
    }

    fn shape(&self, now: &Moment<T>, _memory: &mut Memory<T>) -> T {
        now.velocity * now.temperature_rise_k
    }
}
