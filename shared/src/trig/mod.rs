//! Sine, cosine, arc tangent and square root: fast on the chip, with bounds that tests prove against `f64`.
//!
//! libm computes an `f32` sine in `f64`, which a Cortex-M4F emulates: some two thousand instructions for a pair. These
//! stay in the type of their argument. All kinematics of this crate calls them through [`sin_cos`] and its neighbours,
//! which choose by type; what they leave out is that of [`real`]: libm's, or a dual number's own.
//!
//! | function    | `f32`: bound of the error                            | `f64`: bound of the error          |
//! |-------------|------------------------------------------------------|------------------------------------|
//! | [`sin_cos`] | 1.2e-7 absolute for \|x\| ≤ 8192, libm's beyond       | 2.3e-16 absolute for \|x\| ≤ 1e5   |
//! | [`atan2`]   | 3.0e-7 relative                                      | libm's                             |
//! | [`sqrt`]    | 1.2e-7 relative                                      | exact to the last bit (hardware)   |
//!
//! Angles in rad. Source of the coefficients: S. L. Moshier, Cephes 2.2 (f32); Sun Microsystems, fdlibm 5.3 (f64).

mod double;
mod single;

use core::any::{Any, TypeId};
use core::array::from_fn;

use crate::real::{self, Real, same};

/// (sin x, cos x).
#[inline(always)]
pub fn sin_cos<T: Real>(angle_rad: T) -> (T, T) {
    let x: &dyn Any = &angle_rad;
    if let Some(x) = x.downcast_ref::<f32>() {
        let (sine, cosine) = single::sin_cos(*x);
        return (same(sine).unwrap_or(angle_rad), same(cosine).unwrap_or(angle_rad));
    }
    if let Some(x) = x.downcast_ref::<f64>() {
        let (sine, cosine) = double::sin_cos(*x);
        return (same(sine).unwrap_or(angle_rad), same(cosine).unwrap_or(angle_rad));
    }
    real::sin_cos(angle_rad)
}

/// (sin x, cos x) of many angles, angle k being `angle_rad(k)`: a host computes them side by side.
#[inline(always)]
pub fn sin_cos_all<T: Real, const N: usize>(angle_rad: impl Fn(usize) -> T) -> [(T, T); N] {
    if TypeId::of::<T>() == TypeId::of::<f32>() {
        let pairs: [(f32, f32); N] = single::sin_cos_all(|k| same(angle_rad(k)).unwrap_or_default());
        return same(pairs).unwrap_or([(T::zero(), T::zero()); N]);
    }
    if TypeId::of::<T>() != TypeId::of::<f64>() {
        return from_fn(|k| sin_cos(angle_rad(k)));
    }
    let angles = from_fn(|k| same(angle_rad(k)).unwrap_or_default());
    same(double::sin_cos_all::<N>(&angles)).unwrap_or([(T::zero(), T::zero()); N])
}

/// The angle of the point (x, y) from the x-axis, within −π..=π; 0 at the origin.
#[inline]
pub fn atan2<T: Real>(y: T, x: T) -> T {
    let (any_y, any_x): (&dyn Any, &dyn Any) = (&y, &x);
    if let (Some(y), Some(x)) = (any_y.downcast_ref::<f32>(), any_x.downcast_ref::<f32>())
        && let Some(angle) = same(single::atan2(*y, *x))
    {
        return angle;
    }
    real::atan2(y, x)
}

/// √x; 0 for what is negative.
#[inline]
pub fn sqrt<T: Real>(square: T) -> T {
    let x: &dyn Any = &square;
    if let Some(x) = x.downcast_ref::<f32>()
        && let Some(root) = same(single::sqrt(*x))
    {
        return root;
    }
    if square <= T::zero() { T::zero() } else { square.sqrt() }
}

#[cfg(test)]
mod tests;
