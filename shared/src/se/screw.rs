//! Twists and wrenches: the velocity of a rigid body and the load on it, angular part first.

use core::ops::{Add, Mul, Neg, Sub};

use crate::real::{Real, Vec3, Vec6};
use crate::trig;

/// The velocity of a frame, or a small motion of it: (ω, v).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist<T: Real> {
    /// ω, rad per unit of what moves the frame.
    pub angular: Vec3<T>,
    /// v of the point at the origin, m per unit of what moves the frame.
    pub linear: Vec3<T>,
}

/// A load on a rigid body: (m, f).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrench<T: Real> {
    /// Moment about the origin, N·m.
    pub moment: Vec3<T>,
    /// Force, N.
    pub force: Vec3<T>,
}

impl<T: Real> Twist<T> {
    /// Rest.
    pub fn zero() -> Self {
        Self { angular: Vec3::zeros(), linear: Vec3::zeros() }
    }

    /// The six numbers, ω first.
    pub fn to_vector(&self) -> Vec6<T> {
        let (w, v) = (&self.angular, &self.linear);
        Vec6::new(w.x, w.y, w.z, v.x, v.y, v.z)
    }

    /// The twist of six numbers, ω first.
    pub fn from_vector(six: &Vec6<T>) -> Self {
        Self { angular: Vec3::new(six[0], six[1], six[2]), linear: Vec3::new(six[3], six[4], six[5]) }
    }

    /// √(|v|² + ℓ²|ω|²) with one radian held equal to `length_scale_m` = ℓ.
    pub fn size(&self, length_scale_m: T) -> T {
        trig::sqrt(self.linear.norm_squared() + (self.angular * length_scale_m).norm_squared())
    }
}

impl<T: Real> Wrench<T> {
    /// No load.
    pub fn zero() -> Self {
        Self { moment: Vec3::zeros(), force: Vec3::zeros() }
    }

    /// The force `force` acting at `point`, about the origin.
    pub fn of_force(force: Vec3<T>, point: &Vec3<T>) -> Self {
        Self { moment: point.cross(&force), force }
    }

    /// The power of this load on a body moving with `twist`, expressed in the same frame, W.
    pub fn power(&self, twist: &Twist<T>) -> T {
        self.moment.dot(&twist.angular) + self.force.dot(&twist.linear)
    }
}

macro_rules! linear {
    ($screw:ident, $angular:ident, $linear:ident) => {
        impl<T: Real> Add for $screw<T> {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self { $angular: self.$angular + other.$angular, $linear: self.$linear + other.$linear }
            }
        }

        impl<T: Real> Sub for $screw<T> {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self { $angular: self.$angular - other.$angular, $linear: self.$linear - other.$linear }
            }
        }

        impl<T: Real> Neg for $screw<T> {
            type Output = Self;
            fn neg(self) -> Self {
                Self { $angular: -self.$angular, $linear: -self.$linear }
            }
        }

        impl<T: Real> Mul<T> for $screw<T> {
            type Output = Self;
            fn mul(self, factor: T) -> Self {
                Self { $angular: self.$angular * factor, $linear: self.$linear * factor }
            }
        }
    };
}

linear!(Twist, angular, linear);
linear!(Wrench, moment, force);
