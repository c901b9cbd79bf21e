//! Offset: a force or torque that is always there, as that of a load cell or a current sensor that is not zero at
//! rest.
//!
//! # Model
//!
//! f = f₀
//!
//! Valid where the offset does not move with time or temperature; see `offset_drift` and `thermal_drift` where it does.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{BasisLaw, Memory, CoordinateSample, offset::Offset};
//! let law = Offset;
//! let now = CoordinateSample { velocity: 3.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (1.0f64)).abs() < 1e-12);
//! ```

use super::{BasisLaw, CoordinateSample, LawName, Memory, Per};
use crate::real::Real;

/// A force or torque that is always there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset;

impl<T: Real> BasisLaw<T> for Offset {
    fn name(&self) -> LawName {
        LawName::Offset
    }

    fn per(&self) -> &'static [Per] {
        &[]
    }

    fn coefficient(&self) -> &'static str {
        "offset"
    }

    fn basis(&self, _now: &CoordinateSample<T>, _memory: &mut Memory<T>) -> T {
        T::one()
    }
}
