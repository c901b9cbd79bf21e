//! Scale: the camera's metre is not a metre.
//!
//! # Model
//!
//! p = (1 + s)·p₀
//!
//! | symbol | field       | unit | meaning                                        |
//! |--------|-------------|------|------------------------------------------------|
//! | p₀     | `predicted` | m    | ideal position of the tool in the base         |
//! | s      | `stretch`   | 1    | by how much too long a length is measured          |
//!
//! Frame: the base, which the camera's lengths are measured from. Orientations are not touched.
//! Valid for a focal length, a marker size or a calibration board that is off.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::{Condition, Law, scale::Scale};
//! use darm_core::real::Vec3;
//! use darm_core::se::Pose;
//! let law = Scale { stretch: 0.001 };
//! let condition = Condition::of_word("01".parse().unwrap());
//! // 2 m are measured as 2.002 m.
//! let measured: Vec3<f64> = law.displace(Pose::at(Vec3::new(0.0, 2.0, 0.0)), &condition).position;
//! assert!((measured.y - 2.002).abs() < 1e-15);
//! ```

use core::slice;

use super::{Condition, Detail, Law, LawName, Place, Quantity};
use crate::real::{Real, real};
use crate::se::Pose;

/// A camera whose scale is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale<T: Real> {
    /// By how much too long a length is measured, as a share of it.
    pub stretch: T,
}

impl<T: Real> Law<T> for Scale<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        ((place, detail) == (Place::Camera, Detail::All)).then_some(Self { stretch: T::zero() })
    }

    fn name(&self) -> LawName {
        LawName::Scale
    }

    fn place(&self) -> Place {
        Place::Camera
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "stretch", unit: "1" }]
    }

    fn values(&self) -> &[T] {
        slice::from_ref(&self.stretch)
    }

    fn values_mut(&mut self) -> &mut [T] {
        slice::from_mut(&mut self.stretch)
    }

    fn displace(&self, predicted: Pose<T>, _condition: &Condition<T>) -> Pose<T> {
        Pose { position: predicted.position * (T::one() + self.stretch), ..predicted }
    }
}

impl Scale<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Scale<U> {
        Scale { stretch: real(self.stretch) }
    }
}
