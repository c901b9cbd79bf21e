//! Every derivative written by hand is that of the forward kinematics: checked by dual numbers.

extern crate std;

use core::array::from_fn;
use std::vec::Vec as List;

use num_dual::Dual64;
use proptest::prelude::*;

use super::*;
use crate::actuator::Stage;
use crate::arms::{mixed_arm, planar_arm, seeded, word};
use crate::real::Vec3;
use crate::se::{Pose2, Twist};

/// Every parameter of a chain, and a few that it does not have.
fn parameters<const N: usize>(chain: &Chain<f64, N>) -> List<Parameter> {
    let actuators = 0..=chain.n_actuators() as u8;
    let of_actuator = actuators.flat_map(|actuator| {
        let stops = (0..4).map(move |state| Parameter::Stop { actuator, state });
        let anchors = (0..4)
            .flat_map(move |axis| [Parameter::BaseAnchor { actuator, axis }, Parameter::TopAnchor { actuator, axis }]);
        stops.chain(anchors)
    });
    let of_pose = (0..7).flat_map(|component| {
        let link = |stage| Parameter::Link { stage, component };
        [Parameter::Mount { component }, Parameter::Tool { component }, link(0), link(1), link(99)]
    });
    of_actuator.chain(of_pose).chain((0..3).map(|servo| Parameter::ServoOffset { servo })).collect()
}

/// (T⁻¹·∂T/∂a)ᵛ by carrying the derivative through the whole of the forward kinematics.
fn dual_derivative<const N: usize>(
    chain: &Chain<f64, N>,
    parameter: Parameter,
    word: &Word,
    servos: &[f64],
) -> Option<Twist<f64>> {
    let mut dual = chain.cast::<Dual64>();
    let value = dual.get(parameter)?;
    dual.set(parameter, value + Dual64::new(0.0, 1.0)).unwrap();
    let servos: List<_> = servos.iter().map(|s| Dual64::from(*s)).collect();
    let end = dual.pose_base_tool(word, &servos, &mut Scratch::default()).unwrap();
    let real = Pose { rotation: end.rotation.map(|x| x.re), position: end.position.map(|x| x.re) };
    let turn = real.rotation.tr_mul(&end.rotation.map(|x| x.eps));
    let linear = real.rotation.tr_mul(&end.position.map(|x| x.eps));
    Some(Twist { angular: Vec3::new(turn.m32, turn.m13, turn.m21), linear })
}

fn check_derivatives<const N: usize>(chain: &Chain<f64, N>, word: &Word, servos: &[f64]) {
    let mut scratch = Scratch::default();
    chain.pose_base_tool(word, servos, &mut scratch).unwrap();
    for parameter in parameters(chain) {
        let by_hand = chain.derivative(parameter, &scratch);
        let expected = dual_derivative(chain, parameter, word, servos).unwrap_or(Twist::zero());
        let error = (by_hand - expected).size(1.0);
        assert!(error < 1e-10, "{parameter:?}: {error:e} of {}", expected.size(1.0));
    }
}

proptest! {
    #![proptest_config(seeded(32))]

    #[test]
    fn derivatives_of_the_planar_arm(word in word(planar_arm())) {
        check_derivatives(&planar_arm(), &word, &[]);
    }

    #[test]
    fn derivatives_of_the_mixed_arm(word in word(mixed_arm()), servo in -1.5..1.5) {
        check_derivatives(&mixed_arm(), &word, &[servo]);
    }

    #[test]
    fn the_jacobian_is_that_of_the_servo_offset(word in word(mixed_arm()), servo in -1.5..1.5) {
        let (arm, mut scratch) = (mixed_arm(), Scratch::default());
        arm.pose_base_tool(&word, &[servo], &mut scratch).unwrap();
        let columns: List<_> = arm.servo_jacobian(&scratch).collect();
        prop_assert_eq!(columns, [arm.derivative(Parameter::ServoOffset { servo: 0 }, &scratch)]);
    }

    #[test]
    fn legs_have_their_lengths(word in word(planar_arm())) {
        let (arm, mut scratch) = (planar_arm(), Scratch::default());
        arm.pose_base_tool(&word, &[], &mut scratch).unwrap();
        for (stage, leg) in arm.actuators() {
            let leg = scratch.settings[stage][leg];
            let length = (scratch.stages[stage] * leg.top - leg.base).norm();
            prop_assert!((length - leg.value).abs() < 4e-15);
        }
    }
}

#[test]
fn parameters_are_read_back() {
    let mut arm = mixed_arm();
    for (k, parameter) in parameters(&mixed_arm()).into_iter().enumerate() {
        let value = 0.1 + 1e-3 * k as f64;
        match arm.set(parameter, value) {
            Ok(()) => assert!((arm.get(parameter).unwrap() - value).abs() < 1e-15, "{parameter:?}"),
            Err(NoSuchParameter(refused)) => {
                assert_eq!((refused, arm.get(parameter)), (parameter, None));
            }
        }
    }
}

#[test]
fn the_contracted_arm_stands_four_metres_tall() {
    let end = planar_arm().pose_base_tool(&Word::zeros(12).unwrap(), &[], &mut Scratch::default()).unwrap();
    assert!(end.distance(&Pose2::new(0.0, 4.0, 0.0).into(), 1.0) < 1e-14);
    assert!(planar_arm().is_planar() && !mixed_arm().is_planar());
}

#[test]
fn actuators_are_counted_along_the_chain() {
    let arm = mixed_arm();
    assert_eq!((arm.n_actuators(), arm.n_servos()), (11, 1));
    assert_eq!(
        [0, 2, 3, 4, 9, 10, 11].map(|k| arm.actuator(k)),
        [Some((2, 0)), Some((2, 2)), Some((3, 0)), Some((4, 0)), Some((4, 5)), Some((5, 0)), None]
    );
    assert_eq!([0, 3, 10, 11].map(|k| arm.n_states(k)), [2, 4, 3, 0]);
}

#[test]
fn a_word_that_does_not_fit_is_refused() {
    let mut scratch = Scratch::default();
    let mut pose = |word: &[u8], servos: &[f64]| {
        mixed_arm().pose_base_tool(&Word::new(word).unwrap(), servos, &mut scratch).unwrap_err()
    };
    assert_eq!(pose(&[0; 12], &[0.0]), ChainError::WordLength { actuators: 11, digits: 12 });
    assert_eq!(pose(&[0; 11], &[]), ChainError::ServoCount { servos: 1, positions: 0 });
    let digits: [u8; 11] = from_fn(|k| if k == 1 { 2 } else { 0 });
    assert_eq!(pose(&digits, &[0.0]), ChainError::NoSuchState { actuator: 1, digit: 2, states: 2 });
}

#[test]
fn the_stage_that_fails_is_named() {
    let mut arm = planar_arm();
    if let Stage::Planar(module) = &mut arm.stages[2] {
        module.legs[0].length_m[0] = 5.0;
    }
    let error = arm.pose_base_tool(&Word::zeros(12).unwrap(), &[], &mut Scratch::default()).unwrap_err();
    assert!(matches!(error, ChainError::Platform { stage: 2, .. }), "{error}");
}
