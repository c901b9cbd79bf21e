//! Crowding: actuators of one module that switch together take each other's supply, and do not get as far.
//!
//! # Model
//!
//! l = l₀                                            where the actuator has not just switched
//! l = l₀ + (s + g·δ)·n·(digit = 0 ? +1 : −1)        where it has, together with n others of its module
//!
//! | symbol | field                    | unit | meaning                                                   |
//! |--------|--------------------------|------|-----------------------------------------------------------|
//! | l₀     | `Setting::value`         | m    | length when it switches alone                             |
//! | s      | `values` 0               | m    | how far it stays short of its stop for each of the others |
//! | g      | `values` 1               | m    | how this grows with the supply; below zero as a rule      |
//! | δ      | `Site::supply_deviation` | 1    | supply over nominal supply, less one                      |
//! | n      | `Site::together`         | 1    | others of the module that switched in the same row        |
//!
//! Frame: a scalar along the actuator; of a revolute joint l and s are angles in rad. Short means away from the stop, as
//! in [`play`](super::play).
//! Valid while the actuators of a module share a line, a fuse or a hose, and each takes the same part of it.
//! Source: first-order expansion in the number of others and in the supply.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Place, Site, crowding::Crowding};
//! let law = Crowding { at: Place::Arm, values: [0.001, -0.004] };
//! let mut leg = Setting::of_joint(1.25);
//! law.disturb(&Site { digit: 1, previous: Some(0), together: 2, ..Site::default() }, &mut leg);
//! // 1.25 m − 2 · 1 mm
//! assert_eq!(leg.value, 1.248);
//! let mut starved = Setting::of_joint(1.25);
//! law.disturb(&Site { digit: 1, previous: Some(0), together: 2, supply_deviation: -0.25, ..Site::default() }, &mut starved);
//! // 1.25 m − 2 · (1 mm + 4 mm · 0.25)
//! assert_eq!(starved.value, 1.246);
//! ```

use super::{Detail, Law, LawName, Place, Quantity, Site};
use crate::actuator::Setting;
use crate::real::{Real, real};

/// Actuators that get in each other's way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crowding<T: Real> {
    /// The actuators concerned; the same values serve all.
    pub at: Place,
    /// How far each stays short for each other that switches with it, and how this grows with the supply, m (rad).
    pub values: [T; 2],
}

impl<T: Real> Law<T> for Crowding<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        (detail == Detail::All && place.is_actuators()).then_some(Self { at: place, values: [T::zero(); 2] })
    }

    fn name(&self) -> LawName {
        LawName::Crowding
    }

    fn place(&self) -> Place {
        self.at
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "short", unit: "m" }, Quantity { name: "short_by_supply", unit: "m" }]
    }

    fn values(&self) -> &[T] {
        &self.values
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    fn disturb(&self, site: &Site<T>, setting: &mut Setting<T>) {
        if site.previous.is_none_or(|previous| previous == site.digit) {
            return;
        }
        let [short, by_supply] = self.values;
        let short = (short + by_supply * site.supply_deviation) * real(f64::from(site.together));
        setting.value += if site.digit == 0 { short } else { -short };
    }
}

impl Crowding<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Crowding<U> {
        Crowding { at: self.at, values: self.values.map(real) }
    }
}
