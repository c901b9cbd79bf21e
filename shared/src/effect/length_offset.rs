//! Length offset: a rod is screwed in too far, or its zero is elsewhere, so that an actuator is longer in every state.
//!
//! # Model
//!
//! l = l₀ + s
//!
//! | symbol | field            | unit | meaning                                     |
//! |--------|------------------|------|---------------------------------------------|
//! | l₀     | `Setting::value` | m    | length that the stop of the state sets      |
//! | s      | `offset_m`       | m    | by how much it is longer, the same in every state |
//!
//! Frame: a scalar along the actuator; of a revolute joint l and s are angles in rad.
//! Valid at all times; a stop of one state that is elsewhere is a [`stroke_loss`](super::stroke_loss).
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Site, length_offset::LengthOffset};
//! let law = LengthOffset { actuator: 0, offset_m: 0.002 };
//! let mut leg = Setting::of_joint(1.25);
//! law.disturb(&Site::default(), &mut leg);
//! assert_eq!(leg.value, 1.252);
//! ```

use core::slice;

use super::{Detail, Law, LawName, Place, Quantity, Site};
use crate::actuator::Setting;
use crate::real::{Real, real};

/// An actuator that is longer in every state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LengthOffset<T: Real> {
    /// Index of the actuator.
    pub actuator: u8,
    /// By how much it is longer, m (rad).
    pub offset_m: T,
}

impl<T: Real> Law<T> for LengthOffset<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        match (place, detail) {
            (Place::Actuator(actuator), Detail::All) => Some(Self { actuator, offset_m: T::zero() }),
            _ => None,
        }
    }

    fn name(&self) -> LawName {
        LawName::LengthOffset
    }

    fn place(&self) -> Place {
        Place::Actuator(self.actuator)
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "offset", unit: "m" }]
    }

    fn values(&self) -> &[T] {
        slice::from_ref(&self.offset_m)
    }

    fn values_mut(&mut self) -> &mut [T] {
        slice::from_mut(&mut self.offset_m)
    }

    fn disturb(&self, _site: &Site<T>, setting: &mut Setting<T>) {
        setting.value += self.offset_m;
    }
}

impl LengthOffset<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> LengthOffset<U> {
        LengthOffset { actuator: self.actuator, offset_m: real(self.offset_m) }
    }
}
