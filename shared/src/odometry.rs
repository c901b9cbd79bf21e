//! Odometry of a robot with two driven wheels on one axle: from encoder counts to its pose, and how sure that is.
//!
//! # Model
//!
//! ẋ = v·cos θ, ẏ = v·sin θ, θ̇ = ω, with v = (v₁ + v₂)/2, ω = (v₂ − v₁)/(2b), vᵢ = 2π r f Δᵢ / (ticks per rev.)
//!
//! Between two readings v and ω are taken as constant: the path is an arc, and its chord is exact. Each wheel's way has
//! the variance k·|way|, as slip and rounding add up along it, and the two wheels are independent.
//!
//! | symbol  | field               | unit      | meaning                                             |
//! |---------|---------------------|-----------|-----------------------------------------------------|
//! | r       | `radius_m`          | m         | of the wheels                                       |
//! | b       | `half_track_m`      | m         | half the distance between the wheels                |
//! |         | `ticks_per_turn`    | 1         | encoder counts a turn of the wheel                  |
//! | k       | `variance_per_m`    | m²/m      | variance of a wheel's way, per metre of it          |
//!
//! Frame: x ahead, y to the left, θ from x to y. Wheel 1 is the left one, wheel 2 the right one: ω > 0 turns left.
//! Source: the lecture's differential-drive kinematics; error model after R. Siegwart, I. Nourbakhsh, Introduction to
//! Autonomous Mobile Robots, section 5.2.4.
//!
//! # Example
//!
//! ```
//! use darm_core::odometry::{Drive, Estimate};
//! let drive = Drive { radius_m: 0.05, half_track_m: 0.1, ticks_per_turn: 1000.0, variance_per_m: 1e-4 };
//! // Left wheel still, right wheel once round: an arc of 2π·0.05/0.2 = π/2 about the left wheel, which is at (0, 0.1).
//! let there = drive.advance(&Estimate::start(), 0, 1000);
//! assert!((there.pose.angle_rad - core::f64::consts::FRAC_PI_2).abs() < 1e-12);
//! assert!((there.pose.position.x - 0.1).abs() < 1e-12 && (there.pose.position.y - 0.1).abs() < 1e-12);
//! ```

use core::f64::consts::TAU;

use crate::real::{Mat3, Real, Vec2, Vec3, real};
use crate::se::Pose2;
use crate::trig;

/// The drive of a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive<T: Real> {
    /// Radius of the wheels, m.
    pub radius_m: T,
    /// Half the distance between the wheels, m.
    pub half_track_m: T,
    /// Encoder counts a turn of the wheel.
    pub ticks_per_turn: T,
    /// Variance of a wheel's way per metre of it, m.
    pub variance_per_m: T,
}

/// Where the robot is, and the covariance of that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate<T: Real> {
    /// Pose of the robot in the frame where it started.
    pub pose: Pose2<T>,
    /// Covariance of (x, y, θ), expressed in the same frame: m², m·rad, rad².
    pub covariance: Mat3<T>,
}

/// The velocity of the robot in its own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Velocity<T: Real> {
    /// v, ahead, m/s.
    pub linear_m_s: T,
    /// ω, to the left, rad/s.
    pub angular_rad_s: T,
}

impl<T: Real> Estimate<T> {
    /// At the origin, for sure.
    pub fn start() -> Self {
        Self { pose: Pose2 { position: Vec2::zeros(), angle_rad: T::zero() }, covariance: Mat3::zeros() }
    }
}

impl<T: Real> Drive<T> {
    /// v and ω when the left and the right encoder count this many ticks at `rate_hz` readings a second.
    pub fn velocity(&self, left_ticks: i32, right_ticks: i32, rate_hz: T) -> Velocity<T> {
        let (left, right) = (self.way(left_ticks) * rate_hz, self.way(right_ticks) * rate_hz);
        Velocity {
            linear_m_s: (left + right) * real(0.5),
            angular_rad_s: (right - left) / (self.half_track_m * real(2.0)),
        }
    }

