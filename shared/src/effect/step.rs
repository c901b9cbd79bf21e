//! Step: an actuator is knocked in its clamps at one moment, and stays where it was knocked to.
//!
//! # Model
//!
//! l = l₀            before t₀
//! l = l₀ + s        from t₀ on, and where no time is known
//!
//! | symbol | field            | unit | meaning                                                       |
//! |--------|------------------|------|---------------------------------------------------------------|
//! | l₀     | `Setting::value` | m    | length before the knock                                       |
//! | s      | `shift_m`        | m    | by how much the actuator is longer in every state, since then |
//! | t      | `Site::time_s`   | s    | since the measurement began                                   |
//! | t₀     | `since_s`        | s    | when it was knocked                                           |
//!
//! Frame: a scalar along the actuator; of a revolute joint l and s are angles in rad.
//! Valid for one knock; a table that is made later lies after it.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Site, step::Step};
//! let law = Step { actuator: 0, since_s: 40.0, shift_m: 0.002 };
//! let length_m = |time_s| {
//!     let mut leg = Setting::of_joint(1.25);
//!     law.disturb(&Site { time_s, ..Site::default() }, &mut leg);
//!     leg.value
//! };
//! assert_eq!(length_m(Some(39.0)), 1.25);
//! // 1.25 m + 2 mm
//! assert_eq!((length_m(Some(40.0)), length_m(None)), (1.252, 1.252));
//! ```

use core::slice;

use super::{Detail, Law, LawName, Place, Quantity, Site};
use crate::actuator::Setting;
use crate::real::{Real, real};

/// An actuator that was knocked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step<T: Real> {
    /// Index of the actuator.
    pub actuator: u8,
    /// When, s since the measurement began.
    pub since_s: T,
    /// By how much it is longer since, m (rad).
    pub shift_m: T,
}

impl<T: Real> Law<T> for Step<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        match (place, detail) {
            (Place::Actuator(actuator), Detail::All) => Some(Self { actuator, since_s: T::zero(), shift_m: T::zero() }),
            _ => None,
        }
    }

    fn name(&self) -> LawName {
        LawName::Step
    }

    fn place(&self) -> Place {
        Place::Actuator(self.actuator)
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "shift", unit: "m" }]
    }

    fn values(&self) -> &[T] {
        slice::from_ref(&self.shift_m)
    }

    fn values_mut(&mut self) -> &mut [T] {
        slice::from_mut(&mut self.shift_m)
    }

    fn constant(&self) -> Option<(Quantity, T)> {
        Some((Quantity { name: "since", unit: "s" }, self.since_s))
    }

    fn constant_mut(&mut self) -> Option<&mut T> {
        Some(&mut self.since_s)
    }

    fn disturb(&self, site: &Site<T>, setting: &mut Setting<T>) {
        if site.time_s.is_none_or(|time_s| time_s >= self.since_s) {
            setting.value += self.shift_m;
        }
    }
}

impl Step<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Step<U> {
        Step { actuator: self.actuator, since_s: real(self.since_s), shift_m: real(self.shift_m) }
    }
}
