//! Wear of a friction: friction that changes with the way that was gone.
//!
//! # Model
//!
//! f = w·s·tanh(v/v₀), s = ∫|dx|
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | x | `CoordinateSample::position` | m or rad | position |
//! | v | `CoordinateSample::velocity` | m/s or rad/s | velocity |
//! | s | `Memory::state` | m or rad | way gone since the measurement began |
//! | v₀ | `creep_speed` | m/s or rad/s | speed at which it has turned round, > 0 |
//!
//! Valid beside `coulomb_friction`, whose level is that of the start.
//! Source: J. F. Archard, J. Appl. Phys. 24 (1953) 981: worn volume in proportion to the way.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, friction_wear::FrictionWear};
//! let (law, mut memory) = (FrictionWear { creep_speed: 0.01 }, Memory::default());
//! let mut at = |position: f64| law.basis(&CoordinateSample { position, velocity: 1.0, ..CoordinateSample::default() }, &mut memory);
//! let last = [0.0, 2.0, -1.0].map(&mut at)[2];
//! assert!((last - (5.0)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per, ShapeParameter};
use crate::real::{Real, tanh};

/// Friction that changes with the way that was gone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionWear<T: Real> {
    /// Creep speed, m/s or rad/s.
    pub creep_speed: T,
}

impl<T: Real> BasisLaw<T> for FrictionWear<T> {
    fn name(&self) -> LawName {
        LawName::FrictionWear
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Length]
    }

    fn coefficient(&self) -> &'static str {
        "slope"
    }

    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        Some(ShapeParameter { name: "creep speed", value: self.creep_speed, per: Per::Speed })
    }

    fn basis(&self, now: &CoordinateSample<T>, memory: &mut Memory<T>) -> T {
        memory.path_length(now.position) * tanh(now.velocity / self.creep_speed)
    }
}
