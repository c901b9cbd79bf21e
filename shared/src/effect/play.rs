//! Play: an actuator that stayed where it was has been shaken off its stop; one that has just moved is seated on it.
//!
//! # Model
//!
//! l = l₀                      where the digit is another than in the word before, or that word is not known
//! l = l₀ + w·(digit = 0 ? +1 : −1)       where the digit is the same
//!
//! | symbol | field            | unit | meaning                                              |
//! |--------|------------------|------|------------------------------------------------------|
//! | l₀     | `Setting::value` | m    | length when seated on the stop of this state         |
//! | w      | `width_m`        | m    | how far the stop lets the actuator come back, ≥ 0    |
//!
//! Frame: a scalar along the actuator; of a revolute joint l and w are angles in rad. Back means away from the stop:
//! state 0 stops the contraction, so back is longer; every other state stops the extension, so back is shorter.
//! Valid where a switching actuator strikes its stop, and where the motion of the others shakes one that holds; the
//! memory reaches back by one word only.
//! Source: definition, as the simplest law of (word, word before) that distinguishes arrival from rest.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Place, Site, play::Play};
//! let law = Play { at: Place::Actuator(0), width_m: 0.001 };
//! let length_m = |digit, previous| {
//!     let mut leg = Setting::of_joint(1.0);
//!     law.disturb(&Site { digit, previous, ..Site::default() }, &mut leg);
//!     leg.value
//! };
//! assert_eq!(length_m(1, Some(0)), 1.0);
//! assert_eq!(length_m(1, Some(1)), 1.0 - 0.001);
//! assert_eq!(length_m(0, Some(0)), 1.0 + 0.001);
//! ```

use core::slice;

use super::{Detail, Law, LawName, Place, Quantity, Site};
use crate::actuator::Setting;
use crate::real::{Real, real};

/// Actuators that come off their stops when they are not moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Play<T: Real> {
    /// The actuators concerned; one width serves all.
    pub at: Place,
    /// How far one comes back, m (rad).
    pub width_m: T,
}

impl<T: Real> Law<T> for Play<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        (detail == Detail::All && place.is_actuators()).then_some(Self { at: place, width_m: T::zero() })
    }

    fn name(&self) -> LawName {
        LawName::Play
    }

    fn place(&self) -> Place {
        self.at
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "width", unit: "m" }]
    }

    fn values(&self) -> &[T] {
        slice::from_ref(&self.width_m)
    }

    fn values_mut(&mut self) -> &mut [T] {
        slice::from_mut(&mut self.width_m)
    }

    fn disturb(&self, site: &Site<T>, setting: &mut Setting<T>) {
        if site.previous != Some(site.digit) {
            return;
        }
        setting.value += if site.digit == 0 { self.width_m } else { -self.width_m };
    }
}

impl Play<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Play<U> {
        Play { at: self.at, width_m: real(self.width_m) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_word_before_the_actuator_is_seated() {
        let mut leg = Setting::of_joint(1.0);
        Play { at: Place::Arm, width_m: 0.001 }.disturb(&Site::default(), &mut leg);
        assert_eq!(leg.value, 1.0);
    }
}
