//! Viscous friction: a force against motion that grows with speed.
//!
//! # Model
//!
//! f = b·v
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | v | `CoordinateSample::velocity` | m/s or rad/s | velocity |
//!
//! Valid for lubricated contacts at one temperature; a real bearing's rises less than in proportion at high speed.
//! Source: O. Reynolds, Phil. Trans. R. Soc. 177 (1886) 157, of a lubricant film.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, viscous_friction::ViscousFriction};
//! let law = ViscousFriction;
//! let now = CoordinateSample { velocity: -2.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (-2.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per};
use crate::real::Real;

/// A force against motion that grows with speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViscousFriction;

impl<T: Real> BasisLaw<T> for ViscousFriction {
    fn name(&self) -> LawName {
        LawName::ViscousFriction
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Speed]
    }

    fn coefficient(&self) -> &'static str {
        "coefficient"
    }

    fn takes_power(&self) -> bool {
        true
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        now.velocity
    }
}
