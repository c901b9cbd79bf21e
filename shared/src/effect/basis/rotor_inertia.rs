//! Rotor inertia: what the motor's own rotor and gear ask when they speed up.
//!
//! # Model
//!
//! τ = I_m·a
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | a | `CoordinateSample::acceleration` | m/s² or rad/s² | acceleration |
//! | I_m | size | kg·m² or kg | inertia of the rotor times the square of its gear ratio |
//!
//! Valid for gears so steep that the rotor's gyroscopic moments do not count.
//! Source: R. Featherstone, Rigid Body Dynamics Algorithms, 2008, 9.6.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, rotor_inertia::RotorInertia};
//! let law = RotorInertia;
//! let now = CoordinateSample { acceleration: 5.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (5.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per};
use crate::real::Real;

/// What the motor's own rotor and gear ask when they speed up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorInertia;

impl<T: Real> BasisLaw<T> for RotorInertia {
    fn name(&self) -> LawName {
        LawName::RotorInertia
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Acceleration]
    }

    fn coefficient(&self) -> &'static str {
        "inertia"
    }

    fn takes_power(&self) -> bool {
        true
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        now.acceleration
    }
}
