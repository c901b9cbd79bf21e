//! Directions and small motions that are drawn.

use darm_core::real::Vec3;
use darm_core::se::Twist;
use rand::{Rng, RngExt};

/// A direction drawn, of length one.
pub(super) fn aside(planar: bool, rng: &mut impl Rng) -> Vec3<f64> {
    loop {
        let mut v = Vec3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        if planar {
            v.z = 0.0;
        }
        let length: f64 = v.norm();
        if (0.1..1.0).contains(&length) {
            return v / length;
        }
    }
}

/// A shift and a turn of an arm's length, drawn: a unit is 1 m and 1 rad.
pub(crate) fn tilt(planar: bool, rng: &mut impl Rng) -> Twist<f64> {
    let linear = aside(planar, rng);
    let turn = rng.random_range(-1.0..1.0);
    let angular = if planar { Vec3::new(0.0, 0.0, turn) } else { aside(false, rng) * turn };
    Twist { angular, linear }
}
