//! Arms that tests use, and the seed of their cases.

extern crate std;

use core::array::from_fn;

use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed};

use crate::actuator::{Axis, DiscreteJoint, JointKind, Leg, Platform, ServoJoint, Stage};
use crate::chain::Chain;
use crate::real::Vec3;
use crate::se::{Pose, Pose2};
use crate::units::Word;

/// The number of cases, the same ones in every run.
pub(crate) fn seeded(cases: u32) -> Config {
    Config { cases, rng_seed: RngSeed::Fixed(0xda23), failure_persistence: None, ..Config::default() }
}

/// Any word of an arm.
pub(crate) fn word<const N: usize>(chain: Chain<f64, N>) -> impl Strategy<Value = Word> {
    prop::collection::vec(0u8..4, chain.n_actuators()).prop_map(move |digits| {
        let states = (0..digits.len()).map(|k| chain.n_states(k) as u8);
        let digits: std::vec::Vec<_> = digits.iter().zip(states).map(|(digit, states)| digit % states).collect();
        Word::new(&digits).unwrap()
    })
}

/// One module of the planar initial arm: legs left, diagonal, right between 1 m plates, 25 % stroke.
pub(crate) fn planar_module() -> Platform<f64, 3> {
    let (left, right) = (Vec3::new(-0.5, 0.0, 0.0), Vec3::new(0.5, 0.0, 0.0));
    let leg = |base, top, length: f64| Leg { base, top, length_m: [length, 1.25 * length, 0.0, 0.0], states: 2 };
    Platform {
        legs: [leg(left, left, 1.0), leg(left, right, 2f64.sqrt()), leg(right, right, 1.0)],
        home: Pose2::new(0.0, 1.0, 0.0).into(),
    }
}

/// A six-legged platform: three pairs of anchors on circles of 0.5 m and 0.35 m, turned by 60°, 0.6 m apart.
pub(crate) fn spatial_module() -> Platform<f64, 6> {
    let on_circle = |radius: f64, degrees: f64| {
        let angle = degrees.to_radians();
        Vec3::new(radius * angle.cos(), radius * angle.sin(), 0.0)
    };
    let home = Pose::at(Vec3::new(0.0, 0.0, 0.6));
    let base: [_; 6] = from_fn(|k| on_circle(0.5, 120.0 * (k / 2) as f64 + if k % 2 == 0 { -15.0 } else { 15.0 }));
    let top: [_; 6] = from_fn(|k| on_circle(0.35, 120.0 * (k / 2) as f64 + if k % 2 == 0 { -45.0 } else { 45.0 }));
    let legs = from_fn(|k| {
        let length = (home * top[k] - base[k]).norm();
        Leg { base: base[k], top: top[k], length_m: [length, 1.25 * length, 0.0, 0.0], states: 2 }
    });
    Platform { legs, home }
}

fn chain<const N: usize>(stages: [Stage<f64>; N]) -> Chain<f64, N> {
    Chain { mount: Pose::identity(), stages: stages.into_iter().collect(), tool: Pose::identity() }
}

/// The planar initial arm of four modules: twelve binary legs.
pub(crate) fn planar_arm() -> Chain<f64, 4> {
    chain([Stage::Planar(planar_module()); 4])
}

/// One of each: a servo, a link, a planar and a spatial platform, a turning and a sliding discrete joint.
pub(crate) fn mixed_arm() -> Chain<f64, 6> {
    let slide = DiscreteJoint {
        axis: Axis { kind: JointKind::Prismatic, direction: Vec3::new(0.6, 0.0, 0.8) },
        values: [0.0, 0.1, 0.25, 0.0],
        states: 3,
    };
    let turn = DiscreteJoint {
        axis: Axis { kind: JointKind::Revolute, direction: Vec3::new(0.0, 0.8, 0.6) },
        values: [-0.5, 0.0, 0.4, 0.9],
        states: 4,
    };
    let servo =
        ServoJoint { axis: Axis { kind: JointKind::Revolute, direction: Vec3::new(0.0, 0.0, 1.0) }, offset: 0.1 };
    Chain {
        mount: Pose::new(&Vec3::new(0.1, -0.2, 0.3), Vec3::new(0.0, 0.1, 0.2)),
        tool: Pose::new(&Vec3::new(0.0, 0.4, 0.1), Vec3::new(0.05, 0.0, 0.1)),
        ..chain([
            Stage::Servo(servo),
            Stage::Link(Pose::new(&Vec3::new(0.3, 0.0, -0.2), Vec3::new(0.2, 0.1, 0.0))),
            Stage::Planar(planar_module()),
            Stage::Discrete(turn),
            Stage::Spatial(spatial_module()),
            Stage::Discrete(slide),
        ])
    }
}
