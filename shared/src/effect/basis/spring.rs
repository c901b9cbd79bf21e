//! Spring: a force that grows with position, as that of a hose, a cable or a return spring.
//!
//! # Model
//!
//! f = k·x
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | x | `Moment::position` | m or rad | position |
//!
//! Valid within the spring's linear range; where it is slack at another position than zero there is an offset next to
//! it.
//! Source: Hooke's law.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::along::{Along, Memory, Moment, spring::Spring};
//! let law = Spring;
//! let now = Moment { position: 0.02, ..Moment::default() };
//! assert!((law.shape(&now, &mut Memory::default()) - (0.02f64)).abs() < 1e-12);
//! ```

use super::{Along, LawName, Memory, Moment, Per};
use crate::real::Real;

/// A force that grows with position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring;

impl<T: Real> Along<T> for Spring {
    fn name(&self) -> LawName {
        LawName::Spring
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Length]
    }

    fn size(&self) -> &'static str {
        "stiffness"
    }

    fn shape(&self, now: &Moment<T>, _memory: &mut Memory<T>) -> T {
        now.position
    }
}
