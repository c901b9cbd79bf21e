//! Stribeck friction: what friction has more at creep than at speed.
//!
//! # Model
//!
//! f = f_s·tanh(v/v₀)·exp(−|v|/v_s), v₀ = v_s/10
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | v | `CoordinateSample::velocity` | m/s or rad/s | velocity |
//! | v_s | `fall_speed` | m/s or rad/s | speed at which 37 % is left, > 0 |
//!
//! Valid beside `coulomb_friction`, whose level is what is left at speed.
//! Source: R. Stribeck, Z. VDI 46 (1902) 1341; form of L. C. Bo, D. Pavelescu, Wear 82 (1982) 277 with the exponent
//! 1.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, stribeck_friction::StribeckFriction};
//! let law = StribeckFriction { fall_speed: 0.1 };
//! let now = CoordinateSample { velocity: 5.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (0.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per, ShapeParameter};
use crate::real::{Real, exp, real, tanh};

/// What friction has more at creep than at speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StribeckFriction<T: Real> {
    /// Speed of fall, m/s or rad/s.
    pub fall_speed: T,
}

impl<T: Real> BasisLaw<T> for StribeckFriction<T> {
    fn name(&self) -> LawName {
        LawName::StribeckFriction
    }

    fn per(&self) -> &'static [Per] {
        &[]
    }

    fn coefficient(&self) -> &'static str {
        "level"
    }

    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        Some(ShapeParameter { name: "speed of fall", value: self.fall_speed, per: Per::Speed })
    }

    fn takes_power(&self) -> bool {
        true
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        tanh(now.velocity * real(10.0) / self.fall_speed) * exp(-now.velocity.abs() / self.fall_speed)
    }
}
