//! Delay: the measured channel comes late.
//!
//! # Model
//!
//! f = −δ·dL/dt, the first order of L(t − δ) − L(t)
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | dL/dt | `CoordinateSample::load_rate` | its own/s | rate of the channel |
//! | δ | size | s | by how much it is late |
//!
//! Valid where δ times the highest frequency of the channel is well below 1.
//! Source: Taylor's theorem.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, delay::Delay};
//! let law = Delay;
//! let now = CoordinateSample { load_rate: 3.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (-3.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per};
use crate::real::Real;

/// The measured channel comes late.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delay;

impl<T: Real> BasisLaw<T> for Delay {
    fn name(&self) -> LawName {
        LawName::Delay
    }

    fn per(&self) -> &'static [Per] {
        &[Per::LoadRate]
    }

    fn coefficient(&self) -> &'static str {
        "delay"
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        -now.load_rate
    }
}
