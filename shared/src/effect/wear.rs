//! Wear: the stops of an actuator give way with every blow.
//!
//! # Model
//!
//! l = l₀ + w·n·(digit = 0 ? −1 : +1)          with n = n₁ where the blows were not counted
//!
//! | symbol | field            | unit | meaning                                                    |
//! |--------|------------------|------|------------------------------------------------------------|
//! | l₀     | `Setting::value` | m    | length when the measurement began                          |
//! | w      | `per_switch_m`   | m    | how much farther a stop lets the actuator, for each switch |
//! | n      | `Site::switches` | 1    | how often the actuator has switched since then             |
//! | n₁     | `until_switches` | 1    | the same when the measurement that showed the wear ended     |
//!
//! Frame: a scalar along the actuator, outwards: state 0 stops the contraction, every other state the extension; of a
//! revolute joint l is an angle in rad. Valid while both stops wear alike and evenly.
//! Source: J. F. Archard, Journal of Applied Physics 24 (1953) 981: wear grows with the way times the load, here of blows
//! that are all alike.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Site, wear::Wear};
//! let law = Wear { actuator: 0, until_switches: 200.0, per_switch_m: 1e-5 };
//! let mut leg = Setting::of_joint(1.25);
//! law.disturb(&Site { digit: 1, switches: Some(100.0), ..Site::default() }, &mut leg);
//! // 1.25 m + 100 · 10 µm
//! assert_eq!(leg.value, 1.251);
//! ```

use core::slice;

use super::{Detail, End, Law, LawName, Place, Quantity, Site};
use crate::actuator::Setting;
use crate::real::{Real, real};

/// An actuator whose stops wear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wear<T: Real> {
    /// Index of the actuator.
    pub actuator: u8,
    /// How often it had switched when the measurement ended that showed the wear.
    pub until_switches: T,
    /// How much farther a stop lets it for each switch, m (rad).
    pub per_switch_m: T,
}

impl<T: Real> Law<T> for Wear<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        match (place, detail) {
            (Place::Actuator(actuator), Detail::All) => {
                Some(Self { actuator, until_switches: T::zero(), per_switch_m: T::zero() })
            }
            _ => None,
        }
    }

    fn name(&self) -> LawName {
        LawName::Wear
    }

    fn place(&self) -> Place {
        Place::Actuator(self.actuator)
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "per_switch", unit: "m" }]
    }

    fn values(&self) -> &[T] {
        slice::from_ref(&self.per_switch_m)
    }

    fn values_mut(&mut self) -> &mut [T] {
        slice::from_mut(&mut self.per_switch_m)
    }

    fn constant(&self) -> Option<(Quantity, T)> {
        Some((Quantity { name: "until_switches", unit: "1" }, self.until_switches))
    }

    fn constant_mut(&mut self) -> Option<&mut T> {
        Some(&mut self.until_switches)
    }

    fn settle(&mut self, end: &End<T>) {
        if let Some(counted) = end.switches.get(usize::from(self.actuator)) {
            self.until_switches = *counted;
        }
    }

    fn disturb(&self, site: &Site<T>, setting: &mut Setting<T>) {
        let worn = self.per_switch_m * site.switches.unwrap_or(self.until_switches);
        setting.value += if site.digit == 0 { -worn } else { worn };
    }
}

impl Wear<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Wear<U> {
        let (until_switches, per_switch_m) = (real(self.until_switches), real(self.per_switch_m));
        Wear { actuator: self.actuator, until_switches, per_switch_m }
    }
}
