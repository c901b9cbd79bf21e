//! A frame of a module in 16 bytes.

use nalgebra::{Isometry3, Quaternion, Rotation3, Translation3, UnitQuaternion};

use crate::se::Pose;

pub(super) type Motion = Isometry3<f32>;

/// The largest number of a stored frame.
const FULL: f32 = i16::MAX as f32;

/// A frame of a module in 16 bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Small {
    /// Quaternion, the real part first, of `FULL`.
    pub(super) turn: [i16; 4],
    /// Position, `FULL` of the module's size.
    pub(super) at: [i16; 3],
    pub(super) digits: u16,
}

impl Small {
    pub(super) fn of(motion: &Motion, size_m: f32, digits: u16) -> Self {
        let turn = &motion.rotation;
        let at = motion.translation.vector * (FULL / size_m);
        Self {
            turn: [turn.w, turn.i, turn.j, turn.k].map(|number| rounded(number * FULL)),
            at: [at.x, at.y, at.z].map(rounded),
            digits,
        }
    }

    pub(super) fn turn(&self) -> Quaternion<f32> {
        let [w, i, j, k] = self.turn.map(|number| f32::from(number) / FULL);
        Quaternion::new(w, i, j, k)
    }

    pub(super) fn motion(&self, size_m: f32) -> Motion {
        let [x, y, z] = self.at.map(|number| f32::from(number) * (size_m / FULL));
        Motion::from_parts(Translation3::new(x, y, z), UnitQuaternion::new_unchecked(self.turn()))
    }
}

pub(super) fn motion(pose: &Pose<f32>) -> Motion {
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.rotation));
    Motion::from_parts(Translation3::from(pose.position), rotation)
}

fn rounded(number: f32) -> i16 {
    (number + if number < 0.0 { -0.5 } else { 0.5 }) as i16
}
