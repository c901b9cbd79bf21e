//! Motions of the plane: SE(2), as the part of SE(3) that keeps z.

use core::ops::Mul;

use super::Pose;
use crate::real::{self, Real, Vec2, Vec3, real};
use crate::trig;

/// The pose of one frame in another, both in one plane: an element of SE(2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose2<T: Real> {
    /// The moving frame's origin in the frame of reference, m.
    pub position: Vec2<T>,
    /// From the x-axis of reference to the moving one, counter-clockwise, rad; any number of turns.
    pub angle_rad: T,
}

impl<T: Real> Pose2<T> {
    /// The pose of a frame in itself.
    pub fn identity() -> Self {
        Self { position: Vec2::zeros(), angle_rad: T::zero() }
    }

    /// The pose at (x, y) turned by `angle_rad`.
    pub fn new(x_m: T, y_m: T, angle_rad: T) -> Self {
        Self { position: Vec2::new(x_m, y_m), angle_rad }
    }

    /// The part of `pose` in the xy-plane: x, y, and where its x-axis points. The angle is within −π..=π.
    pub fn projection(pose: &Pose<T>) -> Self {
        Self { position: pose.position.xy(), angle_rad: trig::atan2(pose.rotation.m21, pose.rotation.m11) }
    }

    /// The pose `T_b_a` of this `T_a_b`.
    pub fn inverse(&self) -> Self {
        Self { position: -turned(&self.position, -self.angle_rad), angle_rad: -self.angle_rad }
    }

    /// `self⁻¹ · other`: the pose of `other` as seen from `self`.
    pub fn to(&self, other: &Self) -> Self {
        Self {
            position: turned(&(other.position - self.position), -self.angle_rad),
            angle_rad: other.angle_rad - self.angle_rad,
        }
    }

    /// The pose reached by moving with the constant twist (ω, v_x, v_y) for one unit of time.
    pub fn exp(twist: &Vec3<T>) -> Self {
        let full = Pose::exp(&super::Twist {
            angular: Vec3::new(T::zero(), T::zero(), twist.x),
            linear: Vec3::new(twist.y, twist.z, T::zero()),
        });
        Self { position: full.position.xy(), angle_rad: twist.x }
    }

    /// The twist (ω, v_x, v_y) with the least rotation whose [`exp`](Self::exp) is this pose up to complete turns.
    pub fn log(&self) -> Vec3<T> {
        let twist = Pose::from(*self).log();
        Vec3::new(twist.angular.z, twist.linear.x, twist.linear.y)
    }

    /// The motion (ω, v_x, v_y), given in the moving frame, expressed in the frame of reference.
    pub fn adjoint(&self, twist: &Vec3<T>) -> Vec3<T> {
        let v = turned(&Vec2::new(twist.y, twist.z), self.angle_rad);
        Vec3::new(twist.x, v.x + self.position.y * twist.x, v.y - self.position.x * twist.x)
    }

    /// d² = |Δp|² + ℓ²θ² between two poses, with one radian held equal to `length_scale_m` = ℓ. Left invariant.
    pub fn distance(&self, other: &Self, length_scale_m: T) -> T {
        let turn_m = wrapped(other.angle_rad - self.angle_rad) * length_scale_m;
        trig::sqrt((other.position - self.position).norm_squared() + turn_m * turn_m)
    }
}

impl Pose2<f64> {
    /// The same pose in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Pose2<U> {
        Pose2 { position: self.position.map(real), angle_rad: real(self.angle_rad) }
    }
}

impl<T: Real> Mul for Pose2<T> {
    type Output = Self;

    /// `T_a_b * T_b_c = T_a_c`; the angles add up, turns and all.
    fn mul(self, next: Self) -> Self {
        Self {
            position: self.position + turned(&next.position, self.angle_rad),
            angle_rad: self.angle_rad + next.angle_rad,
        }
    }
}

impl<T: Real> From<Pose2<T>> for Pose<T> {
    /// The same pose in space, in the plane z = 0.
    fn from(pose: Pose2<T>) -> Self {
        let (x, y) = (pose.position.x, pose.position.y);
        let turn = Vec3::new(T::zero(), T::zero(), pose.angle_rad);
        Pose { rotation: super::rotation_exp(&turn), position: Vec3::new(x, y, T::zero()) }
    }
}

/// The angle `angle_rad` less complete turns, within −π..=π.
fn wrapped<T: Real>(angle_rad: T) -> T {
    angle_rad - T::two_pi() * real::round(angle_rad / T::two_pi())
}

fn turned<T: Real>(vector: &Vec2<T>, angle_rad: T) -> Vec2<T> {
    let (s, c) = trig::sin_cos(angle_rad);
    Vec2::new(c * vector.x - s * vector.y, s * vector.x + c * vector.y)
}
