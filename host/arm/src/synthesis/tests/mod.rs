//! Laws of the synthesis: arms, frames and draws that its tests share.

mod assembly;
mod bounds;
mod closest;
mod exactness;
mod faults;
mod manufacture;
mod paper;
mod words;

use std::path::Path;

use super::*;
use crate::arm::ArmScratch;
use darm_core::chain::Parameter;
use darm_core::effect::{Effect, Place};
use darm_core::se::Pose2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const WORDS: [&str; 5] = ["111000000000", "000111000000", "000000111000", "000000000111", "000000000000"];

fn example(name: &str) -> Arm {
    Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)).unwrap()
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

/// Frames that are given in `examples/`, and their bounds.
fn task(name: &str, arm: &Arm) -> (Vec<DesiredFrame>, Options) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name);
    let task = frames::read_task(&path, arm).unwrap();
    (task.frames, Options { ranges: task.ranges, ..Options::default() })
}
