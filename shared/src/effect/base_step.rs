//! Base step: the arm, or the camera that looks at it, is moved at one moment, and stays where it was moved to.
//!
//! # Model
//!
//! T = T₀            before t₀
//! T = M·T₀, M = (exp(ω), v)       from t₀ on, and where no time is known
//!
//! | symbol | field        | unit   | meaning                                             |
//! |--------|--------------|--------|-----------------------------------------------------|
//! | T₀     | `predicted`  | m, rad | pose of the tool in the base where it was at first  |
//! | ω      | `values` 0–2 | rad    | rotation vector of the motion                       |
//! | v      | `values` 3–5 | m      | its translation                                     |
//! | t      | `Condition::time_s` | s | since the measurement began                       |
//! | t₀     | `since_s`    | s      | when it was moved                                   |
//!
//! Frame: ω and v are expressed in the frame where the base was at first.
//! Valid for one motion. On a planar arm ω_x, ω_y and v_z are not determined. Loads are those of the arm in its first place.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::{Condition, Law, base_step::BaseStep};
//! use darm_core::se::Pose;
//! let law = BaseStep { since_s: 40.0, values: [0.0, 0.0, 0.0, 1e-3, 0.0, 0.0] };
//! let seen = |time_s| {
//!     let at = Condition { time_s, ..Condition::of_word("01".parse().unwrap()) };
//!     law.displace(Pose::identity(), &at).position.x
//! };
//! assert_eq!((seen(Some(39.0)), seen(Some(40.0)), seen(None)), (0.0, 1e-3, 1e-3));
//! ```

use super::frame_offset::OF_DISPLACEMENT;
use super::{Condition, Detail, Law, LawName, Place, Quantity};
use crate::real::{Real, Vec3, real};
use crate::se::Pose;

/// A base that was moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseStep<T: Real> {
    /// When, s since the measurement began.
    pub since_s: T,
    /// Rotation vector, rad, and translation, m.
    pub values: [T; 6],
}

impl<T: Real> Law<T> for BaseStep<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        let is_base = (place, detail) == (Place::Base, Detail::All);
        is_base.then_some(Self { since_s: T::zero(), values: [T::zero(); 6] })
    }

    fn name(&self) -> LawName {
        LawName::BaseStep
    }

    fn place(&self) -> Place {
        Place::Base
    }

    fn quantities(&self) -> &'static [Quantity] {
        &OF_DISPLACEMENT
    }

    fn values(&self) -> &[T] {
        &self.values
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    fn constant(&self) -> Option<(Quantity, T)> {
        Some((Quantity { name: "since", unit: "s" }, self.since_s))
    }

    fn constant_mut(&mut self) -> Option<&mut T> {
        Some(&mut self.since_s)
    }

    fn displace(&self, predicted: Pose<T>, condition: &Condition<T>) -> Pose<T> {
        if condition.time_s.is_some_and(|time_s| time_s < self.since_s) {
            return predicted;
        }
        let [rx, ry, rz, x, y, z] = self.values;
        Pose::new(&Vec3::new(rx, ry, rz), Vec3::new(x, y, z)) * predicted
    }
}

impl BaseStep<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> BaseStep<U> {
        BaseStep { since_s: real(self.since_s), values: self.values.map(real) }
    }
}
