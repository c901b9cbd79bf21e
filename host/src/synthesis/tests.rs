//! Laws of the synthesis.

use std::path::Path;

use super::*;
use crate::arm::ArmScratch;
use darm_core::se::Pose2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const WORDS: [&str; 5] = ["111000000000", "000111000000", "000000111000", "000000000111", "000000000000"];

fn planar4() -> Arm {
    Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/planar4.toml")).unwrap()
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
    let mut time = Duration::ZERO;
    for seed in 0..200 {
        let desired = moved(own_frames(&arm, &WORDS), 0.1, seed);
        let found = synthesize(&arm, &desired, &Options::default()).unwrap();
        assert_eq!(found.status, Status::Reached, "seed {seed}");
        assert_eq!(found.case.kind, CaseKind::Sufficient, "seed {seed}");
        worst = found.frames.iter().fold(worst, |worst, frame| worst.max(frame.error_m).max(frame.error_rad));
        time += found.time;
    }
    println!("worst {worst:.1e}, mean time {:?}", time / 200);
    assert!(worst < 1e-13, "{worst}");
}

#[test]
fn prints() {
    for name in ["planar4", "planar4-hybrid"] {
        let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
        let arm = Arm::read(&dir.join(format!("{name}.toml"))).unwrap();
        let frames = frames::read(&dir.join("planar4-frames.toml"), &arm).unwrap();
        for with in [false, true] {
            let mut arm = arm.clone();
            if with {
                let effects: [darm_core::effect::Effect<f64>; 3] = [
                    darm_core::effect::stroke_loss::StrokeLoss { actuator: 4, state: 1, loss_m: 5e-3 }.into(),
                    darm_core::effect::gravity_sag::GravitySag {
                        at: darm_core::effect::Place::Arm,
                        compliance_m_per_n: 2e-5,
                    }
                    .into(),
                    darm_core::effect::play::Play { at: darm_core::effect::Place::Arm, width_m: 2e-3 }.into(),
                ];
                arm.model.effects.extend(effects);
            }
            for n in [5, 3] {
                let found = synthesize(&arm, &frames[..n], &Options::default()).unwrap();
                println!(
                    "{name} {with} {n} {} {:?} {:?} it {} starts {} alter {}",
                    found.case, found.status, found.time, found.iterations, found.starts, found.alteration_m
                );
                println!(
                    "  {:?}",
                    found
                        .frames
                        .iter()
                        .map(|f| (f.error_m, f.error_rad, f.frame.servos_rad.clone()))
                        .collect::<Vec<_>>()
                );
            }
        }
    }
    let arm = planar4();
    let mut words = WORDS.to_vec();
    words.push("111111000000");
    let desired = moved(own_frames(&arm, &words), 0.05, 3);
    let found = synthesize(&arm, &desired, &Options::default()).unwrap();
    println!("{} {:?} {:?} it {} starts {}", found.case, found.status, found.time, found.iterations, found.starts);
    println!("  {:?}", found.frames.iter().map(|f| (f.error_m, f.error_rad)).collect::<Vec<_>>());
    for s in [0.3, 0.5, 0.8] {
        for bounds in [
            Bounds { shortest: 0.5, longest: 2.0, stroke: 0.0 },
            Bounds { shortest: 0.01, longest: 100.0, stroke: -100.0 },
        ] {
            let mut n = (0, 0, Duration::ZERO);
            for seed in 0..40 {
                let desired = moved(own_frames(&arm, &WORDS), s, seed);
                let found = synthesize(&arm, &desired, &Options { bounds, ..Options::default() }).unwrap();
                n.0 += i32::from(found.status == Status::Reached);
                n.1 += found.starts;
                n.2 += found.time;
            }
            println!("s {s} {bounds:?}: {} of 40, starts {} time {:?}", n.0, n.1, n.2 / 40);
        }
    }
}
