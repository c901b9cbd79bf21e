//! Drift: actuators creep in their clamps, evenly in time.
//!
//! # Model
//!
//! l = l₀ + v·t          with t = t₁ where no time is known
//!
//! | symbol | field            | unit | meaning                                              |
//! |--------|------------------|------|------------------------------------------------------|
//! | l₀     | `Setting::value` | m    | length when the measurement began                    |
//! | v      | `rate_m_per_s`   | m/s  | growth in every state                                |
//! | t      | `Site::time_s`   | s    | since the measurement began                          |
//! | t₁     | `until_s`        | s    | when the measurement that told the drift ended       |
//!
//! Frame: a scalar along the actuator; of a revolute joint l is an angle in rad.
//! Valid within one measurement: nothing creeps on for ever, so afterwards the actuator is held to stand where it stood
//! at its end.
//! Source: first-order expansion in time.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Place, Site, drift::Drift};
//! let law = Drift { at: Place::Actuator(0), until_s: 200.0, rate_m_per_s: 1e-5 };
//! let length_m = |time_s| {
//!     let mut leg = Setting::of_joint(1.25);
//!     law.disturb(&Site { time_s, ..Site::default() }, &mut leg);
//!     leg.value
//! };
//! // 1.25 m + 10 µm/s · 100 s, and 200 s
//! assert_eq!((length_m(Some(100.0)), length_m(None)), (1.251, 1.252));
//! ```

use core::slice;

use super::{Law, Place, Quantity, Site};
use crate::actuator::Setting;
use crate::real::{Real, real};

/// Actuators that creep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift<T: Real> {
    /// The actuators concerned; one rate serves all.
    pub at: Place,
    /// When the measurement ended that told it, s since it began.
    pub until_s: T,
    /// Growth per time, m/s (rad/s).
    pub rate_m_per_s: T,
}

impl<T: Real> Law<T> for Drift<T> {
    fn name(&self) -> &'static str {
        "drift"
    }

    fn place(&self) -> Place {
        self.at
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "rate", unit: "m/s" }]
    }

    fn values(&self) -> &[T] {
        slice::from_ref(&self.rate_m_per_s)
    }

    fn values_mut(&mut self) -> &mut [T] {
        slice::from_mut(&mut self.rate_m_per_s)
    }

    fn disturb(&self, site: &Site<T>, setting: &mut Setting<T>) {
        setting.value += self.rate_m_per_s * site.time_s.unwrap_or(self.until_s);
    }
}

impl Drift<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Drift<U> {
        Drift { at: self.at, until_s: real(self.until_s), rate_m_per_s: real(self.rate_m_per_s) }
    }
}
