//! Offset: a force or torque that is always there, as that of a load cell or a current sensor that is not zero at
//! rest.
//!
//! # Model
//!
//! f = f₀
//!
//! Valid where the offset does not move with time or temperature; see `drift` and `thermal_drift` where it does.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::along::{Along, Memory, Moment, force_offset::ForceOffset};
//! let law = ForceOffset;
//! let now = Moment { velocity: 3.0, ..Moment::default() };
//! assert!((law.shape(&now, &mut Memory::default()) - (1.0f64)).abs() < 1e-12);
//! ```

use super::{Along, Memory, Moment, Per};
use crate::real::Real;

/// See the module's documentation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceOffset;

impl<T: Real> Along<T> for ForceOffset {
    fn name(&self) -> &'static str {
        "force-offset"
    }

    fn per(&self) -> &'static [Per] {
        &[]
    }

    fn shape(&self, _now: &Moment<T>, _memory: &mut Memory<T>) -> T {
        T::one()
    }
}

impl ForceOffset {
    /// The same law: it has no number.
    pub fn cast<U>(&self) -> Self {
        *self
    }
}
