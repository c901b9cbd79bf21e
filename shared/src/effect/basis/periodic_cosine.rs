//! Periodic error of a gear or an encoder, the part that is largest at position zero.
//!
//! # Model
//!
//! f = c·cos(n·q)
//!
//! | symbol | field | unit | meaning |
//! |---|---|---|---|
//! | q | `Moment::position` | rad | position |
//! | n | `per_turn` | 1 | periods a turn, > 0 |
//!
//! Valid for one harmonic; with `periodic_sine` for any phase.
//! Source: Fourier.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::along::{Along, Memory, Moment, periodic_cosine::PeriodicCosine};
//! let law = PeriodicCosine { per_turn: 2.0 };
//! let now = Moment { position: 0.0, ..Moment::default() };
//! assert!((law.shape(&now, &mut Memory::default()) - (1.0f64)).abs() < 1e-12);
//! ```

use super::{Along, Constant, LawName, Memory, Moment, Per};
use crate::real::{Real, cos};

/// Periodic error of a gear or an encoder, the part that is largest at position zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeriodicCosine<T: Real> {
    /// Periods a turn, a plain number.
    pub per_turn: T,
}

impl<T: Real> Along<T> for PeriodicCosine<T> {
    fn name(&self) -> LawName {
        LawName::GearPeriodicCosine
    }

    fn per(&self) -> &'static [Per] {
        &[]
    }

    fn size(&self) -> &'static str {
        "cosine"
    }

    fn constant(&self) -> Option<Constant<T>> {
        Some(Constant { name: "periods a turn", value: self.per_turn, per: Per::One })
    }

    fn shape(&self, now: &Moment<T>, _memory: &mut Memory<T>) -> T {
        cos(now.position * self.per_turn)
    }
}
