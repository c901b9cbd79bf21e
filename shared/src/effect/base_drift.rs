//! Base drift: the arm creeps in the camera's frame, or the camera does.
//!
//! # Model
//!
//! T = D(t)·T₀, D = (exp(ω·t), v·t)
//!
//! | symbol | field        | unit  | meaning                                                   |
//! |--------|--------------|-------|-----------------------------------------------------------|
//! | T₀     | `predicted`  | m, rad | pose of the tool in the base where it stood at first     |
//! | ω      | `values` 0–2 | rad/s | rate of the rotation vector                               |
//! | v      | `values` 3–5 | m/s   | velocity                                                  |
//! | t      | `Condition::time_s` | s | time since the measurement began                      |
//! | t_end  | `until_s`    | s     | when the measurement ended: t where no time is known      |
//!
//! Frame: ω and v are expressed in the frame where the base was at first.
//! Valid for a slow motion of one speed; afterwards the base stays where it was at the end. On a planar arm ω_x, ω_y and
//! v_z are not determined. Loads are those of the arm in its first place.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::{Condition, Law, base_drift::BaseDrift};
//! use darm_core::se::Pose;
//! let law = BaseDrift { until_s: 200.0, values: [0.0, 0.0, 0.0, 1e-5, 0.0, 0.0] };
//! let seen = |time_s| {
//!     let at = Condition { time_s, ..Condition::of_word("01".parse().unwrap()) };
//!     law.displace(Pose::identity(), &at).position.x
//! };
//! assert!((seen(Some(100.0)) - 1e-3f64).abs() < 1e-15);
//! assert!((seen(None) - 2e-3).abs() < 1e-15);
//! ```

use super::{Condition, Detail, End, Law, LawName, Place, Quantity};
use crate::real::{Real, Vec3, real};
use crate::se::Pose;

/// A base that creeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseDrift<T: Real> {
    /// When the measurement ended that it was found in, s since it began.
    pub until_s: T,
    /// Rate of the rotation vector, rad/s, and velocity, m/s.
    pub values: [T; 6],
}

impl<T: Real> Law<T> for BaseDrift<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        let is_base = (place, detail) == (Place::Base, Detail::All);
        is_base.then_some(Self { until_s: T::zero(), values: [T::zero(); 6] })
    }

    fn name(&self) -> LawName {
        LawName::BaseDrift
    }

    fn place(&self) -> Place {
        Place::Base
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[
            Quantity { name: "turn_rate_x", unit: "rad/s" },
            Quantity { name: "turn_rate_y", unit: "rad/s" },
            Quantity { name: "turn_rate_z", unit: "rad/s" },
            Quantity { name: "rate_x", unit: "m/s" },
            Quantity { name: "rate_y", unit: "m/s" },
            Quantity { name: "rate_z", unit: "m/s" },
        ]
    }

    fn values(&self) -> &[T] {
        &self.values
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    fn constant(&self) -> Option<(Quantity, T)> {
        Some((Quantity { name: "until", unit: "s" }, self.until_s))
    }

    fn constant_mut(&mut self) -> Option<&mut T> {
        Some(&mut self.until_s)
    }

    fn settle(&mut self, end: &End<T>) {
        self.until_s = end.time_s;
    }

    fn displace(&self, predicted: Pose<T>, condition: &Condition<T>) -> Pose<T> {
        let time_s = condition.time_s.unwrap_or(self.until_s);
        let [rx, ry, rz, x, y, z] = self.values.map(|rate| rate * time_s);
        Pose::new(&Vec3::new(rx, ry, rz), Vec3::new(x, y, z)) * predicted
    }
}

impl BaseDrift<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> BaseDrift<U> {
        BaseDrift { until_s: real(self.until_s), values: self.values.map(real) }
    }
}
