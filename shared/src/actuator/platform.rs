//! A parallel platform: a top plate carried by discrete legs on a base plate, three in a plane or six in space.
//!
//! # Model
//!
//! |p + R·t_k − b_k| = l_k for each leg k
//!
//! | symbol | field      | unit | meaning                                            |
//! |--------|------------|------|----------------------------------------------------|
//! | R, p   | `pose`     | 1, m | pose of the top plate in the base plate's frame    |
//! | b_k    | `base`     | m    | anchor on the base plate, in its frame             |
//! | t_k    | `top`      | m    | anchor on the top plate, in its frame              |
//! | l_k    | `length_m` | m    | distance of the two anchors                        |
//! | u_k    |            | 1    | unit vector from b_k to p + R·t_k                  |
//!
//! A leg grows by l̇ = u·(v + ω × R·t) when the top turns with ω and its origin moves with v: one row of the matrix D.
//! Newton's method on the group starts at `home`, which names the assembly mode, and solves D·(ω, v) = l − |…|.
//! As the row is the wrench of a unit force along the leg, Dᵀ·f = −w gives the forces that carry a load w.
//! Both are expressed in the axes of the base plate, about the origin of the top.
//!
//! Valid while the legs do not pass a singular posture on the way from `home`: there det D changes its sign, and the
//! platform may fall into another of its assembly modes (four in the plane, up to forty in space).
//! Source: Merlet, Parallel Robots, Springer, 2006, chapters 4 to 6.

use core::fmt;

use super::linear::{solve, transposed};
use super::{MAX_LEGS, MAX_STATES, Part, Setting};
use crate::real::{self, Real, Vec3, real, to_f32};
use crate::se::{Pose, Twist, Wrench, rotation_exp};
use crate::trig;

/// Steps of Newton's method before a platform counts as impossible to assemble.
pub const MAX_ITERATIONS: u8 = 30;

/// A platform with less than this |det D|, over the largest entry of each column at home, is too near a singular
/// posture.
pub const MIN_DETERMINANT: f64 = 1e-2;

/// A step turns the plate by this many radians at most, and moves it by this share of the longest leg.
const MAX_STEP: f64 = 0.5;

/// A leg that is driven onto one of a few stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg<T: Real> {
    /// Anchor on the base plate, in its frame, m.
    pub base: Vec3<T>,
    /// Anchor on the top plate, in its frame, m.
    pub top: Vec3<T>,
    /// Distance of the anchors in each state, m; state 0 is the contracted one.
    pub length_m: [T; MAX_STATES],
    /// How many of the lengths count.
    pub states: u8,
}

/// A top plate on `LEGS` discrete legs: 3 in the xy-plane, 6 in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Platform<T: Real, const LEGS: usize> {
    /// The legs in the order of their digits; in the plane left, diagonal, right.
    pub legs: [Leg<T>; LEGS],
    /// A pose of the top in the base near those that are meant.
    pub home: Pose<T>,
}

/// A platform put together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assembly<T: Real> {
    /// Pose of the top in the base.
    pub pose: Pose<T>,
    /// Steps that it took.
    pub iterations: u8,
}

/// Why a platform has no pose that can be trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PlatformError {
    /// No pose was found that gives the legs their lengths.
    NotAssembled {
        /// By how much the last pose tried misses the worst leg, m.
        miss_m: f32,
    },
    /// The platform gives way: some motion of the top changes no leg.
    NearSingular {
        /// The scaled determinant of D.
        determinant: f32,
        /// What it has to exceed.
        min: f32,
    },
    /// The legs fit together, but the wrong way round.
    OtherMode {
        /// The scaled determinant of D.
        determinant: f32,
        /// The same at home: of the other sign.
        home: f32,
    },
}

impl<T: Real> Leg<T> {
    pub(super) fn setting(&self, digit: u8) -> Option<Setting<T>> {
        let value = *self.length_m.get(usize::from(digit))?;
        Some(Setting { base: self.base, top: self.top, value })
    }
}

impl<T: Real, const LEGS: usize> Platform<T, LEGS> {
    /// Where the motions that the legs govern begin among (ω, v): with ω_z in the plane.
    const FIRST: usize = {
        assert!(LEGS == 3 || LEGS == 6, "a platform has 3 legs in the plane or 6 in space");
        if LEGS == 3 { 2 } else { 0 }
    };

