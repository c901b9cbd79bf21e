//! Frame offset: the base is elsewhere in the camera's frame, or the tool sits elsewhere on the last stage.
//!
//! # Model
//!
//! T = D·T₀ (base), T = T₀·D (tool), D = (exp(θ), d)
//!
//! | symbol | field        | unit   | meaning                                              |
//! |--------|--------------|--------|------------------------------------------------------|
//! | T₀     | `predicted`  | m, rad | ideal pose of the tool in the base                   |
//! | θ      | `values` 0–2 | rad    | rotation vector of the displacement                  |
//! | d      | `values` 3–5 | m      | its translation                                      |
//!
//! Frame: θ and d are expressed in the frame where the base should be, or where the tool should be.
//! Valid for any displacement. Of the base it is that of the sensor as well: a camera sees the arm in its own frame. On a
//! planar arm θ_x, θ_y and d_z are not determined. Loads are those of the arm in its ideal place.
//! Source: definition.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::{Condition, Law, frame_offset::{Frame, FrameOffset}};
//! use darm_core::real::Vec3;
//! use darm_core::se::Pose;
//! let law = FrameOffset { frame: Frame::Tool, values: [0.0, 0.0, 0.0, 0.002, 0.0, 0.0] };
//! let turned = Pose::new(&Vec3::new(0.0, 0.0, core::f64::consts::FRAC_PI_2), Vec3::new(1.0, 2.0, 0.0));
//! let condition = Condition::of_word("01".parse().unwrap());
//! // 2 mm along the tool's x, which points along y.
//! let seen = law.displace(turned, &condition).position;
//! assert!((seen - Vec3::new(1.0, 2.002, 0.0)).norm() < 1e-15);
//! ```

use super::{Condition, Detail, Law, LawName, Place, Quantity};
use crate::real::{Real, Vec3, real};
use crate::se::Pose;

/// A frame that is not where it should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameOffset<T: Real> {
    /// Which.
    pub frame: Frame,
    /// Rotation vector, rad, and translation, m.
    pub values: [T; 6],
}

/// A frame at an end of the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// The pose of the arm in the camera's frame.
    Base,
    /// What the camera follows.
    Tool,
}

/// The values of a displacement.
pub(super) const OF_DISPLACEMENT: [Quantity; 6] = [
    Quantity { name: "turn_x", unit: "rad" },
    Quantity { name: "turn_y", unit: "rad" },
    Quantity { name: "turn_z", unit: "rad" },
    Quantity { name: "x", unit: "m" },
    Quantity { name: "y", unit: "m" },
    Quantity { name: "z", unit: "m" },
];

impl<T: Real> Law<T> for FrameOffset<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        let frame = match (place, detail) {
            (Place::Base, Detail::All) => Frame::Base,
            (Place::Tool, Detail::All) => Frame::Tool,
            _ => return None,
        };
        Some(Self { frame, values: [T::zero(); 6] })
    }

    fn name(&self) -> LawName {
        match self.frame {
            Frame::Base => LawName::BaseOffset,
            Frame::Tool => LawName::ToolOffset,
        }
    }

    fn place(&self) -> Place {
        match self.frame {
            Frame::Base => Place::Base,
            Frame::Tool => Place::Tool,
        }
    }

    fn quantities(&self) -> &'static [Quantity] {
        &OF_DISPLACEMENT
    }

    fn values(&self) -> &[T] {
        &self.values
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    fn displace(&self, predicted: Pose<T>, _condition: &Condition<T>) -> Pose<T> {
        let [rx, ry, rz, x, y, z] = self.values;
        let displacement = Pose::new(&Vec3::new(rx, ry, rz), Vec3::new(x, y, z));
        match self.frame {
            Frame::Base => displacement * predicted,
            Frame::Tool => predicted * displacement,
        }
    }
}

impl FrameOffset<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> FrameOffset<U> {
        FrameOffset { frame: self.frame, values: self.values.map(real) }
    }
}
