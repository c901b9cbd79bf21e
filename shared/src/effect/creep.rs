//! Creep: a seal or a pad yields after the blow, so that an actuator continues to move for some seconds while it stays in its state.
//!
//! # Model
//!
//! l = l₀ + (a·(1 − e^(−t/1 s)) + b·(1 − e^(−t/10 s)))·(digit = 0 ? −1 : +1)
//!
//! | symbol | field            | unit | meaning                                                             |
//! |--------|------------------|------|---------------------------------------------------------------------|
//! | l₀     | `Setting::value` | m    | length in the row that switched the actuator                        |
//! | a      | `values` 0       | m    | creep within a second, farther onto the stop                        |
//! | b      | `values` 1       | m    | creep within ten seconds, farther onto the stop                     |
//! | t      | `Site::dwell_s`   | s    | since the pose of the row that switched it was taken                |
//!
//! Where no times are known, in a table, t is `dwell_s` for an actuator that stays where it was, and 0 for one that switches.
//! `dwell_s` is the median of t in the measurement that showed the creep.
//!
//! Frame: a scalar along the actuator; of a revolute joint l, a and b are angles in rad. Farther means longer in every state
//! but 0, and shorter in that.
//! Valid for linear viscoelasticity at times of 0.1 s to 30 s; before an actuator has first switched t counts from the start of
//! the measurement.
//! Source: Prony series of two terms with time constants a decade apart, W. N. Findley, J. S. Lai, K. Onaran, Creep and
//! Relaxation of Nonlinear Viscoelastic Materials, North-Holland, 1976, chapter 5.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Place, Site, creep::Creep};
//! let law = Creep { at: Place::Arm, dwell_s: 0.0, values: [0.0, 0.001] };
//! let crept_m = |digit, dwell_s| {
//!     let mut leg = Setting::of_joint(1.0);
//!     law.disturb(&Site { digit, dwell_s, ..Site::default() }, &mut leg);
//!     leg.value - 1.0f64
//! };
//! assert_eq!(crept_m(1, Some(0.0)), 0.0);
//! // 1 mm · (1 − 1/e)
//! assert!((crept_m(1, Some(10.0)) - 0.632e-3).abs() < 1e-6);
//! assert!((crept_m(0, Some(10.0)) + 0.632e-3).abs() < 1e-6);
//! ```

use super::{Detail, End, Law, LawName, Place, Quantity, Site};
use crate::actuator::Setting;
use crate::real::{Real, exp, real};

/// Time constants of the two terms, s.
const TIMES_S: [f64; 2] = [1.0, 10.0];

/// Actuators that yield while they stay in their state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Creep<T: Real> {
    /// The actuators concerned; the same values serve all.
    pub at: Place,
    /// Dwell time in the measurement that it was found in, median, s.
    pub dwell_s: T,
    /// Creep with the time constants of 1 s and 10 s, m (rad).
    pub values: [T; 2],
}

impl<T: Real> Law<T> for Creep<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        let is_possible = detail == Detail::All && place.is_actuators();
        is_possible.then_some(Self { at: place, dwell_s: T::zero(), values: [T::zero(); 2] })
    }

    fn name(&self) -> LawName {
        LawName::Creep
    }

    fn place(&self) -> Place {
        self.at
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "fast", unit: "m" }, Quantity { name: "slow", unit: "m" }]
    }

    fn values(&self) -> &[T] {
        &self.values
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    fn constant(&self) -> Option<(Quantity, T)> {
        Some((Quantity { name: "dwell", unit: "s" }, self.dwell_s))
    }

    fn constant_mut(&mut self) -> Option<&mut T> {
        Some(&mut self.dwell_s)
    }

    fn settle(&mut self, end: &End<T>) {
        self.dwell_s = end.dwell_s;
    }

    fn disturb(&self, site: &Site<T>, setting: &mut Setting<T>) {
        let stays = site.previous == Some(site.digit);
        let dwell_s = site.dwell_s.unwrap_or(if stays { self.dwell_s } else { T::zero() });
        let terms = self.values.iter().zip(TIMES_S);
        let crept =
            terms.fold(T::zero(), |sum, (size, time_s)| sum + *size * (T::one() - exp(-dwell_s / real(time_s))));
        setting.value += if site.digit == 0 { -crept } else { crept };
    }
}

impl Creep<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Creep<U> {
        Creep { at: self.at, dwell_s: real(self.dwell_s), values: self.values.map(real) }
    }
}
