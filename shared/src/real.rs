//! The scalar that all kinematics is written in, and the names of its vectors and matrices.
//!
//! One source serves `f32` on the chip, `f64` on the host and, in tests, dual numbers whose derivative part checks
//! every derivative written by hand.

use nalgebra::{Matrix3, Matrix6, RealField, Vector2, Vector3, Vector6};

/// The one bound of this crate's kinematics: a real number that is copied freely.
pub trait Real: RealField + Copy {}

impl<T: RealField + Copy> Real for T {}

/// A column of two numbers.
pub type Vec2<T> = Vector2<T>;
/// A column of three numbers.
pub type Vec3<T> = Vector3<T>;
/// A column of six numbers, the angular part of a twist or wrench first.
pub type Vec6<T> = Vector6<T>;
/// A matrix of three by three numbers.
pub type Mat3<T> = Matrix3<T>;
/// A matrix of six by six numbers, the angular part of a twist or wrench first.
pub type Mat6<T> = Matrix6<T>;

/// The constant `value` as a `T`, rounded where `T` is the coarser type.
#[inline(always)]
pub fn real<T: Real>(value: f64) -> T {
    T::from_subset(&value)
}

/// The number `value` as an `f32`, without its derivative part where it has one: for messages.
#[inline]
pub fn to_f32<T: Real>(value: T) -> f32 {
    nalgebra::convert_unchecked(value)
}

/// The vector `value` as a vector of `U`.
#[inline]
pub fn cast<U: Real>(value: &Vec3<f64>) -> Vec3<U> {
    value.map(real)
}
