//! Stroke loss: one actuator does not reach one of its stops, because the stop has moved or something is in the way.
//!
//! # Model
//!
//! l = l₀ − s in the state named, l = l₀ in all others
//!
//! | symbol | field             | unit | meaning                                             |
//! |--------|-------------------|------|-----------------------------------------------------|
//! | l₀     | `Setting::value`  | m    | ideal length in the state named                     |
//! | s      | `loss_m`          | m    | how much shorter it is; negative where it is longer |
//!
//! Frame: a scalar along the actuator. Of a revolute joint l and s are angles in rad.
//! Valid for a stop that is met in the same way whatever the load and the word before.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Site, stroke_loss::StrokeLoss};
//! let law = StrokeLoss { actuator: 0, state: 1, loss_m: 0.002 };
//! let mut leg = Setting::of_joint(1.250);
//! law.disturb(&Site { digit: 1, ..Site::default() }, &mut leg);
//! // 1.250 m − 0.002 m
//! assert_eq!(leg.value, 1.248);
//! ```

use core::slice;

use super::{Detail, Law, LawName, Place, Quantity, Site};
use crate::actuator::Setting;
use crate::real::{Real, real};

/// An actuator that misses one of its stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrokeLoss<T: Real> {
    /// Index of the actuator.
    pub actuator: u8,
    /// The state whose stop is missed.
    pub state: u8,
    /// By how much the actuator is shorter than that stop sets it, m (rad); negative where it is longer, as when something
    /// blocks the way to a contracted state.
    pub loss_m: T,
}

impl<T: Real> Law<T> for StrokeLoss<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        match (place, detail) {
            (Place::Actuator(actuator), Detail::State(state)) => Some(Self { actuator, state, loss_m: T::zero() }),
            _ => None,
        }
    }

    fn name(&self) -> LawName {
        LawName::StrokeLoss
    }

    fn place(&self) -> Place {
        Place::Actuator(self.actuator)
    }

    fn detail(&self) -> Detail {
        Detail::State(self.state)
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "loss", unit: "m" }]
    }

    fn values(&self) -> &[T] {
        slice::from_ref(&self.loss_m)
    }

    fn values_mut(&mut self) -> &mut [T] {
        slice::from_mut(&mut self.loss_m)
    }

    fn disturb(&self, site: &Site<T>, setting: &mut Setting<T>) {
        if site.digit == self.state {
            setting.value -= self.loss_m;
        }
    }
}

impl StrokeLoss<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> StrokeLoss<U> {
        StrokeLoss { actuator: self.actuator, state: self.state, loss_m: real(self.loss_m) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_states_keep_their_length() {
        let mut leg = Setting::of_joint(1.0);
        StrokeLoss { actuator: 0, state: 1, loss_m: 0.002 }.disturb(&Site::default(), &mut leg);
        assert_eq!(leg.value, 1.0);
    }
}
