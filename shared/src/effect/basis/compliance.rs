//! Compliance: a joint that gives way to its load at once.
//!
//! # Model
//!
//! e = c·L
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | L | `CoordinateSample::load` | its own | load, with its sign |
//!
//! Valid within the linear range of gear and bearing.
//! Source: Hooke's law.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, compliance::Compliance};
//! let law = Compliance;
//! let now = CoordinateSample { load: 3.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (3.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per};
use crate::real::Real;

/// A joint that gives way to its load at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliance;

impl<T: Real> BasisLaw<T> for Compliance {
    fn name(&self) -> LawName {
        LawName::JointCompliance
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Load]
    }

    fn coefficient(&self) -> &'static str {
        "compliance"
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        now.load
    }
}
