//! Laws of the synthesis.

use std::path::Path;

use super::*;
use crate::arm::ArmScratch;
use darm_core::chain::Parameter;
use darm_core::effect::gravity_sag::GravitySag;
use darm_core::effect::play::Play;
use darm_core::effect::stroke_loss::StrokeLoss;
use darm_core::effect::{Effect, Place};
use darm_core::se::Pose2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const WORDS: [&str; 5] = ["111000000000", "000111000000", "000000111000", "000000000111", "000000000000"];

fn example(name: &str) -> Arm {
    Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples").join(name)).unwrap()
}

fn planar4() -> Arm {
    example("planar4.toml")
}

fn stops(arm: &Arm) -> impl Iterator<Item = Parameter> {
    let states = |actuator| 0..arm.model.chain.n_states(usize::from(actuator)) as u8;
    (0..arm.n_actuators() as u8)
        .flat_map(move |actuator| states(actuator).map(move |state| Parameter::Stop { actuator, state }))
}

/// The arm's own frames for these words.
fn own_frames(arm: &Arm, words: &[&str]) -> Vec<DesiredFrame> {
    let mut scratch = ArmScratch::default();
    let servos_rad = vec![0.0; arm.n_servos()];
    let mut frame = |text: &&str| {
        let word = text.parse().unwrap();
        let pose_base_tool = arm.model.chain.pose_base_tool(&word, &servos_rad, &mut scratch).unwrap();
        DesiredFrame {
            name: text.to_string(),
            word,
            previous: arm.rest(),
            servos_rad: servos_rad.clone(),
            pose_base_tool,
            weights: Default::default(),
        }
    };
    words.iter().map(&mut frame).collect()
}

/// Every frame moved in its own coordinates by v within ±s m and ±s/2 rad.
fn moved(mut frames: Vec<DesiredFrame>, s: f64, seed: u64) -> Vec<DesiredFrame> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for frame in &mut frames {
        let mut within = |most: f64| rng.random_range(-most..most);
        let by = Pose2::exp(&nalgebra::Vector3::new(within(s / 2.0), within(s), within(s)));
        frame.pose_base_tool = frame.pose_base_tool * Pose::from(by);
    }
    frames
}

#[test]
fn frames_of_the_arm_itself_change_nothing() {
    let arm = planar4();
    let found = synthesize(&arm, &own_frames(&arm, &WORDS), &Options::default()).unwrap();
    assert_eq!(found.status, Status::Reached);
    assert!(found.alteration_m < 1e-12, "{}", found.alteration_m);
}

#[test]
fn two_hundred_draws_are_all_exact() {
    let arm = planar4();
    let mut worst: f64 = 0.0;
    for seed in 0..200 {
        let desired = moved(own_frames(&arm, &WORDS), 0.1, seed);
        let found = synthesize(&arm, &desired, &Options::default()).unwrap();
        assert_eq!(found.status, Status::Reached, "seed {seed}");
        assert_eq!(found.case.kind, CaseKind::Sufficient, "seed {seed}");
        worst = found.frames.iter().fold(worst, |worst, frame| worst.max(frame.error_m).max(frame.error_rad));
    }
    assert!(worst < 1e-13, "{worst}");
}

#[test]
fn moving_base_and_frames_together_changes_nothing() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.1, 7);
    let by = Pose::from(Pose2::new(0.7, -0.3, 1.1));
    let mut elsewhere = arm.clone();
    elsewhere.model.chain.mount = by * arm.model.chain.mount;
    let carried: Vec<_> = desired
        .iter()
        .map(|frame| DesiredFrame { pose_base_tool: by * frame.pose_base_tool, ..frame.clone() })
        .collect();
    let here = synthesize(&arm, &desired, &Options::default()).unwrap();
    let there = synthesize(&elsewhere, &carried, &Options::default()).unwrap();
    for stop in stops(&arm) {
        let (here, there) = (here.arm.model.chain.get(stop).unwrap(), there.arm.model.chain.get(stop).unwrap());
        assert!((here - there).abs() < 1e-12, "{stop:?}: {here} {there}");
    }
}

