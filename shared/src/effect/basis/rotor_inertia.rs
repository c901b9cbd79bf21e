//! Rotor inertia: what the motor's own rotor and gear ask when they speed up.
//!
//! # Model
//!
//! τ = I_m·a
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | a | `Moment::acceleration` | m/s² or rad/s² | acceleration |
//! | I_m | size | kg·m² or kg | inertia of the rotor times the square of its gear ratio |
//!
//! Valid for gears so steep that the rotor's gyroscopic moments do not count.
//! Source: R. Featherstone, Rigid Body Dynamics Algorithms, 2008, 9.6.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::along::{Along, Memory, Moment, rotor_inertia::RotorInertia};
//! let law = RotorInertia;
//! let now = Moment { acceleration: 5.0, ..Moment::default() };
//! assert!((law.shape(&now, &mut Memory::default()) - (5.0f64)).abs() < 1e-12);
//! ```

use super::{Along, LawName, Memory, Moment, Per};
use crate::real::Real;

/// What the motor's own rotor and gear ask when they speed up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorInertia;

impl<T: Real> Along<T> for RotorInertia {
    fn name(&self) -> LawName {
        LawName::RotorInertia
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Acceleration]
    }

    fn size(&self) -> &'static str {
        "inertia"
    }

    fn takes_power(&self) -> bool {
        true
    }

    fn shape(&self, now: &Moment<T>, _memory: &mut Memory<T>) -> T {
        now.acceleration
    }
}
