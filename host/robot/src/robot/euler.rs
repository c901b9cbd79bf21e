//! Orientations as three angles about axes that move along, in any of the twelve conventions, and the Jacobian of the angles.
//!
//! R = Rot_i(α)·Rot_j(β)·Rot_k(γ): about an axis of the base, about the axis that this turned, and about the one that both
//! turned. With three different axes (Z-Y-X, …) the angles do not describe β = ±π/2, where the first and the last axis are
//! parallel; with equal first and last axes (Z-Y-Z, …) they do not describe β = 0 and β = π. There γ is taken as 0, and the
//! analytic Jacobian does not exist: this singularity is one of the description, not of the arm.
//!
//! ω = E(α, β)·(α̇, β̇, γ̇) in the axes of the base; the columns of E are the axes of the three turns, and det E is ±cos β or
//! ±sin β. Source: J. J. Craig, Introduction to Robotics: Mechanics and Control, sections 2.8, 5.3 and appendix B.

use std::fmt;
use std::str::FromStr;

use darm_core::real::{Mat3, Vec3};
use darm_core::se::rotation_about;

use super::state::{Jacobian, Kinematics};
use crate::tree::spatial::six;

/// |det E| below this counts as singular.
const MIN_DETERMINANT: f64 = 1e-9;

/// The axes of three turns, 0 to 2 for x to z: neighbours differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EulerAxes([usize; 3]);

/// A text that names no convention.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is no convention of Euler angles; give three of x, y and z, with neighbours that differ, such as zyx or zyz"
)]
pub struct NotEuler(String);

/// The pose vector (α, β, γ, x, y, z) of a frame, and how it moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Analytic {
    /// α, β, γ, rad.
    pub angles_rad: Vec3<f64>,
    /// det E.
    pub determinant: f64,
    /// Rates of the pose vector per unit of each joint, 6 × n; `None` where E is singular.
    pub jacobian: Option<Jacobian>,
}

impl FromStr for EulerAxes {
    type Err = NotEuler;

    fn from_str(text: &str) -> Result<Self, NotEuler> {
        let axis = |letter: char| "xyz".find(letter.to_ascii_lowercase());
        let axes: Option<Vec<usize>> = text.chars().filter(|letter| *letter != '-').map(axis).collect();
        match axes.as_deref() {
            Some(&[i, j, k]) if i != j && j != k => Ok(Self([i, j, k])),
            _ => Err(NotEuler(text.to_owned())),
        }
    }
}

impl fmt::Display for EulerAxes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [i, j, k] = self.0.map(|axis| ["Z", "Y", "X"][2 - axis]);
        write!(f, "{i}-{j}-{k}")
    }
}

impl EulerAxes {
    /// α, β and γ of a rotation, rad: β within ±π/2 with three different axes, from 0 to π otherwise.
    pub fn angles(self, rotation: &Mat3<f64>) -> Vec3<f64> {
        let r = |row: usize, column: usize| rotation[(row, column)];
        let [i, j, last] = self.0;
        let k = 3 - i - j;
        let sign = self.sign();
        let (sine, cosine, first, third) = if last == i {
            let size = r(i, j).hypot(r(i, k));
            (size, r(i, i), [r(j, i), -sign * r(k, i)], [r(i, j), sign * r(i, k)])
        } else {
            let size = r(i, i).hypot(r(i, j));
            (sign * r(i, k), size, [-sign * r(j, k), r(k, k)], [-sign * r(i, j), r(i, i)])
        };
        let beta = sine.atan2(cosine);
        let determinant = if last == i { sine } else { cosine };
        if determinant.abs() <= 16.0 * f64::EPSILON {
            return Vec3::new((sign * r(k, j)).atan2(r(j, j)), beta, 0.0);
        }
        Vec3::new(first[0].atan2(first[1]), beta, third[0].atan2(third[1]))
    }

    /// The rotation of three angles, rad.
    pub fn rotation(self, angles_rad: &Vec3<f64>) -> Mat3<f64> {
        let turn = |turn: usize| rotation_about(&unit(self.0[turn]), angles_rad[turn]);
        turn(0) * turn(1) * turn(2)
    }

