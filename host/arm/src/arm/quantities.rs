//! Quantities of an arm file: poses, points, axes, masses and the values of states.

use std::ops::Range;

use darm_core::actuator::{Axis, JointKind, MAX_STATES};
use darm_core::model::Mass;
use darm_core::real::Vec3;
use darm_core::se::{Pose, Pose2};
use toml::Spanned;

use super::ArmFault;
use super::raw::{RawMotion, RawPose, RawStage};
use darm_robot::source::Number;

/// What is wrong, and the bytes of the file that hold it.
type Wrong = (Range<usize>, ArmFault);
/// A value of the file that has been checked.
pub(super) type Checked<T> = Result<T, Wrong>;

pub(super) fn axis_of(raw: &RawStage) -> Checked<Axis<f64>> {
    let kind = match raw.motion {
        Some(RawMotion::Prismatic) => JointKind::Prismatic,
        Some(RawMotion::Revolute) | None => JointKind::Revolute,
    };
    let Some(spanned) = &raw.axis else {
        return Ok(Axis { kind, direction: Vec3::z() });
    };
    let direction = vector(spanned.get_ref());
    let length = direction.norm();
    if length < 1e-9 {
        return Err((spanned.span(), ArmFault::NoAxis));
    }
    // A direction of length one to the last bit stays as it was written.
    Ok(Axis { kind, direction: if (length - 1.0).abs() < 1e-15 { direction } else { direction / length } })
}

/// The values of an actuator's states, which have to grow.
pub(super) fn states(
    raw: &[Number],
    to_si: impl Fn(f64) -> f64,
    span: Range<usize>,
) -> Checked<([f64; MAX_STATES], u8)> {
    if !(2..=MAX_STATES).contains(&raw.len()) {
        return Err((span, ArmFault::StateCount { found: raw.len() }));
    }
    let mut values = [0.0; MAX_STATES];
    values.iter_mut().zip(raw).for_each(|(value, raw)| *value = to_si(raw.0));
    for state in 1..raw.len() {
        if values[state] < values[state - 1] {
            return Err((span, ArmFault::Stroke { state, value: values[state], before: values[state - 1] }));
        }
    }
    Ok((values, raw.len() as u8))
}

pub(super) fn needed<'a, T>(
    value: &'a Option<T>,
    key: &'static str,
    of: &'static str,
    span: &Range<usize>,
) -> Checked<&'a T> {
    value.as_ref().ok_or_else(|| (span.clone(), ArmFault::Missing { key, of }))
}

/// Least and greatest value of a quantity that is above zero: what lies outside is a slip, and overflows later.
const MIN_POSITIVE: f64 = 1e-9;
const MAX_POSITIVE: f64 = 1e9;

pub(super) fn positive(key: &'static str, number: &Spanned<Number>) -> Checked<f64> {
    let value = number.get_ref().0;
    match value {
        MIN_POSITIVE..=MAX_POSITIVE => Ok(value),
        _ => Err((number.span(), ArmFault::NotPositive { key, value })),
    }
}

pub(super) fn mass(mass_kg: Option<&Spanned<Number>>, center: Option<&[Number; 3]>) -> Checked<Mass<f64>> {
    let Some(mass_kg) = mass_kg else { return Ok(Mass::none()) };
    let value = mass_kg.get_ref().0;
    if value < 0.0 {
        return Err((mass_kg.span(), ArmFault::NotPositive { key: "mass_kg", value }));
    }
    Ok(Mass { mass_kg: value, center: center.map_or(Vec3::zeros(), vector) })
}

pub(super) fn pose_of(raw: &Spanned<RawPose>) -> Checked<Pose<f64>> {
    pose(raw.get_ref()).map_err(|(expected, found)| (raw.span(), ArmFault::Coordinates { expected, found }))
}

/// The pose that a file gives; otherwise how many coordinates its position should have, and how many it has.
pub(super) fn pose(raw: &RawPose) -> Result<Pose<f64>, (usize, usize)> {
    match (&raw.rotation_deg, raw.position_m.as_slice()) {
        (None, &[x, y]) => {
            let angle_rad = raw.angle_deg.map_or(0.0, |degrees| degrees.0.to_radians());
            Ok(Pose2::new(x.0, y.0, angle_rad).into())
        }
        (rotation, &[x, y, z]) if raw.angle_deg.is_none() => {
            let degrees = rotation.as_ref().map_or(Vec3::zeros(), vector);
            Ok(Pose::new(&degrees.map(f64::to_radians), Vec3::new(x.0, y.0, z.0)))
        }
        (rotation, position) => Err((if rotation.is_some() { 3 } else { 2 }, position.len())),
    }
}

pub(super) fn point(raw: &Spanned<Vec<Number>>, dimension: usize) -> Checked<Vec3<f64>> {
    let coordinates = raw.get_ref();
    if coordinates.len() != dimension {
        return Err((raw.span(), ArmFault::Coordinates { expected: dimension, found: coordinates.len() }));
    }
    Ok(Vec3::from_fn(|row, _| coordinates.get(row).map_or(0.0, |coordinate| coordinate.0)))
}

pub(super) fn vector(raw: &[Number; 3]) -> Vec3<f64> {
    Vec3::from_fn(|row, _| raw[row].0)
}
