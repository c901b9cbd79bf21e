//! Joint offset: a servo joint is elsewhere than its servo reports.
//!
//! # Model
//!
//! q = q₀ + δ
//!
//! | symbol | field            | unit | meaning                                              |
//! |--------|------------------|------|------------------------------------------------------|
//! | q₀     | `Setting::value` | rad  | ideal position of the joint for what the servo reports |
//! | δ      | `offset_rad`     | rad  | what is added to it                                  |
//!
//! Frame: a scalar about (along) the axis of the joint; of a sliding joint q and δ are lengths in m.
//! Valid for a horn on the wrong tooth, a zero that was set badly. Of a joint at the base whose axis is fixed it cannot be
//! distinguished from a turn of the base.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, joint_offset::JointOffset};
//! let law = JointOffset { servo: 0, offset_rad: 0.01 };
//! let mut joint = Setting::of_joint(0.5);
//! law.turn(&mut joint);
//! // 0.5 rad + 0.01 rad
//! assert_eq!(joint.value, 0.51);
//! ```

use core::slice;

use super::{Detail, Law, LawName, Place, Quantity};
use crate::actuator::Setting;
use crate::real::{Real, real};

/// A servo joint whose zero is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointOffset<T: Real> {
    /// Index of the servo.
    pub servo: u8,
    /// By how much the joint is farther, rad (m).
    pub offset_rad: T,
}

impl<T: Real> Law<T> for JointOffset<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        match (place, detail) {
            (Place::Servo(servo), Detail::All) => Some(Self { servo, offset_rad: T::zero() }),
            _ => None,
        }
    }

    fn name(&self) -> LawName {
        LawName::JointOffset
    }

    fn place(&self) -> Place {
        Place::Servo(self.servo)
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "offset", unit: "rad" }]
    }

    fn values(&self) -> &[T] {
        slice::from_ref(&self.offset_rad)
    }

    fn values_mut(&mut self) -> &mut [T] {
        slice::from_mut(&mut self.offset_rad)
    }

    fn turn(&self, setting: &mut Setting<T>) {
        setting.value += self.offset_rad;
    }
}

impl JointOffset<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> JointOffset<U> {
        JointOffset { servo: self.servo, offset_rad: real(self.offset_rad) }
    }
}
