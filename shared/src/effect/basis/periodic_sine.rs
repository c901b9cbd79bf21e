//! Periodic error of a gear or an encoder, the part that is zero at position zero.
//!
//! # Model
//!
//! f = s·sin(n·q)
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | q | `CoordinateSample::position` | rad | position |
//! | n | `per_turn` | 1 | periods a turn, > 0 |
//!
//! Valid for one harmonic; with `periodic_cosine` for any phase.
//! Source: Fourier.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, periodic_sine::PeriodicSine};
//! let law = PeriodicSine { per_turn: 1.0 };
//! let now = CoordinateSample { position: core::f64::consts::FRAC_PI_2, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (1.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per, ShapeParameter};
use crate::real::{Real, sin};

/// Periodic error of a gear or an encoder, the part that is zero at position zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeriodicSine<T: Real> {
    /// Periods a turn, a plain number.
    pub per_turn: T,
}

impl<T: Real> BasisLaw<T> for PeriodicSine<T> {
    fn name(&self) -> LawName {
        LawName::GearPeriodicSine
    }

    fn per(&self) -> &'static [Per] {
        &[]
    }

    fn coefficient(&self) -> &'static str {
        "sine"
    }

    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        Some(ShapeParameter { name: "periods a turn", value: self.per_turn, per: Per::One })
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        sin(now.position * self.per_turn)
    }
}
