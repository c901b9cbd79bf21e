//! Thermal drift: an offset that moves with temperature.
//!
//! # Model
//!
//! f = c·Δϑ
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | Δϑ | `Moment::temperature_rise_k` | K | temperature less that of reference |
//!
//! Valid near the temperature of reference.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::along::{Along, Memory, Moment, thermal_drift::ThermalDrift};
//! let law = ThermalDrift;
//! let now = Moment { temperature_rise_k: 10.0, ..Moment::default() };
//! assert!((law.shape(&now, &mut Memory::default()) - (10.0f64)).abs() < 1e-12);
//! ```

use super::{Along, LawName, Memory, Moment, Per};
use crate::real::Real;

/// An offset that moves with temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThermalDrift;

impl<T: Real> Along<T> for ThermalDrift {
    fn name(&self) -> LawName {
        LawName::ThermalDrift
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Kelvin]
    }

    fn size(&self) -> &'static str {
        "slope"
    }

    fn shape(&self, now: &Moment<T>, _memory: &mut Memory<T>) -> T {
        now.temperature_rise_k
    }
}
