//! Thermal growth: legs are longer when they are warmer.
//!
//! # Model
//!
//! l = l₀·(1 + α·(ϑ − ϑ₀))
//!
//! | symbol | field                      | unit | meaning                                  |
//! |--------|----------------------------|------|------------------------------------------|
//! | l₀     | `Setting::value`           | m    | length at the reference temperature      |
//! | α      | `expansion_per_k`          | 1/K  | coefficient of linear expansion          |
//! | ϑ − ϑ₀ | `Site::temperature_rise_k` | K    | temperature less reference temperature   |
//!
//! Frame: a scalar along the actuator.
//! Valid for legs and sliding joints of one even temperature; an angle does not grow. Plates and links keep their
//! size.
//! Source: definition of the coefficient of linear expansion; steel 12e-6/K, aluminium 23e-6/K.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Place, Site, thermal_growth::ThermalGrowth};
//! let law = ThermalGrowth { at: Place::Arm, expansion_per_k: 23e-6 };
//! let mut leg = Setting::of_joint(1.25);
//! law.disturb(&Site { temperature_rise_k: 20.0, ..Site::default() }, &mut leg);
//! // 1.25 m · (1 + 23e-6/K · 20 K) = 1.250575 m
//! assert!((leg.value - 1.250575f64).abs() < 1e-15);
//! ```

use core::slice;

use super::{Detail, Law, LawName, Place, Quantity, Site};
use crate::actuator::{JointKind, Setting};
use crate::real::{Real, real};

/// Legs that grow with temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThermalGrowth<T: Real> {
    /// The legs concerned; one coefficient serves all.
    pub at: Place,
    /// Coefficient of linear expansion, 1/K.
    pub expansion_per_k: T,
}

impl<T: Real> Law<T> for ThermalGrowth<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        (detail == Detail::All && place.is_actuators()).then_some(Self { at: place, expansion_per_k: T::zero() })
    }

    fn name(&self) -> LawName {
        LawName::ThermalGrowth
    }

    fn place(&self) -> Place {
        self.at
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "expansion", unit: "1/K" }]
    }

    fn values(&self) -> &[T] {
        slice::from_ref(&self.expansion_per_k)
    }

    fn values_mut(&mut self) -> &mut [T] {
        slice::from_mut(&mut self.expansion_per_k)
    }

    fn disturb(&self, site: &Site<T>, setting: &mut Setting<T>) {
        if site.kind == JointKind::Prismatic {
            setting.value *= T::one() + self.expansion_per_k * site.temperature_rise_k;
        }
    }
}

impl ThermalGrowth<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> ThermalGrowth<U> {
        ThermalGrowth { at: self.at, expansion_per_k: real(self.expansion_per_k) }
    }
}
