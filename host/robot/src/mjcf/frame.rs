//! Positions and orientations of elements: quaternion, axis and angle, Euler angles, two axes, or the z axis.

use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, rotation_about};
use nalgebra::{Quaternion, UnitQuaternion};

use super::classes::Settled;
use super::fault::Wrong;
use super::settings::Settings;

/// A direction shorter than this has none.
const SHORT: f64 = 1e-14;

/// The `pos` and the orientation of an element in its parent.
pub(super) fn pose(element: Settled<'_>, settings: &Settings) -> Result<Pose<f64>, Wrong> {
    let position = element.numbers("pos")?.map_or(Vec3::zeros(), Vec3::from);
    Ok(Pose { rotation: rotation(element, settings)?, position })
}

/// The orientation; any other form than `quat` replaces it.
fn rotation(element: Settled<'_>, settings: &Settings) -> Result<Mat3<f64>, Wrong> {
    let direction = |name: &str, vector: Vec3<f64>| {
        vector.try_normalize(SHORT).ok_or_else(|| element.wrong_value(name, "a direction other than 0 0 0"))
    };
    if let Some([x, y, z, angle]) = element.numbers("axisangle")? {
        return Ok(rotation_about(&direction("axisangle", Vec3::new(x, y, z))?, angle * settings.angle_rad));
    }
    if let Some([a, b, c, d, e, f]) = element.numbers("xyaxes")? {
        let x = direction("xyaxes", Vec3::new(a, b, c))?;
        let y = Vec3::new(d, e, f);
        let y = direction("xyaxes", y - x * x.dot(&y))?;
        return Ok(Mat3::from_columns(&[x, y, x.cross(&y)]));
    }
    if let Some(z) = element.numbers("zaxis")? {
        return Ok(along(&direction("zaxis", z.into())?));
    }
    if let Some(angles) = element.numbers::<3>("euler")? {
        let mut rotation = Mat3::identity();
        for (axis, angle) in settings.euler_sequence.iter().zip(angles) {
            let direction = match axis.to_ascii_lowercase() {
                'x' => Vec3::x(),
                'y' => Vec3::y(),
                _ => Vec3::z(),
            };
            let turn = rotation_about(&direction, angle * settings.angle_rad);
            rotation = if axis.is_ascii_lowercase() { rotation * turn } else { turn * rotation };
        }
        return Ok(rotation);
    }
    let Some([w, x, y, z]) = element.numbers("quat")? else { return Ok(Mat3::identity()) };
    let unit = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), SHORT);
    let unit = unit.ok_or_else(|| element.wrong_value("quat", "a quaternion other than 0 0 0 0"))?;
    Ok(unit.to_rotation_matrix().into_inner())
}

/// The shortest rotation that turns z along this unit vector.
pub(super) fn along(z: &Vec3<f64>) -> Mat3<f64> {
    let axis = Vec3::z().cross(z);
    match axis.try_normalize(SHORT) {
        Some(unit) => rotation_about(&unit, axis.norm().atan2(z.z)),
        None if z.z < 0.0 => rotation_about(&Vec3::x(), std::f64::consts::PI),
        None => Mat3::identity(),
    }
}
