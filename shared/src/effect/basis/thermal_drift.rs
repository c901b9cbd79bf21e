//! Thermal drift: an offset that moves with temperature.
//!
//! # Model
//!
//! f = c·Δϑ
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | Δϑ | `CoordinateSample::temperature_rise_k` | K | temperature less that of reference |
//!
//! Valid near the temperature of reference.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, thermal_drift::ThermalDrift};
//! let law = ThermalDrift;
//! let now = CoordinateSample { temperature_rise_k: 10.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (10.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per};
use crate::real::Real;

/// An offset that moves with temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThermalDrift;

impl<T: Real> BasisLaw<T> for ThermalDrift {
    fn name(&self) -> LawName {
        LawName::ThermalDrift
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Kelvin]
    }

    fn coefficient(&self) -> &'static str {
        "slope"
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        now.temperature_rise_k
    }
}