    /// The pose of the top whose legs are as `legs` says, in the assembly mode of `home`.
    ///
    /// # Errors
    ///
    /// [`PlatformError::NotAssembled`]: no pose was found that gives the legs their lengths.
    /// [`PlatformError::NearSingular`]: a motion of the top changes no leg. [`PlatformError::OtherMode`]: the pose
    /// found is in another assembly mode than `home`.
    pub fn assemble(&self, legs: &[Setting<T>; MAX_LEGS]) -> Result<Assembly<T>, PlatformError> {
        let mut pose = self.home;
        let mut home = None;
        let mut miss = T::zero();
        let longest = legs.iter().take(LEGS).fold(T::default_epsilon(), |max, leg| max.max(leg.value));
        for iterations in 1..=MAX_ITERATIONS {
            let (rows, missing) = Self::rows(legs, &pose);
            let (motions, determinant) = solve(&rows, &missing);
            let (home, scale) = *home.get_or_insert_with(|| (determinant, column_scale(&rows)));
            checked(determinant / scale)?;
            pose = moved(&pose, &limited(Self::to_twist(&motions), longest));
            miss = missing.iter().fold(T::zero(), |max, m| max.max(m.abs()));
            if miss < tolerance::<T>() * longest {
                return in_mode(determinant / scale, home / scale).map(|()| Assembly { pose, iterations });
            }
        }
        Err(PlatformError::NotAssembled { miss_m: to_f32(miss) })
    }

    /// The pose after `steps` steps of Newton's method from `start`, however far each leads: for lengths that are known to need no more.
    pub fn after_steps(legs: &[Setting<T>; MAX_LEGS], start: &Pose<T>, steps: usize) -> Pose<T> {
        (0..steps).fold(*start, |pose, _| {
            let (rows, missing) = Self::rows(legs, &pose);
            moved(&pose, &Self::to_twist(&solve(&rows, &missing).0))
        })
    }

    /// det D over the largest entry of each column, with the top at `pose`: zero in a singular posture, and of one sign
    /// throughout an assembly mode.
    pub fn determinant(&self, pose: &Pose<T>) -> T {
        let (rows, _) = Self::rows(&self.anchors(), pose);
        solve(&rows, &[T::zero(); LEGS]).1 / column_scale(&rows)
    }

    /// The lengths that put the top at `pose`, m.
    pub fn lengths(&self, pose: &Pose<T>) -> [T; LEGS] {
        let legs = self.anchors();
        core::array::from_fn(|k| line(&legs[k], pose).length)
    }

    fn anchors(&self) -> [Setting<T>; MAX_LEGS] {
        let mut anchors = [Setting::of_joint(T::zero()); MAX_LEGS];
        for (anchor, leg) in anchors.iter_mut().zip(&self.legs) {
            (anchor.base, anchor.top) = (leg.base, leg.top);
        }
        anchors
    }

    /// How the top moves, expressed in its own frame, per unit of one number of `leg`, with all others held.
    pub(super) fn twist(&self, legs: &[Setting<T>; MAX_LEGS], pose: &Pose<T>, leg: usize, part: Part) -> Twist<T> {
        let Some(setting) = legs.get(leg) else { return Twist::zero() };
        let growth = match part {
            Part::Value => T::one(),
            Part::Base(axis) => coordinate(&line(setting, pose).direction, axis),
            Part::Top(axis) => -coordinate(&pose.rotation.tr_mul(&line(setting, pose).direction), axis),
        };
        let growths = core::array::from_fn(|k| if k == leg { growth } else { T::zero() });
        let in_base = Self::to_twist(&solve(&Self::rows(legs, pose).0, &growths).0);
        Twist { angular: pose.rotation.tr_mul(&in_base.angular), linear: pose.rotation.tr_mul(&in_base.linear) }
    }

    /// What each leg pushes with, N, when `load` acts on the top, expressed in the top's frame. In the plane the part of
    /// the load out of the plane is borne by guides.
    pub(super) fn loads(&self, legs: &[Setting<T>; MAX_LEGS], pose: &Pose<T>, load: &Wrench<T>) -> [T; MAX_LEGS] {
        let in_base = Wrench { moment: pose.rotation * -load.moment, force: pose.rotation * -load.force };
        let (forces, _) = solve(&transposed(&Self::rows(legs, pose).0), &Self::governed(&in_base));
        core::array::from_fn(|k| forces.get(k).copied().unwrap_or(T::zero()))
    }

    /// The rows of D, and by how much each leg is short of its length, m.
    fn rows(legs: &[Setting<T>; MAX_LEGS], pose: &Pose<T>) -> ([[T; LEGS]; LEGS], [T; LEGS]) {
        let mut rows = [[T::zero(); LEGS]; LEGS];
        let mut missing = [T::zero(); LEGS];
        for ((row, missing), leg) in rows.iter_mut().zip(&mut missing).zip(legs) {
            let Line { arm, direction, length } = line(leg, pose);
            *row = Self::governed(&Wrench::of_force(direction, &arm));
            *missing = leg.value - length;
        }
        (rows, missing)
    }

