//! Supply-dependent stroke: the supply presses an extended actuator into its stop, and the stop yields with it.
//!
//! # Model
//!
//! l = l₀ + k·(p/p₀ − 1)·(l₀ − l_c)
//!
//! | symbol   | field                    | unit   | meaning                                                |
//! |----------|--------------------------|--------|--------------------------------------------------------|
//! | l₀       | `Setting::value`         | m      | length at the nominal supply                           |
//! | l₀ − l_c | `Site::stroke`           | m      | extension beyond the contracted length, ideal geometry |
//! | p/p₀ − 1 | `Site::supply_deviation` | 1      | relative deviation of the supply from the nominal one  |
//! | k        | `gain`                   | 1      | relative change of the stroke per relative deviation   |
//!
//! Frame: a scalar along the actuator; of a revolute joint l is an angle in rad.
//! Valid for small deviations; state 0, pulled in by a spring or by its own stop, does not change.
//! Source: first-order expansion about the nominal supply.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Place, Site, supply_stroke::SupplyStroke};
//! let law = SupplyStroke { at: Place::Arm, gain: 0.04 };
//! let mut leg = Setting::of_joint(1.25);
//! law.disturb(&Site { stroke: 0.25, supply_deviation: -0.1, ..Site::default() }, &mut leg);
//! // 1.25 m − 0.04 · 0.1 · 0.25 m = 1.249 m
//! assert!((leg.value - 1.249f64).abs() < 1e-15);
//! ```

use core::slice;

use super::{Detail, Law, LawName, Place, Quantity, Site};
use crate::actuator::Setting;
use crate::real::{Real, real};

/// Actuators whose stroke follows the supply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupplyStroke<T: Real> {
    /// The actuators concerned; one gain serves all.
    pub at: Place,
    /// Relative change of the stroke per relative deviation of the supply.
    pub gain: T,
}

impl<T: Real> Law<T> for SupplyStroke<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        (detail == Detail::All && place.is_actuators()).then_some(Self { at: place, gain: T::zero() })
    }

    fn name(&self) -> LawName {
        LawName::SupplyStroke
    }

    fn place(&self) -> Place {
        self.at
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "gain", unit: "1" }]
    }

    fn values(&self) -> &[T] {
        slice::from_ref(&self.gain)
    }

    fn values_mut(&mut self) -> &mut [T] {
        slice::from_mut(&mut self.gain)
    }

    fn disturb(&self, site: &Site<T>, setting: &mut Setting<T>) {
        setting.value += self.gain * site.supply_deviation * site.stroke;
    }
}

impl SupplyStroke<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> SupplyStroke<U> {
        SupplyStroke { at: self.at, gain: real(self.gain) }
    }
}
