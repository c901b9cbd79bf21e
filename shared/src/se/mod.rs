//! Rigid motions: poses on SE(3) and SE(2), twists, wrenches, and the maps between them.
//!
//! # Conventions
//!
//! - Rotations are active and right-handed. `T_a_b` is the pose of frame b in frame a: it takes the coordinates of a
//!   point in b to those in a, and in a product the names that touch are equal, `T_a_b * T_b_c`.
//! - Twists and wrenches have the angular part first: (ω, v) and (m, f).
//! - A twist V of a moving pose T is expressed in the moving frame, T⁻¹·dT/dt = \[V\]; `T.adjoint(V)` gives the same
//!   motion in the frame that T is given in.
//! - Metres, radians, newtons.
//!
//! Source: Murray, Li, Sastry, A Mathematical Introduction to Robotic Manipulation, CRC Press, 1994, chapter 2.
#![allow(non_snake_case)]

mod planar;
mod screw;

use core::ops::Mul;

use nalgebra::{Matrix3, Vector3};

use crate::real::{Mat3, Real, Vec3, cast, real};
use crate::trig;
pub use planar::Pose2;
pub use screw::{Twist, Wrench};

/// The pose of one frame in another: an element of SE(3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<T: Real> {
    /// Columns are the moving frame's axes, expressed in the frame of reference.
    pub rotation: Mat3<T>,
    /// The moving frame's origin in the frame of reference, m.
    pub position: Vec3<T>,
}

impl<T: Real> Pose<T> {
    /// The pose of a frame in itself.
    pub fn identity() -> Self {
        Self { rotation: Matrix3::identity(), position: Vector3::zeros() }
    }

    /// A frame with its origin at `position`, turned by `rotation_vector` (axis times angle, rad).
    pub fn new(rotation_vector: &Vec3<T>, position: Vec3<T>) -> Self {
        Self { rotation: rotation_exp(rotation_vector), position }
    }

    /// A frame with its origin at `position`, not turned.
    pub fn at(position: Vec3<T>) -> Self {
        Self { rotation: Matrix3::identity(), position }
    }

    /// The pose `T_b_a` of this `T_a_b`.
    pub fn inverse(&self) -> Self {
        Self { rotation: self.rotation.transpose(), position: -self.rotation.tr_mul(&self.position) }
    }

    /// `self⁻¹ · other`: the pose of `other` as seen from `self`.
    pub fn to(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation.tr_mul(&other.rotation),
            position: self.rotation.tr_mul(&(other.position - self.position)),
        }
    }

    /// The pose reached from the identity by moving with the constant `twist` for one unit of time.
    pub fn exp(twist: &Twist<T>) -> Self {
        let w = &twist.angular;
        let f = Factors::of(w);
        let turn = w.cross(&twist.linear);
        Self { rotation: f.rotation(w), position: twist.linear + turn * f.versine + w.cross(&turn) * f.excess() }
    }

    /// The twist with the least rotation whose [`exp`](Self::exp) is this pose; the angle is within 0..=π.
    pub fn log(&self) -> Twist<T> {
        let w = rotation_log(&self.rotation);
        let turn = w.cross(&self.position);
        let linear = self.position - turn * real::<T>(0.5) + w.cross(&turn) * inverse_excess(&w);
        Twist { angular: w, linear }
    }

    /// The motion `twist`, given in the moving frame, expressed in the frame of reference: Ad(T)·V.
    pub fn adjoint(&self, twist: &Twist<T>) -> Twist<T> {
        let angular = self.rotation * twist.angular;
        Twist { angular, linear: self.rotation * twist.linear + self.position.cross(&angular) }
    }

    /// The motion `twist`, given in the frame of reference, expressed in the moving frame: Ad(T⁻¹)·V.
    pub fn adjoint_inverse(&self, twist: &Twist<T>) -> Twist<T> {
        Twist {
            angular: self.rotation.tr_mul(&twist.angular),
            linear: self.rotation.tr_mul(&(twist.linear - self.position.cross(&twist.angular))),
        }
    }

    /// The load `wrench`, given in the frame of reference about its origin, expressed in the moving frame about its own:
    /// Ad(T)ᵀ·F, so that the power of a load is the same in both frames.
    pub fn wrench_inverse(&self, wrench: &Wrench<T>) -> Wrench<T> {
        Wrench {
            moment: self.rotation.tr_mul(&(wrench.moment - self.position.cross(&wrench.force))),
            force: self.rotation.tr_mul(&wrench.force),
        }
    }

    /// The angle of the rotation, within 0..=π, rad.
    pub fn angle_rad(&self) -> T {
        trig::sqrt(rotation_log(&self.rotation).norm_squared())
    }

    /// d² = |Δp|² + ℓ²θ² between two poses, with one radian held equal to `length_scale_m` = ℓ.
    ///
    /// Left invariant: moving both poses by the same motion does not change their distance.
    pub fn distance(&self, other: &Self, length_scale_m: T) -> T {
        let apart = self.to(other);
        let turn_m = rotation_log(&apart.rotation) * length_scale_m;
        trig::sqrt(apart.position.norm_squared() + turn_m.norm_squared())
    }

    /// One of the six numbers of the pose: of its rotation vector (0, 1, 2; rad) or position (3, 4, 5; m).
    pub fn coordinate(&self, component: u8) -> Option<T> {
        match component {
            0..3 => rotation_log(&self.rotation).get(usize::from(component)).copied(),
            _ => self.position.get(usize::from(component) - 3).copied(),
        }
    }

    /// The pose with one of its six numbers replaced; `None` past the sixth.
    pub fn with_coordinate(&self, component: u8, value: T) -> Option<Self> {
        let mut pose = *self;
        if component < 3 {
            let mut w = rotation_log(&self.rotation);
            *w.get_mut(usize::from(component))? = value;
            pose.rotation = rotation_exp(&w);
        } else {
            *pose.position.get_mut(usize::from(component) - 3)? = value;
        }
        Some(pose)
    }

    /// How the pose moves, expressed in its own frame, per unit of one of its six numbers.
    pub fn coordinate_twist(&self, component: u8) -> Twist<T> {
        let mut twist = Twist::zero();
        let unit = |axis: u8| Vec3::from_fn(|row, _| if row == usize::from(axis) { T::one() } else { T::zero() });
        if component < 3 {
            twist.angular = rotation_jacobian(&rotation_log(&self.rotation)) * unit(component);
        } else {
            twist.linear = self.rotation.tr_mul(&unit(component - 3));
        }
        twist
    }

    /// Whether a motion in the xy-plane reaches this pose: z stays, and only z is turned about.
    pub fn is_planar(&self) -> bool {
        self.position.z == T::zero() && self.rotation.m33 == T::one()
    }
}