    /// E: the axes of the three turns in the axes of the base.
    pub fn axes(self, angles_rad: &Vec3<f64>) -> Mat3<f64> {
        let turn = |turn: usize| rotation_about(&unit(self.0[turn]), angles_rad[turn]);
        let [first, second, third] = self.0.map(unit);
        Mat3::from_columns(&[first, turn(0) * second, turn(0) * turn(1) * third])
    }

    /// 1 when the first two axes and the remaining one are in the order of x, y, z; −1 otherwise.
    fn sign(self) -> f64 {
        if (self.0[0] + 1) % 3 == self.0[1] { 1.0 } else { -1.0 }
    }
}

fn unit(axis: usize) -> Vec3<f64> {
    Vec3::from_fn(|row, _| if row == axis { 1.0 } else { 0.0 })
}

impl Kinematics {
    /// The pose vector in a convention, and the analytic Jacobian: ∂(α, β, γ, x, y, z)/∂q.
    pub fn analytic(&self, axes: EulerAxes) -> Analytic {
        let angles_rad = axes.angles(&self.pose_base_frame.rotation);
        let turns = axes.axes(&angles_rad);
        let determinant = turns.determinant();
        let inverse = turns.try_inverse().filter(|_| determinant.abs() > MIN_DETERMINANT);
        let jacobian = inverse.map(|inverse| {
            let mut jacobian = self.jacobian_base.clone();
            for mut column in jacobian.column_iter_mut() {
                let angular = Vec3::new(column[0], column[1], column[2]);
                let linear = Vec3::new(column[3], column[4], column[5]);
                column.copy_from(&six(&(inverse * angular), &linear));
            }
            jacobian
        });
        Analytic { angles_rad, determinant, jacobian }
    }
}

#[cfg(test)]
mod tests {
    use darm_core::se::{Pose, rotation_exp};
    use darm_core::tree::euler::PoseVector;

    use super::*;

    const ALL: [&str; 12] = ["xyz", "xzy", "yxz", "yzx", "zxy", "zyx", "xyx", "xzx", "yxy", "yzy", "zxz", "zyz"];

    fn draws() -> impl Iterator<Item = Mat3<f64>> {
        (1..40).map(|k| {
            let k = f64::from(k);
            rotation_exp(&Vec3::new(2.1 * (1.3 * k).sin(), 1.7 * (2.9 * k).cos(), 1.9 * (0.7 * k).sin()))
        })
    }

    #[test]
    fn angles_of_all_twelve_conventions_lead_back_to_the_rotation() {
        for name in ALL {
            let axes: EulerAxes = name.parse().unwrap();
            for rotation in draws() {
                assert!((axes.rotation(&axes.angles(&rotation)) - rotation).amax() < 1e-13, "{name}");
            }
            // At the singularity, and half a turn from it.
            for beta in [0.0, 0.5, 1.0].map(|share| share * std::f64::consts::PI) {
                let rotation = axes.rotation(&Vec3::new(0.4, beta, 0.3));
                assert!((axes.rotation(&axes.angles(&rotation)) - rotation).amax() < 1e-7, "{name} {beta}");
            }
        }
    }

    #[test]
    fn zyx_is_the_pose_vector_of_the_core() {
        let axes: EulerAxes = "z-y-x".parse().unwrap();
        assert_eq!(axes.to_string(), "Z-Y-X");
        for rotation in draws() {
            let core = PoseVector::from(&Pose { rotation, position: Vec3::zeros() }).angles;
            assert!((axes.angles(&rotation) - core).amax() < 1e-14);
        }
    }

    /// d/dt R of changing angles is [ω]× R with ω = E·rates.
    #[test]
    fn the_axes_of_the_turns_give_the_angular_velocity() {
        let (angles, rates, step) = (Vec3::new(0.4, 0.9, -1.1), Vec3::new(0.3, -0.7, 0.5), 1e-6);
        for name in ALL {
            let axes: EulerAxes = name.parse().unwrap();
            let rotation = |t: f64| axes.rotation(&(angles + rates * t));
            let spin = (rotation(step) - rotation(-step)) / (2.0 * step) * rotation(0.0).transpose();
            let omega = axes.axes(&angles) * rates;
            assert!((spin - omega.cross_matrix()).amax() < 1e-9, "{name}");
        }
    }

    #[test]
    fn other_texts_are_refused() {
        for text in ["", "zz", "zzy", "abc", "xyzx"] {
            assert_eq!(text.parse::<EulerAxes>(), Err(NotEuler(text.to_owned())));
        }
    }
}
