//! Desired frames of syntheses: those of an arm itself, moved at random.

use anyhow::{Context, Result};
use darm_arm::arm::frames::DesiredFrame;
use darm_arm::arm::{Arm, ArmScratch};
use darm_core::se::{Pose, Twist};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use xtask::setup;

/// Words that switch complete modules of planar4.
pub(crate) const PLANAR_WORDS: [&str; 5] =
    ["000000000000", "111000000000", "000111000000", "000000111000", "000000000111"];

/// An arm and its own frames for some words.
pub(crate) struct Own {
    pub(crate) arm: Arm,
    pub(crate) frames: Vec<DesiredFrame>,
}

impl Own {
    /// The frames of an arm without servos for these words.
    pub(crate) fn new(arm: Arm, words: &[&str]) -> Result<Self> {
        let mut scratch = ArmScratch::default();
        let mut frames = Vec::new();
        for text in words {
            let word = text.parse().with_context(|| format!("{text} is no word"))?;
            let pose_base_tool = arm.model.chain.pose_base_tool(&word, &[], &mut scratch)?;
            frames.push(DesiredFrame {
                name: (*text).to_owned(),
                word,
                previous: arm.rest(),
                servos_rad: Vec::new(),
                pose_base_tool,
                weights: Default::default(),
            });
        }
        Ok(Self { arm, frames })
    }
}

/// An arm of the examples with its own frames for some words.
pub(crate) fn own_frames(file: &str, words: &[&str]) -> Result<Own> {
    Own::new(Arm::read(&setup::root().join("examples").join(file))?, words)
}

/// Each frame moved in its own coordinates by exp(v): in the plane v_xy uniform in ±s m and v_θ in ±s/2 rad, in space every
/// component of v_p in ±s m and of v_ω in ±s/3 rad.
pub(crate) fn moved(frames: &[DesiredFrame], size: f64, planar: bool, seed: u64) -> Vec<DesiredFrame> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let moved = |frame: &DesiredFrame| {
        let pose_base_tool = frame.pose_base_tool * Pose::exp(&motion(size, planar, &mut rng));
        DesiredFrame { pose_base_tool, ..frame.clone() }
    };
    frames.iter().map(moved).collect()
}

/// A random motion in the plane or in space, m and rad, with parts up to `size`.
fn motion(size: f64, planar: bool, rng: &mut ChaCha8Rng) -> Twist<f64> {
    let mut within = |limit: f64| rng.random_range(-limit..limit);
    if planar {
        let linear = Vector3::new(within(size), within(size), 0.0);
        return Twist { angular: Vector3::new(0.0, 0.0, within(size / 2.0)), linear };
    }
    let linear = Vector3::from_fn(|_, _| within(size));
    Twist { angular: Vector3::from_fn(|_, _| within(size / 3.0)), linear }
}