impl Pose<f64> {
    /// The same pose in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Pose<U> {
        Pose { rotation: self.rotation.map(real), position: cast(&self.position) }
    }
}

impl<T: Real> Mul for Pose<T> {
    type Output = Self;

    /// `T_a_b * T_b_c = T_a_c`.
    #[inline]
    fn mul(self, next: Self) -> Self {
        Self { rotation: self.rotation * next.rotation, position: self.rotation * next.position + self.position }
    }
}

impl<T: Real> Mul<Vec3<T>> for Pose<T> {
    type Output = Vec3<T>;

    /// `T_a_b * p_b = p_a`: the coordinates of a point.
    #[inline]
    fn mul(self, point: Vec3<T>) -> Vec3<T> {
        self.rotation * point + self.position
    }
}

/// The factors of \[ω\] and \[ω\]² in the exponential maps, for one rotation vector of length θ.
struct Factors<T> {
    /// θ²
    square: T,
    /// sin θ / θ
    sine: T,
    /// (1 − cos θ) / θ²
    versine: T,
}

/// Below this θ² the series are exact to the last bit of an `f64`, and need no root, sine or cosine.
const SERIES_BELOW: f64 = 0.25;

impl<T: Real> Factors<T> {
    #[inline]
    fn of(w: &Vec3<T>) -> Self {
        let square = w.norm_squared();
        if square < real(SERIES_BELOW) {
            return Self { square, sine: series(square, &SINE), versine: series(square, &VERSINE) };
        }
        let angle = trig::sqrt(square);
        // Half angles: 1 − cos θ would lose half of an f32's digits at small angles.
        let (s, c) = trig::sin_cos(angle * real(0.5));
        Self { square, sine: (s + s) * c / angle, versine: (s + s) * s / square }
    }

    /// (θ − sin θ) / θ³
    fn excess(&self) -> T {
        if self.square < real(SERIES_BELOW) {
            series(self.square, &EXCESS)
        } else {
            (T::one() - self.sine) / self.square
        }
    }

    /// exp \[ω\] = I + sin θ/θ \[ω\] + (1 − cos θ)/θ² \[ω\]² (Rodrigues).
    #[inline]
    fn rotation(&self, w: &Vec3<T>) -> Mat3<T> {
        rodrigues(w, self.sine, self.versine)
    }
}

const SINE: [f64; 7] =
    [1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0, -1.0 / 39_916_800.0, 1.0 / 6_227_020_800.0];
const VERSINE: [f64; 7] =
    [0.5, -1.0 / 24.0, 1.0 / 720.0, -1.0 / 40_320.0, 1.0 / 3_628_800.0, -1.0 / 479_001_600.0, 1.0 / 87_178_291_200.0];
