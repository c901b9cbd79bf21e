//! Spring: a force that grows with position, as that of a hose, a cable or a return spring.
//!
//! # Model
//!
//! f = k·x
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | x | `CoordinateSample::position` | m or rad | position |
//!
//! Valid within the spring's linear range; where it is slack at another position than zero there is an offset next to
//! it.
//! Source: Hooke's law.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, spring::Spring};
//! let law = Spring;
//! let now = CoordinateSample { position: 0.02, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (0.02f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per};
use crate::real::Real;

/// A force that grows with position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring;

impl<T: Real> BasisLaw<T> for Spring {
    fn name(&self) -> LawName {
        LawName::Spring
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Length]
    }

    fn coefficient(&self) -> &'static str {
        "stiffness"
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        now.position
    }
}
