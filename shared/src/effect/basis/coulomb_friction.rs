//! Coulomb friction: a force of one size against motion, which turns round over a creep speed.
//!
//! # Model
//!
//! f = f_c·tanh(v/v₀)
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | v | `CoordinateSample::velocity` | m/s or rad/s | velocity |
//! | v₀ | `creep_speed` | m/s or rad/s | speed at which it has turned round to 76 %, > 0 |
//!
//! Valid in motion; at rest it gives no holding force (see `presliding_friction`).
//! Source: C. A. Coulomb, Théorie des machines simples, 1785; smoothed as B. Armstrong-Hélouvry, P. Dupont, C.
//! Canudas de Wit, Automatica 30 (1994) 1083.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, coulomb_friction::CoulombFriction};
//! let law = CoulombFriction { creep_speed: 0.01 };
//! let now = CoordinateSample { velocity: -1.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (-1.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per, ShapeParameter};
use crate::real::{Real, tanh};

/// A force of one size against motion, which turns round over a creep speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoulombFriction<T: Real> {
    /// Creep speed, m/s or rad/s.
    pub creep_speed: T,
}

impl<T: Real> BasisLaw<T> for CoulombFriction<T> {
    fn name(&self) -> LawName {
        LawName::CoulombFriction
    }

    fn per(&self) -> &'static [Per] {
        &[]
    }

    fn coefficient(&self) -> &'static str {
        "level"
    }

    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        Some(ShapeParameter { name: "creep speed", value: self.creep_speed, per: Per::Speed })
    }

    fn takes_power(&self) -> bool {
        true
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        tanh(now.velocity / self.creep_speed)
    }
}