const EXCESS: [f64; 7] = [
    1.0 / 6.0,
    -1.0 / 120.0,
    1.0 / 5040.0,
    -1.0 / 362_880.0,
    1.0 / 39_916_800.0,
    -1.0 / 6_227_020_800.0,
    1.0 / 1_307_674_368_000.0,
];
/// (1 − θ/2·cot θ/2)/θ² = Σ |B₂ₖ|/(2k)! θ²ᵏ⁻² with the Bernoulli numbers B.
const INVERSE_EXCESS: [f64; 7] = [
    1.0 / 12.0,
    1.0 / 720.0,
    1.0 / 30_240.0,
    1.0 / 1_209_600.0,
    1.0 / 47_900_160.0,
    691.0 / 1_307_674_368_000.0,
    1.0 / 74_724_249_600.0,
];

#[inline]
fn series<T: Real>(square: T, coefficients: &[f64; 7]) -> T {
    coefficients.iter().rev().fold(T::zero(), |sum, c| sum * square + real(*c))
}

/// I + a·\[w\] + b·\[w\]².
#[inline]
fn rodrigues<T: Real>(w: &Vec3<T>, a: T, b: T) -> Mat3<T> {
    let (x, y, z) = (w.x, w.y, w.z);
    let one = T::one();
    Mat3::new(
        one - b * (y * y + z * z),
        b * x * y - a * z,
        b * x * z + a * y,
        b * x * y + a * z,
        one - b * (x * x + z * z),
        b * y * z - a * x,
        b * x * z - a * y,
        b * y * z + a * x,
        one - b * (x * x + y * y),
    )
}

/// The rotation by the angle |w| about w.
pub fn rotation_exp<T: Real>(w: &Vec3<T>) -> Mat3<T> {
    Factors::of(w).rotation(w)
}

/// The rotation about a unit vector by an angle, rad: [`rotation_exp`] of axis · angle, without the root of its length.
#[inline]
pub fn rotation_about<T: Real>(axis: &Vec3<T>, angle_rad: T) -> Mat3<T> {
    let (s, c) = trig::sin_cos(angle_rad * real(0.5));
    rodrigues(axis, (s + s) * c, (s + s) * s)
}

/// How the rotation exp \[w\] turns, expressed in its own frame, when w grows: the right Jacobian of SO(3).
pub fn rotation_jacobian<T: Real>(w: &Vec3<T>) -> Mat3<T> {
    let f = Factors::of(w);
    rodrigues(w, -f.versine, f.excess())
}

/// The rotation vector of `rotation`, of a length within 0..=π, rad.
///
/// By way of the unit quaternion with its largest component first, so that nothing cancels near 0 or near π.
pub fn rotation_log<T: Real>(rotation: &Mat3<T>) -> Vec3<T> {
    let (w, v) = quaternion(rotation);
    let (w, v) = if w < T::zero() { (-w, -v) } else { (w, v) };
    let sine_squared = v.norm_squared();
    let ratio = sine_squared / (w * w);
    if ratio < real(1e-6) {
        // 2·atan(x)/x with x² = ratio, as a series: a root has no derivative at zero.
        let atan = T::one() - ratio * (real::<T>(1.0 / 3.0) - ratio * real(0.2));
        return v * (atan * real(2.0) / w);
    }
    let sine = trig::sqrt(sine_squared);
    v * (trig::atan2(sine, w) * real(2.0) / sine)
}

/// A unit quaternion of `rotation`: its real and its vector part, of either sign (Shepperd's method).
fn quaternion<T: Real>(rotation: &Mat3<T>) -> (T, Vec3<T>) {
    let r = rotation;
    let one = T::one();
    let fours = [
        one + r.m11 + r.m22 + r.m33,
        one + r.m11 - r.m22 - r.m33,
        one - r.m11 + r.m22 - r.m33,
        one - r.m11 - r.m22 + r.m33,
    ];
    let odd = Vec3::new(r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12);
    let (xy, xz, yz) = (r.m12 + r.m21, r.m13 + r.m31, r.m23 + r.m32);
    let largest = fours.iter().fold(T::zero(), |a, b| if *b > a { *b } else { a });
    let (w, v) = if largest == fours[0] {
        (fours[0], odd)
    } else if largest == fours[1] {
        (odd.x, Vec3::new(fours[1], xy, xz))
    } else if largest == fours[2] {
        (odd.y, Vec3::new(xy, fours[2], yz))
    } else {
        (odd.z, Vec3::new(xz, yz, fours[3]))
    };
    let scale = real::<T>(0.5) / trig::sqrt(largest);
    (w * scale, v * scale)
}

/// (1 − θ/2·cot θ/2)/θ², the factor of \[ω\]² in the logarithm.
fn inverse_excess<T: Real>(w: &Vec3<T>) -> T {
    let square = w.norm_squared();
    if square < real(SERIES_BELOW) {
        return series(square, &INVERSE_EXCESS);
    }
    let half = trig::sqrt(square) * real(0.5);
    let (s, c) = trig::sin_cos(half);
    (T::one() - half * c / s) / square
}

#[cfg(test)]
mod tests;
