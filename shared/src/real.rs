//! The scalar that all kinematics is written in, its elementary functions, and the names of its vectors and matrices.
//!
//! One source serves `f32` on the chip, `f64` on the host and, in tests, dual numbers whose derivative part checks
//! every derivative written by hand.
//!
//! The elementary functions of `f32` and `f64` are those of [`libm`](https://docs.rs/libm) on every machine, so that chip and
//! host agree; those of any other scalar are its own. [`trig`](crate::trig) has faster ones for what kinematics calls often.

use core::any::Any;

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

/// `value` as a `B` when `A` and `B` are one type.
#[inline(always)]
pub(crate) fn same<A: 'static, B: Copy + 'static>(value: A) -> Option<B> {
    let value: &dyn Any = &value;
    value.downcast_ref().copied()
}

/// Functions of one number: their documentation, their name, and the one of libm for each width.
macro_rules! elementary {
    ($($(#[$doc:meta])* $name:ident: $single:path, $double:path;)*) => {$(
        $(#[$doc])*
        #[inline]
        pub fn $name<T: Real>(x: T) -> T {
            let single = same(x).and_then(|x| same($single(x)));
            let double = || same(x).and_then(|x| same($double(x)));
            single.or_else(double).unwrap_or_else(|| x.$name())
        }
    )*};
}

elementary! {
    /// sin x, x in rad.
    sin: libm::sinf, libm::sin;
    /// cos x, x in rad.
    cos: libm::cosf, libm::cos;
    /// eˣ.
    exp: libm::expf, libm::exp;
    /// The hyperbolic tangent of x.
    tanh: libm::tanhf, libm::tanh;
    /// √x; not a number where x is negative.
    sqrt: libm::sqrtf, libm::sqrt;
    /// The nearest integer, halves away from zero.
    round: libm::roundf, libm::round;
}

/// (sin x, cos x), x in rad.
#[inline]
pub fn sin_cos<T: Real>(x: T) -> (T, T) {
    let single = same(x).and_then(|x| same(libm::sincosf(x)));
    let double = || same(x).and_then(|x| same(libm::sincos(x)));
    single.or_else(double).unwrap_or_else(|| x.sin_cos())
}

/// The angle of the point (x, y) from the x-axis, rad, within −π..=π.
#[inline]
pub fn atan2<T: Real>(y: T, x: T) -> T {
    let single = same((y, x)).and_then(|(y, x)| same(libm::atan2f(y, x)));
    let double = || same((y, x)).and_then(|(y, x)| same(libm::atan2(y, x)));
    single.or_else(double).unwrap_or_else(|| y.atan2(x))
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;

    type Function = fn(f64) -> f64;

    /// The largest distance from the functions of `std`, in units of the last place.
    fn worst(ours: Function, theirs: Function) -> f64 {
        let numbers = (-20_000..20_000).map(|k| f64::from(k) * 1.234_5e-3);
        numbers.fold(0.0, |worst: f64, x| {
            let (a, b) = (ours(x), theirs(x));
            worst.max((a - b).abs() / (b.abs() * f64::EPSILON).max(f64::MIN_POSITIVE))
        })
    }

    #[test]
    fn functions_of_libm_are_those_of_the_host_to_the_last_place() {
        let pairs: [(Function, Function); 5] =
            [(sin, f64::sin), (cos, f64::cos), (exp, f64::exp), (round, f64::round), (sqrt_of_square, f64::abs)];
        for (k, (ours, theirs)) in pairs.into_iter().enumerate() {
            assert!(worst(ours, theirs) <= 1.0, "{k}: {}", worst(ours, theirs));
        }
        // Both err by a few units where tanh x is small.
        assert!(worst(tanh, f64::tanh) <= 3.0, "{}", worst(tanh, f64::tanh));
        assert_eq!(sin_cos(0.7f32), (sin(0.7f32), cos(0.7f32)));
        assert!((atan2(1.0, -2.0) - 1.0f64.atan2(-2.0)).abs() <= f64::EPSILON);
    }

    fn sqrt_of_square(x: f64) -> f64 {
        sqrt(x * x)
    }

    #[test]
    fn dual_numbers_keep_their_derivatives() {
        let x = num_dual::Dual64::from_re(0.4).derivative();
        let close = |value: num_dual::Dual64, slope: f64| (value.eps - slope).abs() < 1e-15;
        assert!(close(sin(x), 0.4f64.cos()) && close(exp(x), 0.4f64.exp()) && close(sin_cos(x).1, -0.4f64.sin()));
        assert!(close(atan2(x, num_dual::Dual64::from_re(1.0)), 1.0 / 1.16));
    }
}
