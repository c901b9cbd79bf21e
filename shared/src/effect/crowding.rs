//! Crowding: actuators of one module that switch together take each other's supply, and do not get as far.
//!
//! # Model
//!
//! l = l₀                                  where the actuator has not just switched
//! l = l₀ + s·n·(digit = 0 ? +1 : −1)      where it has, together with n others of its module
//!
//! | symbol | field            | unit | meaning                                                  |
//! |--------|------------------|------|----------------------------------------------------------|
//! | l₀     | `Setting::value` | m    | length when it switches alone                            |
//! | s      | `short_m`        | m    | how far it stays short of its stop for each of the others |
//! | n      | `Site::together` | 1    | others of the module that switched in the same row       |
//!
//! Frame: a scalar along the actuator; of a revolute joint l and s are angles in rad. Short means away from the stop, as
//! in [`play`](super::play).
//! Valid while the actuators of a module share a line, a fuse or a hose, and each takes the same part of it.
//! Source: first-order expansion in the number of others.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Place, Site, crowding::Crowding};
//! let law = Crowding { at: Place::Arm, short_m: 0.001 };
//! let mut leg = Setting::of_joint(1.25);
//! law.disturb(&Site { digit: 1, previous: Some(0), together: 2, ..Site::default() }, &mut leg);
//! // 1.25 m − 2 · 1 mm
//! assert_eq!(leg.value, 1.248);
//! ```

use core::slice;

use super::{Law, Place, Quantity, Site};
use crate::actuator::Setting;
use crate::real::{Real, real};

/// Actuators that get in each other's way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crowding<T: Real> {
    /// The actuators concerned; one value serves all.
    pub at: Place,
    /// How far each stays short for each other that switches with it, m (rad).
    pub short_m: T,
}

impl<T: Real> Law<T> for Crowding<T> {
    fn name(&self) -> &'static str {
        "crowding"
    }

    fn place(&self) -> Place {
        self.at
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "short", unit: "m" }]
    }

    fn values(&self) -> &[T] {
        slice::from_ref(&self.short_m)
    }

    fn values_mut(&mut self) -> &mut [T] {
        slice::from_mut(&mut self.short_m)
    }

    fn disturb(&self, site: &Site<T>, setting: &mut Setting<T>) {
        if site.previous.is_none_or(|previous| previous == site.digit) {
            return;
        }
        let short = self.short_m * real(f64::from(site.together));
        setting.value += if site.digit == 0 { short } else { -short };
    }
}

impl Crowding<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Crowding<U> {
        Crowding { at: self.at, short_m: real(self.short_m) }
    }
}
