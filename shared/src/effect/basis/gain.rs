//! Gain: a current-to-torque constant or a sensor's scale that is off.
//!
//! # Model
//!
//! f = g·L
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | L | `CoordinateSample::load` | its own | ideal force or torque, with its sign |
//! | g | size | 1 | share by which the true constant is larger |
//!
//! Valid where current and torque are in proportion; a motor near saturation is not.
//! Source: definition of the torque constant.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, gain::Gain};
//! let law = Gain;
//! let now = CoordinateSample { load: -4.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (-4.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per};
use crate::real::Real;

/// A current-to-torque constant or a sensor's scale that is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain;

impl<T: Real> BasisLaw<T> for Gain {
    fn name(&self) -> LawName {
        LawName::Gain
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Load]
    }

    fn coefficient(&self) -> &'static str {
        "gain"
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        now.load
    }
}
