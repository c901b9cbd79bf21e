//! Delay: the measured channel comes late.
//!
//! # Model
//!
//! f = −δ·dL/dt, the first order of L(t − δ) − L(t)
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | dL/dt | `Moment::load_rate` | its own/s | rate of the channel |
//! | δ | size | s | by how much it is late |
//!
//! Valid where δ times the highest frequency of the channel is well below 1.
//! Source: Taylor's theorem.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::along::{Along, Memory, Moment, delay::Delay};
//! let law = Delay;
//! let now = Moment { load_rate: 3.0, ..Moment::default() };
//! assert!((law.shape(&now, &mut Memory::default()) - (-3.0f64)).abs() < 1e-12);
//! ```

use super::{Along, LawName, Memory, Moment, Per};
use crate::real::Real;

/// The measured channel comes late.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delay;

impl<T: Real> Along<T> for Delay {
    fn name(&self) -> LawName {
        LawName::Delay
    }

    fn per(&self) -> &'static [Per] {
        &[Per::LoadRate]
    }

    fn size(&self) -> &'static str {
        "delay"
    }

    fn shape(&self, now: &Moment<T>, _memory: &mut Memory<T>) -> T {
        -now.load_rate
    }
}
