//! Interaction: one actuator changes the length of another while both are out of their first state, as two cylinders on
//! one bracket that bends do.
//!
//! # Model
//!
//! l = l₀ + s                     where the digits of both are above 0
//! l = l₀                         everywhere else
//!
//! | symbol | field            | unit | meaning                                                  |
//! |--------|------------------|------|----------------------------------------------------------|
//! | l₀     | `Setting::value` | m    | length of the actuator where the other one is in state 0 |
//! | s      | `shift_m`        | m    | by how much it is longer where the other one is not      |
//!
//! Frame: a scalar along the actuator; of a revolute joint l and s are angles in rad.
//! Valid where only the states of both decide, not the order in which they switched; that is [`crowding`](super::crowding).
//! Source: definition, as the simplest term of two digits.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Site, interaction::Interaction};
//! let law = Interaction { actuator: 0, other: 1, shift_m: -0.002 };
//! let length_m = |word: &str| {
//!     let mut leg = Setting::of_joint(1.25);
//!     let word = word.parse().unwrap();
//!     law.disturb(&Site { digit: 1, word: Some(word), ..Site::default() }, &mut leg);
//!     leg.value
//! };
//! assert_eq!((length_m("10"), length_m("11")), (1.25, 1.248));
//! ```

use core::slice;

use super::{Detail, Law, LawName, Place, Quantity, Site};
use crate::actuator::Setting;
use crate::real::{Real, real};

/// An actuator that another one acts on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interaction<T: Real> {
    /// Index of the actuator whose length changes.
    pub actuator: u8,
    /// Index of the one that changes it.
    pub other: u8,
    /// By how much it is longer, m (rad).
    pub shift_m: T,
}

impl<T: Real> Law<T> for Interaction<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        match (place, detail) {
            (Place::Actuator(actuator), Detail::With(other)) if actuator != other => {
                Some(Self { actuator, other, shift_m: T::zero() })
            }
            _ => None,
        }
    }

    fn name(&self) -> LawName {
        LawName::Interaction
    }

    fn place(&self) -> Place {
        Place::Actuator(self.actuator)
    }

    fn detail(&self) -> Detail {
        Detail::With(self.other)
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

    fn disturb(&self, site: &Site<T>, setting: &mut Setting<T>) {
        let other = site.word.map_or(0, |word| word.digit(self.other.into()));
        if site.digit > 0 && other > 0 {
            setting.value += self.shift_m;
        }
    }
}

impl Interaction<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Interaction<U> {
        Interaction { actuator: self.actuator, other: self.other, shift_m: real(self.shift_m) }
    }
}
