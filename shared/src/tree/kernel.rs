//! Products of columns of three, written out: multiply and add are fused where the machine does that in one instruction.

use crate::real::{Real, Vec3};

/// a·b + c; in one instruction, and one rounding, on a host that is built for such a machine.
#[inline(always)]
pub(crate) fn fused<T: Real>(a: T, b: T, c: T) -> T {
    if cfg!(all(feature = "fused", target_feature = "fma")) { a.mul_add(b, c) } else { a * b + c }
}

/// aᵀ·b.
#[inline(always)]
pub(crate) fn dot<T: Real>(a: &Vec3<T>, b: &Vec3<T>) -> T {
    fused(a.z, b.z, fused(a.y, b.y, a.x * b.x))
}

/// a × b.
#[inline(always)]
pub(crate) fn cross<T: Real>(a: &Vec3<T>, b: &Vec3<T>) -> Vec3<T> {
    Vec3::new(fused(a.y, b.z, -(a.z * b.y)), fused(a.z, b.x, -(a.x * b.z)), fused(a.x, b.y, -(a.y * b.x)))
}

/// c + a × b.
#[inline(always)]
pub(crate) fn add_cross<T: Real>(c: &Vec3<T>, a: &Vec3<T>, b: &Vec3<T>) -> Vec3<T> {
    Vec3::new(
        fused(-a.z, b.y, fused(a.y, b.z, c.x)),
        fused(-a.x, b.z, fused(a.z, b.x, c.y)),
        fused(-a.y, b.x, fused(a.x, b.y, c.z)),
    )
}

/// c + a·s.
#[inline(always)]
pub(crate) fn add_scaled<T: Real>(c: &Vec3<T>, a: &Vec3<T>, s: T) -> Vec3<T> {
    Vec3::new(fused(a.x, s, c.x), fused(a.y, s, c.y), fused(a.z, s, c.z))
}

/// The point (x, y) turned by the angle of this sine and cosine.
#[inline(always)]
pub(crate) fn rotated<T: Real>(x: T, y: T, sine: T, cosine: T) -> (T, T) {
    (fused(x, cosine, -(y * sine)), fused(x, sine, y * cosine))
}
