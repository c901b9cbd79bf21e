//! Rotations nearest to measured ones.

use darm_core::real::{Mat3, Vec3};

/// The rotation R that makes tr(Rᵀ·sum) largest.
///
/// Source: W. Kabsch, Acta Cryst. A32 (1976) 922.
pub(crate) fn nearest_rotation(sum: &Mat3<f64>) -> Mat3<f64> {
    let svd = sum.svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else { return Mat3::identity() };
    let mut signs = Vec3::repeat(1.0);
    signs[svd.singular_values.imin()] = (u * vt).determinant().signum();
    u * Mat3::from_diagonal(&signs) * vt
}