#[test]
fn legs_stay_physical() {
    let arm = planar4();
    for seed in 0..20 {
        let found = synthesize(&arm, &moved(own_frames(&arm, &WORDS), 0.3, seed), &Options::default()).unwrap();
        let length = |actuator, state| found.arm.model.chain.get(Parameter::Stop { actuator, state }).unwrap();
        for actuator in 0..12 {
            let (short, long) = (length(actuator, 0), length(actuator, 1));
            assert!(short >= 0.5 - 1e-9 && long >= short - 1e-9, "seed {seed}: {short} {long}");
        }
    }
}

#[test]
fn fewer_frames_alter_less_and_more_are_met_as_well_as_can_be() {
    let arm = planar4();
    let mut words = WORDS.to_vec();
    words.push("111111000000");
    let desired = moved(own_frames(&arm, &words), 0.05, 3);
    let [few, all, many] = [3, 5, 6].map(|count| synthesize(&arm, &desired[..count], &Options::default()).unwrap());
    assert_eq!(few.case.rank, 9);
    assert_eq!((all.case.kind, all.case.rank, all.case.most), (CaseKind::Sufficient, 15, 15));
    assert_eq!((many.case.kind, many.case.equations), (CaseKind::Insufficient, 18));
    assert_eq!([few.status, all.status, many.status], [Status::Reached, Status::Reached, Status::Closest]);
    assert!(few.alteration_m < all.alteration_m);
    let misses: f64 = many.frames.iter().map(|frame| frame.error_m.powi(2)).sum();
    let before: f64 = many.frames.iter().map(|frame| frame.error_before_m.powi(2)).sum();
    assert!(misses < 0.25 * before, "{misses} {before}");
}

#[test]
fn effects_and_servos_are_taken_into_account() {
    let mut arm = example("planar4-hybrid.toml");
    let effects: [Effect<f64>; 3] = [
        StrokeLoss { actuator: 4, state: 1, loss_m: 5e-3 }.into(),
        GravitySag { at: Place::Arm, compliance_m_per_n: 2e-5 }.into(),
        Play { at: Place::Arm, width_m: 2e-3 }.into(),
    ];
    arm.model.effects.extend(effects);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    let desired = frames::read(&folder.join("planar4-frames.toml"), &arm).unwrap();
    let found = synthesize(&arm, &desired, &Options::default()).unwrap();
    assert_eq!(found.status, Status::Reached);
    for reached in &found.frames {
        let frame = &reached.frame;
        let condition = found.arm.model.working(frame.word, frame.previous, &frame.servos_rad);
        let pose = found.arm.model.predict(&condition, &mut ArmScratch::default()).unwrap();
        assert!(pose.distance(&reached.frame.pose_base_tool, 1.0) < 1e-13);
        assert!(reached.frame.servos_rad[0].abs() <= 60f64.to_radians() && reached.frame.servos_rad[0] != 0.0);
    }
}

#[test]
fn the_papers_error_falls_with_the_square_of_its_steps() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.1, 1);
    let worst = |steps| {
        let options = Options { method: Method::Paper { steps, regularisation: 1e-3 }, ..Options::default() };
        let found = synthesize(&arm, &desired, &options).unwrap();
        found.frames.iter().fold(0.0, |worst: f64, frame| worst.max(frame.error_m))
    };
    let (coarse, fine) = (worst(20), worst(80));
    assert!(fine < coarse / 10.0 && coarse < 1e-3, "{coarse} {fine}");
}

#[test]
fn what_cannot_be_started_from_is_told_by_module_and_word() {
    let mut arm = planar4();
    let mut desired = own_frames(&arm, &WORDS);
    arm.model.chain.set(Parameter::Stop { actuator: 4, state: 1 }, 0.1).unwrap();
    let error = synthesize(&arm, &desired, &Options::default()).unwrap_err().to_string();
    assert!(error.starts_with("000111000000: module 2 has no pose for the word 000111000000: the "), "{error}");
    desired[1].word = desired[0].word;
    let error = synthesize(&arm, &desired, &Options::default()).unwrap_err().to_string();
    assert_eq!(
        error,
        "000111000000: the word 111000000000 serves 111000000000 already; one word reaches one frame, give another word"
    );
}
