//! Friction that grows with what presses on the contact: a pressure on a seal, a torque on a gear.
//!
//! # Model
//!
//! f = µ·L·tanh(v/v₀)
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | v | `CoordinateSample::velocity` | m/s or rad/s | velocity |
//! | L | `CoordinateSample::load` | its own | size of what presses, ≥ 0 |
//! | v₀ | `creep_speed` | m/s or rad/s | speed at which it has turned round, > 0 |
//!
//! Valid in motion; of a gear L is the size of the torque that it passes on.
//! Source: G. Amontons, Mém. Acad. R. Sci. 1699, 206.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, load_dependent_friction::LoadDependentFriction};
//! let law = LoadDependentFriction { creep_speed: 0.01 };
//! let now = CoordinateSample { velocity: 1.0, load: 4.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (4.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per, ShapeParameter};
use crate::real::{Real, tanh};

/// A pressure on a seal, a torque on a gear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadDependentFriction<T: Real> {
    /// Creep speed, m/s or rad/s.
    pub creep_speed: T,
}

impl<T: Real> BasisLaw<T> for LoadDependentFriction<T> {
    fn name(&self) -> LawName {
        LawName::LoadDependentFriction
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Load]
    }

    fn coefficient(&self) -> &'static str {
        "per load"
    }

    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        Some(ShapeParameter { name: "creep speed", value: self.creep_speed, per: Per::Speed })
    }

    fn takes_power(&self) -> bool {
        true
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        now.load.abs() * tanh(now.velocity / self.creep_speed)
    }
}
