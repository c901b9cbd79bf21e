//! The ten inertial parameters of a rigid body: their names, the magnitude of their errors, and physical consistency.

use darm_core::real::Vec3;
use nalgebra::Matrix4;

/// Names and units of the inertial parameters: mass, first moments, and moments of inertia about the origin of its frame.
pub const INERTIAL_PARAMETERS: [(&str, &str); 10] = [
    ("m", "kg"),
    ("m·cx", "kg·m"),
    ("m·cy", "kg·m"),
    ("m·cz", "kg·m"),
    ("Ixx", "kg·m²"),
    ("Ixy", "kg·m²"),
    ("Iyy", "kg·m²"),
    ("Ixz", "kg·m²"),
    ("Iyz", "kg·m²"),
    ("Izz", "kg·m²"),
];

/// Least mass of a consistent body as a share of its nominal mass.
pub const MIN_MASS_SHARE: f64 = 0.1;
/// Least eigenvalue of the second moments of mass as a share of the sum of their magnitudes.
const MIN_MOMENT_SHARE: f64 = 1e-4;

/// How far the inertial parameters of a body may be off, from the parameters themselves and the mass of the robot.
///
/// Half its mass; its first moment by half its radius of gyration; its inertia by as much as it has. A body of nearly no
/// mass may have a hundredth of the robot's.
pub fn prior_deviations(inertial_parameters: &[f64; 10], robot_kg: f64) -> [f64; 10] {
    let [mass, _, _, _, xx, _, yy, _, _, zz] = *inertial_parameters;
    let mass = mass.max(0.01 * robot_kg);
    let inertia = xx.max(yy).max(zz).max(mass * 0.0025);
    let radius_m = (inertia / mass).sqrt();
    std::array::from_fn(|k| match k {
        0 => 0.5 * mass,
        1..=3 => 0.5 * mass * radius_m,
        _ => inertia,
    })
}

/// The physically consistent inertial parameters nearest to these, with mass and first moment unchanged; with less than
/// [`MIN_MASS_SHARE`] of the nominal mass, the nominal parameters scaled to that mass.
///
/// A body is consistent when its pseudo-inertia, [Σ, m·c; (m·c)ᵀ, m] with Σ = ½tr(I)·1 − I, is positive definite: m > 0 and
/// Σ − m·c·cᵀ positive definite; eigenvalues of the latter below a least one are raised. Source: P. M. Wensing, S. Kim,
/// J.-J. Slotine, IEEE Robotics and Automation Letters 3 (2018) 60.
pub fn project_physically_consistent(inertial_parameters: &[f64; 10], nominal: &[f64; 10]) -> [f64; 10] {
    let [mass, x, y, z, ..] = *inertial_parameters;
    if mass < MIN_MASS_SHARE * nominal[0] || mass <= 0.0 {
        return nominal.map(|parameter| MIN_MASS_SHARE * parameter);
    }
    let moment = Vec3::new(x, y, z);
    let second = pseudo_inertia(inertial_parameters).fixed_view::<3, 3>(0, 0).into_owned();
    let offset = moment * moment.transpose() / mass;
    let mut eigen = (second - offset).symmetric_eigen();
    let threshold = MIN_MOMENT_SHARE * eigen.eigenvalues.iter().map(|l| l.abs()).sum::<f64>();
    if eigen.eigenvalues.min() >= threshold {
        return *inertial_parameters;
    }
    eigen.eigenvalues.apply(|l| *l = l.max(threshold));
    let s = eigen.recompose() + offset;
    let [a, b, c] = [s.m22 + s.m33, s.m11 + s.m33, s.m11 + s.m22];
    [mass, x, y, z, a, -s.m12, b, -s.m13, -s.m23, c]
}

/// [Σ, m·c; (m·c)ᵀ, m] with Σ = ½tr(I)·1 − I, of m, m·c and I.
pub fn pseudo_inertia(&[m, x, y, z, xx, xy, yy, xz, yz, zz]: &[f64; 10]) -> Matrix4<f64> {
    let half = 0.5 * (xx + yy + zz);
    Matrix4::new(half - xx, -xy, -xz, x, -xy, half - yy, -yz, y, -xz, -yz, half - zz, z, x, y, z, m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_consistent_body_is_unchanged_and_an_inconsistent_one_becomes_consistent() {
        let ball = [2.0, 0.0, 0.0, 0.1, 0.02, 0.0, 0.02, 0.0, 0.0, 0.02];
        assert_eq!(project_physically_consistent(&ball, &ball), ball);
        let off_centre = [1.0, 0.5, 0.0, 0.0, 0.01, 0.0, 0.01, 0.0, 0.0, 0.01];
        let projected = project_physically_consistent(&off_centre, &ball);
        assert!(projected[0] > 0.0 && projected[0] * projected[6] > projected[1] * projected[1], "{projected:?}");
        assert_eq!(project_physically_consistent(&[-1.0; 10], &ball)[0], 0.2);
    }
}
