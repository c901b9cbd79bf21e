//! The true arm is drawn as promised.

use std::path::Path;

use super::*;
use darm_arm::arm::frames::Weights;

fn arm() -> Arm {
    Arm::parse(Path::new("planar4.toml"), include_str!("../../../../examples/planar4.toml")).unwrap()
}

/// The arm's own frames for words that switch whole modules.
fn frames(arm: &Arm) -> Vec<DesiredFrame> {
    let words = ["000000000000", "111000000000", "000111000000", "000000111000", "000000000111"];
    let frame = |text: &&str| {
        let word: Word = text.parse().unwrap();
        let pose = arm.model.chain.pose_base_tool(&word, &[], &mut ArmScratch::default()).unwrap();
        DesiredFrame {
            name: String::new(),
            word,
            previous: arm.rest(),
            servos_rad: vec![],
            pose_base_tool: pose,
            weights: Weights::default(),
        }
    };
    words.iter().map(frame).collect()
}

#[test]
fn every_effect_is_10_to_40_times_the_scatter() {
    let arm = arm();
    for kind in Kind::EFFECTS {
        for seed in 0..5 {
            let truth = Truth::draw(&arm, &frames(&arm), seed, Some(kind)).unwrap();
            let times = truth.unseal().times_scatter;
            assert!((10.0..40.0).contains(&times), "{kind} {seed}: {times}");
        }
    }
}

#[test]
fn without_an_effect_it_is_the_nominal_arm() {
    let arm = arm();
    let truth = Truth::draw(&arm, &frames(&arm), 3, Some(Kind::Nothing)).unwrap();
    for frame in frames(&arm) {
        let state = TrueState::of_word(frame.word, &[], 12.0);
        assert_eq!(truth.pose(&state), Ok(frame.pose_base_tool));
    }
}

#[test]
fn the_same_seed_draws_the_same_arm() {
    let arm = arm();
    let draw = |seed| Truth::draw(&arm, &frames(&arm), seed, None).unwrap().unseal().clone();
    assert_eq!(draw(5), draw(5));
    assert_ne!(draw(5), draw(6));
}

#[test]
fn springs_take_up_what_the_weights_give() {
    // At rest no small change of a leg's length changes spring and weight energy together: l₀ − l = c·∂V/∂l.
    let arm = arm();
    let (body, compliance, mut scratch) = (Body::of(&arm), 2e-6, ArmScratch::default());
    body.chain.configure(&"010110011101".parse().unwrap(), &[], &mut scratch).unwrap();
    let unloaded = scratch.clone();
    let springs = Mechanism::Springs { part: mechanism::Part::Arm, compliance_m_per_n: compliance };
    let state = TrueState::of_word("010110011101".parse().unwrap(), &[], 0.0);
    let surroundings = Surroundings::draw(&mut ChaCha8Rng::seed_from_u64(1), 6.0, 293.15);
    true_pose::pose(&[springs], &body, &state, surroundings.settled(&state.word), &mut scratch).unwrap();
    let energy = |scratch: &ArmScratch| {
        let stages = 0..body.chain.stages.len();
        let squares = stages.flat_map(|s| (0..3).map(move |leg| (s, leg))).map(|(s, leg)| {
            (scratch.settings[s][leg].value - unloaded.settings[s][leg].value).powi(2) / (2.0 * compliance)
        });
        squares.sum::<f64>() + body.potential_j(0.0, scratch)
    };
    let least = energy(&scratch);
    for (stage, leg) in [(0, 0), (0, 1), (1, 2), (3, 1)] {
        for step in [1e-3, -1e-3] {
            let mut moved = scratch.clone();
            moved.settings[stage][leg].value += step;
            body.chain.assemble(&mut moved).unwrap();
            assert!(energy(&moved) > least, "{stage} {leg} {step}");
        }
    }
}

#[test]
fn new_settings_keep_the_effect() {
    let arm = arm();
    let truth = Truth::draw(&arm, &frames(&arm), 9, Some(Kind::ThermalGrowth)).unwrap();
    let mut turned = arm.clone();
    let stop = darm_core::chain::Parameter::Stop { actuator: 1, state: 0 };
    turned.model.chain.set(stop, 1.42).unwrap();
    let moved = truth.with_geometry(&turned);
    assert_eq!(moved.unseal(), truth.unseal());
    let state = TrueState::of_word(arm.rest(), &[], 5.0);
    let apart = |truth: &Truth, arm: &Arm| {
        let nominal = arm.model.chain.pose_base_tool(&arm.rest(), &[], &mut ArmScratch::default()).unwrap();
        truth.pose(&state).unwrap().distance(&nominal, 0.5)
    };
    assert!(apart(&moved, &turned) > 1e-4 && (apart(&moved, &turned) - apart(&truth, &arm)).abs() < 1e-3);
}
