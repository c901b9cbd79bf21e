//! Periodic error of a gear or an encoder, the part that is largest at position zero.
//!
//! # Model
//!
//! f = c·cos(n·q)
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | q | `CoordinateSample::position` | rad | position |
//! | n | `per_turn` | 1 | periods a turn, > 0 |
//!
//! Valid for one harmonic; with `periodic_sine` for any phase.
//! Source: Fourier.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, periodic_cosine::PeriodicCosine};
//! let law = PeriodicCosine { per_turn: 2.0 };
//! let now = CoordinateSample { position: 0.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (1.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per, ShapeParameter};
use crate::real::{Real, cos};

/// Periodic error of a gear or an encoder, the part that is largest at position zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeriodicCosine<T: Real> {
    /// Periods a turn, a plain number.
    pub per_turn: T,
}

impl<T: Real> BasisLaw<T> for PeriodicCosine<T> {
    fn name(&self) -> LawName {
        LawName::GearPeriodicCosine
    }

    fn per(&self) -> &'static [Per] {
        &[]
    }

    fn coefficient(&self) -> &'static str {
        "cosine"
    }

    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        Some(ShapeParameter { name: "periods a turn", value: self.per_turn, per: Per::One })
    }

    fn basis(&self, now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        cos(now.position * self.per_turn)
    }
}