    /// The components of a wrench that the legs bear.
    fn governed(wrench: &Wrench<T>) -> [T; LEGS] {
        let (m, f) = (&wrench.moment, &wrench.force);
        let six = [m.x, m.y, m.z, f.x, f.y, f.z];
        core::array::from_fn(|k| six[k + Self::FIRST])
    }

    fn to_twist(motions: &[T; LEGS]) -> Twist<T> {
        let mut six = [T::zero(); 6];
        for (component, motion) in six.iter_mut().skip(Self::FIRST).zip(motions) {
            *component = *motion;
        }
        let [x, y, z, vx, vy, vz] = six;
        Twist { angular: Vec3::new(x, y, z), linear: Vec3::new(vx, vy, vz) }
    }
}

impl<const LEGS: usize> Platform<f64, LEGS> {
    /// The same platform in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Platform<U, LEGS> {
        Platform { legs: self.legs.map(|leg| leg.cast()), home: self.home.cast() }
    }
}

impl Leg<f64> {
    /// The same leg in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Leg<U> {
        Leg {
            base: self.base.map(real),
            top: self.top.map(real),
            length_m: self.length_m.map(real),
            states: self.states,
        }
    }
}

/// A pose after a motion along the axes of the base plate.
fn moved<T: Real>(pose: &Pose<T>, motion: &Twist<T>) -> Pose<T> {
    Pose { rotation: rotation_exp(&motion.angular) * pose.rotation, position: pose.position + motion.linear }
}

/// A leg in some posture, expressed in the axes of the base plate.
struct Line<T: Real> {
    /// From the origin of the top to the top anchor, m.
    arm: Vec3<T>,
    /// From the base anchor to the top anchor, a unit vector.
    direction: Vec3<T>,
    /// Their distance, m.
    length: T,
}

#[inline]
fn line<T: Real>(leg: &Setting<T>, pose: &Pose<T>) -> Line<T> {
    let arm = pose.rotation * leg.top;
    let across = arm + pose.position - leg.base;
    let length = trig::sqrt(across.norm_squared());
    Line { arm, direction: across * (T::one() / length), length }
}

fn coordinate<T: Real>(vector: &Vec3<T>, axis: u8) -> T {
    vector.get(usize::from(axis)).copied().unwrap_or(T::zero())
}

/// ε^¾: the share of the longest leg that may be missed before the last step, which squares it.
///
/// A derivative carried along by a dual number only shrinks to this share in that step, hence not √ε.
fn tolerance<T: Real>() -> T {
    let root = real::sqrt(T::default_epsilon());
    root * real::sqrt(root)
}

/// A long step shortened, so that the iteration cannot jump into another assembly mode.
fn limited<T: Real>(step: Twist<T>, length: T) -> Twist<T> {
    let square = step.angular.norm_squared().max(step.linear.norm_squared() / (length * length));
    if square > real(MAX_STEP * MAX_STEP) { step * (real::<T>(MAX_STEP) / trig::sqrt(square)) } else { step }
}

/// The product of the largest entries by columns: what a determinant is divided by, so that it has no unit.
fn column_scale<T: Real, const LEGS: usize>(rows: &[[T; LEGS]; LEGS]) -> T {
    let largest = |column: usize| rows.iter().fold(T::default_epsilon(), |max, row| max.max(row[column].abs()));
    (0..LEGS).fold(T::one(), |product, column| product * largest(column))
}

fn checked<T: Real>(determinant: T) -> Result<(), PlatformError> {
    if determinant.abs() > real(MIN_DETERMINANT) {
        return Ok(());
    }
    Err(PlatformError::NearSingular { determinant: to_f32(determinant), min: MIN_DETERMINANT as f32 })
}

fn in_mode<T: Real>(determinant: T, home: T) -> Result<(), PlatformError> {
    if determinant * home > T::zero() {
        return Ok(());
    }
    Err(PlatformError::OtherMode { determinant: to_f32(determinant), home: to_f32(home) })
}

impl fmt::Display for PlatformError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAssembled { miss_m } => {
                write!(f, "the legs cannot be assembled: one is missed by {:.3} mm", miss_m * 1e3)
            }
            Self::NearSingular { determinant, min } => {
                write!(
                    f,
                    "the platform is near a singular posture: determinant {determinant:.1e} of at least {min:.0e}"
                )
            }
            Self::OtherMode { determinant, home } => {
                write!(f, "the platform left its assembly mode: determinant {determinant:.3}, at home {home:.3}")
            }
        }
    }
}

impl core::error::Error for PlatformError {}
