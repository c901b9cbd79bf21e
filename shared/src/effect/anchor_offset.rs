//! Anchor offset: an anchor of one leg does not sit where the drawing has it.
//!
//! # Model
//!
//! a = a₀ + δ
//!
//! | symbol | field                  | unit | meaning                                       |
//! |--------|------------------------|------|-----------------------------------------------|
//! | a₀     | `Setting::base`, `top` | m    | ideal place of the anchor in its plate        |
//! | δ      | `offset`               | m    | by how much the anchor sits away from it      |
//!
//! Frame: that of the plate which carries the anchor: base or top plate of the leg's own platform.
//! Valid for legs of a platform, in every state and under every load; a joint has no anchors. On a planar platform
//! δ_z has no effect of first order.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::actuator::Setting;
//! use darm_core::effect::{Law, Site, anchor_offset::{AnchorOffset, Plate}};
//! use darm_core::real::Vec3;
//! let law = AnchorOffset { actuator: 0, plate: Plate::Base, offset: Vec3::new(0.003, -0.001, 0.0) };
//! let mut leg = Setting { base: Vec3::new(-0.5, 0.0, 0.0), top: Vec3::new(-0.5, 0.0, 0.0), value: 1.0 };
//! law.disturb(&Site::default(), &mut leg);
//! // (−0.500, 0) m + (0.003, −0.001) m
//! assert_eq!(leg.base, Vec3::new(-0.497, -0.001, 0.0));
//! ```

use super::{Detail, Law, LawName, Place, Quantity, Site};
use crate::actuator::Setting;
use crate::real::{Real, Vec3, cast};

/// An anchor away from its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnchorOffset<T: Real> {
    /// Index of the actuator whose anchor it is.
    pub actuator: u8,
    /// The plate that carries the anchor.
    pub plate: Plate,
    /// By how much it is displaced, in the frame of that plate, m.
    pub offset: Vec3<T>,
}

/// A plate of a platform.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Plate {
    /// The plate that the legs stand on.
    Base,
    /// The plate that the legs carry.
    Top,
}

impl<T: Real> Law<T> for AnchorOffset<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        match (place, detail) {
            (Place::Actuator(actuator), Detail::Anchor(plate)) => Some(Self { actuator, plate, offset: Vec3::zeros() }),
            _ => None,
        }
    }

    fn name(&self) -> LawName {
        LawName::AnchorOffset
    }

    fn place(&self) -> Place {
        Place::Actuator(self.actuator)
    }

    fn detail(&self) -> Detail {
        Detail::Anchor(self.plate)
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "x", unit: "m" }, Quantity { name: "y", unit: "m" }, Quantity { name: "z", unit: "m" }]
    }

    fn values(&self) -> &[T] {
        self.offset.as_slice()
    }

    fn values_mut(&mut self) -> &mut [T] {
        self.offset.as_mut_slice()
    }

    fn disturb(&self, _site: &Site<T>, setting: &mut Setting<T>) {
        match self.plate {
            Plate::Base => setting.base += self.offset,
            Plate::Top => setting.top += self.offset,
        }
    }
}

impl AnchorOffset<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> AnchorOffset<U> {
        AnchorOffset { actuator: self.actuator, plate: self.plate, offset: cast(&self.offset) }
    }
}
