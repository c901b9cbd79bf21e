//! Compliance: a joint that gives way to its load at once.
//!
//! # Model
//!
//! e = c·L
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | L | `Moment::load` | its own | load, with its sign |
//!
//! Valid within the linear range of gear and bearing.
//! Source: Hooke's law.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::along::{Along, Memory, Moment, compliance::Compliance};
//! let law = Compliance;
//! let now = Moment { load: 3.0, ..Moment::default() };
//! assert!((law.shape(&now, &mut Memory::default()) - (3.0f64)).abs() < 1e-12);
//! ```

use super::{Along, LawName, Memory, Moment, Per};
use crate::real::Real;

/// A joint that gives way to its load at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliance;

impl<T: Real> Along<T> for Compliance {
    fn name(&self) -> LawName {
        LawName::JointCompliance
    }

    fn per(&self) -> &'static [Per] {
        &[Per::Load]
    }

    fn size(&self) -> &'static str {
        "compliance"
    }

    fn shape(&self, now: &Moment<T>, _memory: &mut Memory<T>) -> T {
        now.load
    }
}
