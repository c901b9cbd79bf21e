//! The pose as six numbers: Z-Y-X Euler angles and position, and the Jacobian of these numbers.
//!
//! R = Rot_z(α)·Rot_y(β)·Rot_x(γ), the Z-Y-X angles of Craig, Introduction to Robotics, section 2.8. β lies within ±π/2;
//! at β = ±π/2 the axes of α and γ coincide: γ is taken as 0 there, and the analytic Jacobian does not exist.

use nalgebra::SMatrix;

use crate::real::{Mat3, Real, Vec3, real};
use crate::se::Pose;
use crate::trig;

/// X = (α, β, γ; x, y, z): a pose as six numbers, angular part first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseVector<T: Real> {
    /// (α, β, γ): the angles about z, about the new y, about the newest x, rad.
    pub angles: Vec3<T>,
    /// (x, y, z), m.
    pub position: Vec3<T>,
}

impl<T: Real> From<&Pose<T>> for PoseVector<T> {
    fn from(pose: &Pose<T>) -> Self {
        let r = &pose.rotation;
        let level = trig::sqrt(r.m11 * r.m11 + r.m21 * r.m21);
        let beta = trig::atan2(-r.m31, level);
        let angles = if level > T::default_epsilon() * real(16.0) {
            Vec3::new(trig::atan2(r.m21, r.m11), beta, trig::atan2(r.m32, r.m33))
        } else {
            Vec3::new(trig::atan2(-r.m12, r.m22), beta, T::zero())
        };
        Self { angles, position: pose.position }
    }
}

impl<T: Real> From<&PoseVector<T>> for Pose<T> {
    fn from(vector: &PoseVector<T>) -> Self {
        let (sa, ca) = trig::sin_cos(vector.angles.x);
        let (sb, cb) = trig::sin_cos(vector.angles.y);
        let (sc, cc) = trig::sin_cos(vector.angles.z);
        let rotation = Mat3::new(
            ca * cb,
            ca * sb * sc - sa * cc,
            ca * sb * cc + sa * sc,
            sa * cb,
            sa * sb * sc + ca * cc,
            sa * sb * cc - ca * sc,
            -sb,
            cb * sc,
            cb * cc,
        );
        Self { rotation, position: vector.position }
    }
}

/// ∂X/∂q, 6 × N, of the pose vector from the base Jacobian of the same frame; `None` at β = ±π/2.
///
/// The rates of the angles are E⁻¹ω, with ω = E(α, β)·(α̇, β̇, γ̇) expressed in the base.
pub fn analytic_jacobian<T: Real, const N: usize>(
    jacobian_base: &SMatrix<T, 6, N>,
    vector: &PoseVector<T>,
) -> Option<SMatrix<T, 6, N>> {
    let (sa, ca) = trig::sin_cos(vector.angles.x);
    let (sb, cb) = trig::sin_cos(vector.angles.y);
    if cb.abs() <= T::default_epsilon() * real(16.0) {
        return None;
    }
    let mut analytic = *jacobian_base;
    for [x, y, z, ..] in &mut analytic.data.0 {
        let (wx, wy, wz) = (*x, *y, *z);
        let gamma_rate = (ca * wx + sa * wy) / cb;
        *x = wz + sb * gamma_rate;
        *y = ca * wy - sa * wx;
        *z = gamma_rate;
    }
    Some(analytic)
}
