//! Friction that grows with what presses on the contact: a pressure on a seal, a torque on a gear.
//!
//! # Model
//!
//! f = µ·L·tanh(v/v₀)
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | v | `Moment::velocity` | m/s or rad/s | velocity |
//! | L | `Moment::load` | its own | size of what presses, ≥ 0 |
//! | v₀ | `creep_speed` | m/s or rad/s | speed at which it has turned round, > 0 |
//!
//! Valid in motion; of a gear L is the size of the torque that it passes on.
//! Source: G. Amontons, Mém. Acad. R. Sci. 1699, 206.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::along::{Along, Memory, Moment, load_dependent_friction::LoadDependentFriction};
//! let law = LoadDependentFriction { creep_speed: 0.01 };
//! let now = Moment { velocity: 1.0, load: 4.0, ..Moment::default() };
//! assert!((law.shape(&now, &mut Memory::default()) - (4.0f64)).abs() < 1e-12);
//! ```

use super::{Along, Constant, LawName, Memory, Moment, Per};
use crate::real::{Real, tanh};

/// A pressure on a seal, a torque on a gear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadDependentFriction<T: Real> {
    /// Creep speed, m/s or rad/s.
    pub creep_speed: T,
}

impl<T: Real> Along<T> for LoadDependentFriction<T> {
    fn name(&self) -> LawName {
        LawName::LoadDependentFriction
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Load]
    }

    fn size(&self) -> &'static str {
        "per load"
    }

    fn constant(&self) -> Option<Constant<T>> {
        Some(Constant { name: "creep speed", value: self.creep_speed, per: Per::Speed })
    }

    fn takes_power(&self) -> bool {
        true
    }

    fn shape(&self, now: &Moment<T>, _memory: &mut Memory<T>) -> T {
        now.load.abs() * tanh(now.velocity / self.creep_speed)
    }
}
