//! Drift: actuators creep in their clamps, ever more slowly as a rule.
//!
//! # Model
//!
//! l = l₀ + v·t + w·t²/2          with t = t₁ where no time is known
//!
//! | symbol | field            | unit | meaning                                              |
//! |--------|------------------|------|------------------------------------------------------|
//! | l₀     | `Setting::value` | m    | length when the measurement began                    |
//! | v      | `values` 0       | m/s  | growth in every state when the measurement began     |
//! | w      | `values` 1       | m/s² | change of this rate                                  |
//! | t      | `Site::time_s`   | s    | since the measurement began                          |
//! | t₁     | `until_s`        | s    | when the measurement that showed the drift ended       |
//!
//! Frame: a scalar along the actuator; of a revolute joint l is an angle in rad.
//! Valid within one measurement: nothing creeps on for ever, so afterwards the actuator is held to stand where it stood
//! at its end.
//! Source: second-order expansion in time.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Place, Site, drift::Drift};
//! let law = Drift { at: Place::Actuator(0), until_s: 200.0, values: [2e-5, -1e-7] };
//! let length_m = |time_s: Option<f64>| -> f64 {
//!     let mut leg = Setting::of_joint(1.25);
//!     law.disturb(&Site { time_s, ..Site::default() }, &mut leg);
//!     leg.value
//! };
//! // 1.25 m + 20 µm/s · 100 s − 0.1 µm/s² · (100 s)²/2, and at 200 s, when it has come to rest
//! assert!((length_m(Some(100.0)) - 1.2515).abs() < 1e-15 && (length_m(None) - 1.252).abs() < 1e-15);
//! ```

use super::{Detail, End, Law, LawName, Place, Quantity, Site};
use crate::actuator::Setting;
use crate::real::{Real, real};

/// Actuators that creep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift<T: Real> {
    /// The actuators concerned; the same values serve all.
    pub at: Place,
    /// When the measurement ended that showed it, s since it began.
    pub until_s: T,
    /// Growth per time at the start, m/s (rad/s), and its change, m/s² (rad/s²).
    pub values: [T; 2],
}

impl<T: Real> Law<T> for Drift<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        (detail == Detail::All && place.is_actuators()).then_some(Self {
            at: place,
            until_s: T::zero(),
            values: [T::zero(); 2],
        })
    }

    fn name(&self) -> LawName {
        LawName::Drift
    }

    fn place(&self) -> Place {
        self.at
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "rate", unit: "m/s" }, Quantity { name: "rate_change", unit: "m/s²" }]
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

    fn disturb(&self, site: &Site<T>, setting: &mut Setting<T>) {
        let ([rate, change], time_s) = (self.values, site.time_s.unwrap_or(self.until_s));
        setting.value += (rate + change * real(0.5) * time_s) * time_s;
    }
}

impl Drift<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Drift<U> {
        Drift { at: self.at, until_s: real(self.until_s), values: self.values.map(real) }
    }
}