    /// v and ω when the left and the right wheel turn at these speeds, rad/s.
    pub fn velocity_of_speeds(&self, left_rad_s: T, right_rad_s: T) -> Velocity<T> {
        let (left, right) = (left_rad_s * self.radius_m, right_rad_s * self.radius_m);
        Velocity {
            linear_m_s: (left + right) * real(0.5),
            angular_rad_s: (right - left) / (self.half_track_m * real(2.0)),
        }
    }

    /// Speeds of the left and the right wheel, rad/s, that give this velocity: the inverse of
    /// [`velocity_of_speeds`](Self::velocity_of_speeds).
    pub fn speeds(&self, velocity: &Velocity<T>) -> [T; 2] {
        let across = velocity.angular_rad_s * self.half_track_m;
        [velocity.linear_m_s - across, velocity.linear_m_s + across].map(|speed| speed / self.radius_m)
    }

    /// Travel of the left and the right wheel, m, along the arc that leads to `place` (x ahead and y to the left, m, in the
    /// robot's frame). The robot turns by twice the bearing of the place, at most half a turn; to a place behind it, it
    /// drives backwards.
    pub fn arc_to(&self, place: &Vec2<T>) -> [T; 2] {
        let sign = if place.x < T::zero() { -T::one() } else { T::one() };
        let half = trig::atan2(sign * place.y, sign * place.x);
        let ahead = sign * place.norm() / sinc(half).0;
        let across = half * real(2.0) * self.half_track_m;
        [ahead - across, ahead + across]
    }

    /// The way of a wheel, m.
    fn way(&self, ticks: i32) -> T {
        real::<T>(TAU * f64::from(ticks)) * self.radius_m / self.ticks_per_turn
    }

    /// The estimate after the encoders have counted on by this many ticks.
    ///
    /// The covariance is carried along the arc to first order: P ← F P Fᵀ + G Q Gᵀ.
    pub fn advance(&self, from: &Estimate<T>, left_ticks: i32, right_ticks: i32) -> Estimate<T> {
        self.advance_by(from, [self.way(left_ticks), self.way(right_ticks)])
    }

    /// As [`advance`](Self::advance), from the travel of the left and the right wheel, m.
    pub fn advance_by(&self, from: &Estimate<T>, [left, right]: [T; 2]) -> Estimate<T> {
        let ahead = (left + right) * real(0.5);
        let turn = (right - left) / (self.half_track_m * real(2.0));
        let half = turn * real(0.5);
        let (sinc, sinc_rate) = sinc(half);
        let middle = from.pose.angle_rad + half;
        let (s, c) = trig::sin_cos(middle);
        let chord = ahead * sinc;
        let (x, y) = (chord * c, chord * s);
        let pose = Pose2 {
            position: Vec2::new(from.pose.position.x + x, from.pose.position.y + y),
            angle_rad: from.pose.angle_rad + turn,
        };
        let (one, zero) = (T::one(), T::zero());
        let carried = Mat3::new(one, zero, -y, zero, one, x, zero, zero, one);
        // Per metre of each wheel: half a metre ahead, and a turn by ±1/(2b).
        let per_turn = |sign: T| {
            let turned = sign / (self.half_track_m * real(2.0));
            let along = sinc * real(0.5) + ahead * sinc_rate * turned * real(0.5);
            let across = chord * turned * real(0.5);
            Vec3::new(along * c - across * s, along * s + across * c, turned)
        };
        let mut covariance = carried * from.covariance * carried.transpose();
        for (gradient, way) in [(per_turn(-one), left), (per_turn(one), right)] {
            covariance += gradient * gradient.transpose() * (way.abs() * self.variance_per_m);
        }
        Estimate { pose, covariance }
    }
}

