//! The regressor: inverse dynamics is linear in the inertial parameters, τ = Y(q, q̇, q̈)·φ.
//!
//! φ holds ten numbers a link, (m, m·c_x, m·c_y, m·c_z, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz), with the moments of inertia about
//! the origin of the frame that the joint was given with: [`Tree::parameters`].
//! Source: C. G. Atkeson, C. H. An, J. M. Hollerbach, Estimation of Inertial Parameters of Manipulator Loads and Links,
//! Int. J. of Robotics Research 5 (1986) 101.

use super::Vec3;
use super::newton_euler::{Motion, outward};
use crate::actuator::JointKind;
use crate::real::Real;
use crate::tree::{Frame, Frames, Tree, cross, dot, fused};

/// Y, by joint, link and parameter: N × N × 10; zero where the joint does not carry the link.
pub type Regressor<T, const N: usize> = [[[T; 10]; N]; N];

/// Fills `into` with Y for positions `q`, velocities `qd` and accelerations `qdd`; `frames` are those of `q`.
pub fn regressor<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    frames: &Frames<T, N>,
    [q, qd, qdd]: [&[T; N]; 3],
    into: &mut Regressor<T, N>,
) {
    let base = Motion::new(Vec3::zeros(), Vec3::zeros(), -tree.gravity);
    let motions = outward::<T, N, true>(tree, &base, [q, qd, qdd], &tree.turns(q), |_, _, _| ());
    *into = [[[T::zero(); 10]; N]; N];
    for (index, motion) in motions.iter().enumerate() {
        let (Some(link), Some(frame)) = (tree.links.get(index), frames.links().get(index)) else { continue };
        let turn = |v: &Vec3<T>| link.turned * v;
        let given = Motion::new(turn(&motion.angular), turn(&motion.angular_rate), turn(&motion.linear_rate));
        let axes = Frame { origin: frame.origin, ..Frame::given(frame, &link.turned) };
        let mut joint = index;
        for _ in 0..N {
            let (Some(carrier), Some(at)) = (tree.links.get(joint), frames.links().get(joint)) else { break };
            if let Some(ten) = into.get_mut(joint).and_then(|row| row.get_mut(index)) {
                *ten = match carrier.kind {
                    JointKind::Revolute => given
                        .turning(&axes.turn_back(&at.z), &axes.turn_back(&cross(&at.z, &(frame.origin - at.origin)))),
                    JointKind::Prismatic => given.sliding(&axes.turn_back(&at.z)),
                };
            }
            joint = usize::from(carrier.parent);
        }
    }
}

/// τ = Y·φ, N·m or N.
pub fn torque_of<T: Real, const N: usize>(regressor: &Regressor<T, N>, parameters: &[[T; 10]; N]) -> [T; N] {
    let mut torques = [T::zero(); N];
    for (torque, row) in torques.iter_mut().zip(regressor) {
        for (ten, link) in row.iter().zip(parameters) {
            *torque = ten.iter().zip(link).fold(*torque, |sum, (y, p)| sum + *y * *p);
        }
    }
    torques
}

impl<T: Real> Frame<T> {
    /// The axes of the frame that a joint was given with, from the turned one.
    #[inline(always)]
    fn given(turned: &Self, by: &crate::real::Mat3<T>) -> Self {
        Self {
            x: turned.turn(&Vec3::new(by.m11, by.m12, by.m13)),
            y: turned.turn(&Vec3::new(by.m21, by.m22, by.m23)),
            z: turned.turn(&Vec3::new(by.m31, by.m32, by.m33)),
            origin: turned.origin,
        }
    }
}

impl<T: Real> Motion<T> {
    /// Power of the link's load, per parameter, along a motion (ω, v) expressed in the link's frame at its origin.
    #[inline(always)]
    fn turning(&self, w: &Vec3<T>, v: &Vec3<T>) -> [T; 10] {
        let (a, r, u) = (&self.angular, &self.angular_rate, cross(w, &self.angular));
        let [_, x, y, z, ..] = self.sliding(v);
        let h = Vec3::new(x, y, z) + cross(&self.linear_rate, w);
        [
            dot(v, &self.linear_rate),
            h.x,
            h.y,
            h.z,
            fused(w.x, r.x, u.x * a.x),
            fused(w.x, r.y, fused(w.y, r.x, fused(u.x, a.y, u.y * a.x))),
            fused(w.y, r.y, u.y * a.y),
            fused(w.x, r.z, fused(w.z, r.x, fused(u.x, a.z, u.z * a.x))),
            fused(w.y, r.z, fused(w.z, r.y, fused(u.y, a.z, u.z * a.y))),
            fused(w.z, r.z, u.z * a.z),
        ]
    }

    /// As [`turning`](Self::turning), for a motion without rotation.
    #[inline(always)]
    fn sliding(&self, v: &Vec3<T>) -> [T; 10] {
        let zero = T::zero();
        let [x, y, z] = &self.spin;
        let h = x * v.x + y * v.y + z * v.z;
        [dot(v, &self.linear_rate), h.x, h.y, h.z, zero, zero, zero, zero, zero, zero]
    }
}