/// sin x / x and its derivative.
fn sinc<T: Real>(x: T) -> (T, T) {
    let square = x * x;
    if square < real(1e-3) {
        let value = T::one() - square * (real::<T>(1.0 / 6.0) - square * real(1.0 / 120.0));
        let rate = -x * (real::<T>(1.0 / 3.0) - square * (real::<T>(1.0 / 30.0) - square * real(1.0 / 840.0)));
        return (value, rate);
    }
    let (s, c) = trig::sin_cos(x);
    (s / x, (c - s / x) / x)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use nalgebra::ComplexField;
    use num_dual::Dual64;

    use super::*;

    const DRIVE: Drive<f64> =
        Drive { radius_m: 0.033, half_track_m: 0.08, ticks_per_turn: 4096.0, variance_per_m: 2e-4 };

    /// Many small steps along an arc end where one step does.
    #[test]
    fn an_arc_is_exact() {
        let total = DRIVE.advance(&Estimate::start(), 8000, 12_000);
        let parts = (0..4000).fold(Estimate::start(), |at, _| DRIVE.advance(&at, 2, 3));
        assert!((total.pose.position - parts.pose.position).norm() < 1e-10);
        assert!((total.pose.angle_rad - parts.pose.angle_rad).abs() < 1e-10);
    }

    #[test]
    fn ahead_and_back_returns_less_sure() {
        let there = DRIVE.advance(&Estimate::start(), 5000, 5000);
        let back = DRIVE.advance(&there, -5000, -5000);
        assert!(back.pose.position.norm() < 1e-12 && back.pose.angle_rad.abs() < 1e-12);
        assert!(back.covariance.m11 > there.covariance.m11 && back.covariance.m33 > there.covariance.m33);
    }

    /// The covariance of one step is Σ G·k|way|·Gᵀ with G the derivative of the pose by each wheel's way.
    #[test]
    fn covariance_is_that_of_the_derivatives() {
        let (left, right) = (900, 5100);
        let from = Estimate { pose: Pose2::new(0.3, -0.2, 0.7), covariance: Mat3::zeros() };
        let by_hand = DRIVE.advance(&from, left, right).covariance;
        let step = |left: Dual64, right: Dual64| {
            let turn = (right - left) / (2.0 * DRIVE.half_track_m);
            let (s, c) = (Dual64::from(0.7) + turn).sin_cos();
            let radius = (left + right) / 2.0 / turn;
            let (s0, c0) = 0.7f64.sin_cos();
            [(radius * (s - s0)).eps, (radius * (-c + c0)).eps, turn.eps]
        };
        let (l, r) = (DRIVE.way(left), DRIVE.way(right));
        let columns = [(step(Dual64::new(l, 1.0), r.into()), l), (step(l.into(), Dual64::new(r, 1.0)), r)];
        let expected = columns.iter().fold(Mat3::zeros(), |sum, (column, way)| {
            let g = Vec3::from(*column);
            sum + g * g.transpose() * (way * DRIVE.variance_per_m)
        });
        assert!((by_hand - expected).amax() < 1e-12, "{by_hand} {expected}");
    }

    /// Speeds of wheels and velocity are inverse to each other, and an arc ends in the place that it was asked to reach.
    #[test]
    fn speeds_and_arcs_are_inverse() {
        let [left, right] = DRIVE.speeds(&DRIVE.velocity_of_speeds(-1.5, 4.0));
        assert!((left + 1.5).abs() < 1e-12 && (right - 4.0).abs() < 1e-12);
        for place in [[0.7, 0.4], [-0.7, 0.4], [-0.2, -0.3], [0.0, 0.5], [0.3, 0.0], [0.0, 0.0]].map(Vec2::from) {
            let end = DRIVE.advance_by(&Estimate::start(), DRIVE.arc_to(&place)).pose;
            assert!((end.position - place).norm() < 1e-12, "{place} {end:?}");
            assert!(end.angle_rad.abs() <= core::f64::consts::PI + 1e-12);
        }
    }

    #[test]
    fn velocity_is_the_lectures() {
        let v = DRIVE.velocity(100, 300, 50.0);
        let travel_m = |ticks: f64| TAU * 0.033 * 50.0 * ticks / 4096.0;
        assert!((v.linear_m_s - (travel_m(100.0) + travel_m(300.0)) / 2.0).abs() < 1e-12);
        assert!((v.angular_rad_s - (travel_m(300.0) - travel_m(100.0)) / 0.16).abs() < 1e-12);
    }
}
