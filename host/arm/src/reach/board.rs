//! What a board needs to answer by itself which word is nearest: the frames of the arm's modules as records of a table.
//!
//! A module here is a run of neighbouring stages with at most 64 frames together, or one stage of any number:
//! few large modules are searched better than many small ones. What the modules behind one typically do is given beside
//! it, so that the board looks at each frame once, in the order of the table; see [`darm_core::nearest`].
//!
//! The frames are those of the model with its effects, under working conditions. What an effect does to a stage may
//! depend on the others, by the weights further out, or on the word before: a frame is the mean over some words and words
//! before, so that of sag, play and crowding the board knows what they do on average;
//! of a fitted term it knows what it does to the word of zeros.

use darm_core::effect::Place;
use darm_core::model::Condition;
use darm_core::nearest::{Coordinates, Found, Frame, typical};
use darm_core::se::{Pose, Twist};
use darm_core::table::Record;
use darm_core::table::nearest_search::{NearestSearch, feed};
use darm_core::units::Word;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::ReachError;
use super::frames::{self, Frames};
use super::steps::{Step, tabulate};
use crate::arm::{Arm, ArmScratch};

/// Most frames of stages that make a module together.
const MAX_FRAMES: usize = 64;
/// Most actuators of a module: two bits each.
const MAX_ACTUATORS: usize = 8;
/// Words, each with a word before, that a frame is the mean over where effects look further than at one stage.
const WORDS: usize = 16;

/// The modules of `arm` and their frames, effects and all.
///
/// # Errors
///
/// [`ReachError::NoSetting`]: a stage cannot be assembled in any setting. [`ReachError::Servos`]: the arm has servo
/// joints, and its frames depend on their angles.
pub fn records(arm: &Arm) -> Result<Vec<Record>, ReachError> {
    if arm.n_servos() > 0 {
        return Err(ReachError::Servos);
    }
    // A moved mount turns what is reported of the tool, not the weights that the arm bears in its own mount.
    let modules = modules(frames::of_steps(&displaced(arm), with_effects(arm), &[], |_, _| true)?);
    let mut first = 0;
    let framed = modules.iter().map(|module| {
        let mut frames: Vec<Frame<f64>> = module
            .poses
            .iter()
            .zip(&module.words)
            .map(|(pose, word)| Frame { digits: packed(word, first, module.digits), pose: *pose })
            .collect();
        frames.sort_by_key(|frame| frame.digits);
        first += module.digits;
        (module.digits as u8, frames)
    });
    let framed: Vec<_> = framed.collect();
    let mut behind = Pose::identity();
    let mut records = Vec::new();
    for (actuators, frames) in framed.iter().rev() {
        let module = Record::Module {
            actuators: *actuators,
            length_scale_m: arm.length_scale_m as f32,
            behind: Coordinates::of(&behind),
        };
        let frame = |frame: &Frame<f64>| Record::Frame { digits: frame.digits, pose: Coordinates::of(&frame.pose) };
        records.splice(0..0, std::iter::once(module).chain(frames.iter().map(frame)));
        behind = typical(frames) * behind;
    }
    Ok(records)
}

/// What the board answers by these records, of an arm with this many actuators: a word near `target`, `None` where they
/// hold no frames for each of its digits.
pub fn nearest(records: &[Record], actuators: usize, target: &Pose<f64>) -> Option<Found<f32>> {
    let mut search = Box::<NearestSearch>::default();
    search.begin(&target.cast(), actuators);
    for record in records {
        feed(&mut search, record);
    }
    while search.step() {}
    search.found()
}

/// The arm with what moves the tool rigidly in its mount and its tool.
fn displaced(arm: &Arm) -> Arm {
    let mut displaced = arm.clone();
    let condition = resting(arm);
    let chain = &mut displaced.model.chain;
    for effect in &arm.model.effects {
        match effect.place() {
            Place::Base => chain.mount = effect.displace(chain.mount, &condition),
            Place::Tool => chain.tool = effect.displace(chain.tool, &condition),
            // A length given too long is too long in every frame.
            Place::Camera => [&mut chain.mount, &mut chain.tool]
                .into_iter()
                .for_each(|pose| *pose = effect.displace(*pose, &condition)),
            _ => {}
        }
    }
    displaced
}

/// The word of zeros under working conditions, at rest: laws that move the tool rigidly look at no digit, but for
/// fitted terms.
fn resting(arm: &Arm) -> Condition<'_, f64> {
    arm.model.working(arm.rest(), arm.rest(), &[])
}

/// The poses of each stage for each setting of its actuators, with the effects of the model.
fn with_effects(arm: &Arm) -> Vec<Step> {
    let mut steps = tabulate(arm);
    if arm.model.effects.is_empty() {
        return steps;
    }
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut word = || -> Vec<u8> {
        (0..arm.n_actuators()).map(|k| random.random_range(0..arm.model.chain.n_states(k)) as u8).collect()
    };
    let sample = Sample { arm, words: (0..WORDS).map(|_| [word(), word()]).collect() };
    let mut first = 0;
    for (stage, step) in steps.iter_mut().enumerate() {
        if let Step::Poses(poses) = step {
            poses.iter_mut().for_each(|(digits, pose)| *pose = sample.mean(stage, first, digits, *pose));
        }
        first += arm.model.chain.stages[stage].n_actuators();
    }
    steps
}

/// Random words of an arm, each with a word before, that the effects are averaged over.
struct Sample<'a> {
    arm: &'a Arm,
    words: Vec<[Vec<u8>; 2]>,
}

impl Sample<'_> {
    /// The pose of a stage with these digits, its actuators counted from `first`: the mean over what the others do.
    fn mean(&self, stage: usize, first: usize, digits: &[u8], ideal: Pose<f64>) -> Pose<f64> {
        let (model, mut scratch) = (&self.arm.model, ArmScratch::default());
        let (mut sum, mut count) = (Twist::zero(), 0.0);
        for [word, previous] in &self.words {
            let mut word = word.clone();
            word[first..first + digits.len()].copy_from_slice(digits);
            let (Ok(word), Ok(previous)) = (Word::new(&word), Word::new(previous)) else { continue };
            let condition: Condition<f64> = model.working(word, previous, &[]);
            if model.predict(&condition, &mut scratch).is_ok() {
                sum = sum + ideal.to(&scratch.stages[stage]).log();
                count += 1.0;
            }
        }
        let camera = model.effects.iter().filter(|effect| effect.place() == Place::Camera);
        let pose = if count > 0.0 { ideal * Pose::exp(&(sum * (1.0 / count))) } else { ideal };
        camera.fold(pose, |pose, effect| effect.displace(pose, &resting(self.arm)))
    }
}

/// Neighbouring stages together.
fn modules(stages: Vec<Frames>) -> Vec<Frames> {
    let mut modules: Vec<Frames> = Vec::new();
    for stage in stages {
        match modules.last_mut() {
            Some(last) if last.len() * stage.len() <= MAX_FRAMES && last.digits + stage.digits <= MAX_ACTUATORS => {
                *last = last.times(&stage);
            }
            _ => modules.push(stage),
        }
    }
    modules
}

/// Two bits for each digit of a module, the first in the lowest.
fn packed(word: &Word, first: usize, digits: usize) -> u16 {
    (0..digits).fold(0, |packed, k| packed | u16::from(word.digit(first + k)) << (2 * k))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_core::effect::{Effect, Frame as End, Place as At, Plate};
    use darm_core::table::{Checker, TableError};

    use super::*;
    use crate::board_profile::BoardProfile;
    use crate::plan::{Visit, plan};
    use crate::wired_arm::profile_of;

    fn arm(name: &str) -> Arm {
        Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)).unwrap()
    }

    #[test]
    fn the_frames_lead_to_the_word_that_stands_there() {
        for (name, digits) in [("planar4.toml", "010110011101"), ("serial12.toml", "010110011101")] {
            let arm = arm(name);
            let word: Word = digits.parse().unwrap();
            let target = arm.model.chain.pose_base_tool(&word, &[], &mut ArmScratch::default()).unwrap();
            let found = nearest(&records(&arm).unwrap(), 12, &target).unwrap();
            assert!(found.word == word && found.distance_m < 1e-3, "{name}: {found:?}");
        }
    }

    #[test]
    fn a_table_with_frames_passes_the_checker_of_the_board() {
        let arm = arm("spatial6.toml");
        let modules = records(&arm).unwrap();
        assert_eq!(modules.len(), 6 * 65);
        let visit = Visit { word: arm.rest(), servos_rad: vec![], dwell_s: 0.1, label: "rest".into() };
        let plan = plan(&arm, &[visit], &profile_of(&arm, None).unwrap().board(None), &modules).unwrap();
        assert!(plan.image.bytes().len() < 12_000, "{}", plan.image.bytes().len());
        let mut checker = Checker::default();
        let module = modules[0].clone();
        assert_eq!(checker.admit(&module, &BoardProfile::built_in().board(None)), Err(TableError::Order));
    }

    /// Root mean square distance of the frames' products from the model, over 64 words, m.
    fn off(modules: &Arm, model: &Arm) -> f64 {
        let records = records(modules).unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut squares = 0.0;
        for _ in 0..64 {
            let [word, previous] = [(); 2].map(|()| {
                let digits: Vec<u8> = (0..12).map(|_| random.random_range(0..2)).collect();
                Word::new(&digits).unwrap()
            });
            let there = model.model.predict(&model.model.working(word, previous, &[]), &mut ArmScratch::default());
            squares += pose_of(&records, &word).distance(&there.unwrap(), 0.5).powi(2);
        }
        (squares / 64.0).sqrt()
    }

    /// Where the records have the tool for a word.
    fn pose_of(records: &[Record], word: &Word) -> Pose<f64> {
        let (mut pose, mut wanted, mut next) = (Pose::identity(), 0, 0);
        for record in records {
            match record {
                Record::Module { actuators, .. } => {
                    wanted = packed(word, next, usize::from(*actuators));
                    next += usize::from(*actuators);
                }
                Record::Frame { digits, pose: frame } if *digits == wanted => {
                    let (turn, position) = (frame.turn_rad.map(f64::from), frame.position_m.map(f64::from));
                    pose = pose * Pose::new(&turn.into(), position.into());
                }
                _ => {}
            }
        }
        pose
    }

    #[test]
    fn the_frames_have_the_effects_of_the_model() {
        let ideal = arm("planar4.toml");
        let with = |effects: &[Effect<f64>]| {
            let mut arm = ideal.clone();
            arm.model.effects.extend(effects.iter().copied());
            arm
        };
        let fixed: [Effect<f64>; 4] = [
            Effect::StrokeLoss { actuator: 4, state: 1, loss_m: 5e-3 },
            Effect::AnchorOffset { actuator: 7, plate: Plate::Top, offset: [3e-3, -2e-3, 0.0] },
            Effect::FrameOffset { frame: End::Base, values: [0.0, 0.0, 0.01, 0.02, -0.01, 0.0] },
            Effect::FrameOffset { frame: End::Tool, values: [0.0, 0.0, -0.02, 0.01, 0.03, 0.0] },
        ];
        let arm = with(&fixed);
        assert!(off(&arm, &arm) < 1e-6 && off(&ideal, &arm) > 5e-3, "{} {}", off(&arm, &arm), off(&ideal, &arm));
        let arm = with(&[Effect::Scale { stretch: 2e-3 }]);
        assert!(off(&arm, &arm) < 1e-6 && off(&ideal, &arm) > 5e-3, "{} {}", off(&arm, &arm), off(&ideal, &arm));
        // The mean over words and words before takes away what is common to them.
        let sag = Effect::GravitySag { at: At::Arm, compliance_m_per_n: 1e-4 };
        let arm = with(&[sag]);
        let sagging_m = off(&arm, &arm);
        assert!(sagging_m < 0.7 * off(&ideal, &arm), "{sagging_m} {}", off(&ideal, &arm));
        // A base that was measured askew does not turn the weights.
        let arm = with(&[sag, Effect::FrameOffset { frame: End::Base, values: [0.0, 0.0, 1.0, 0.5, 0.0, 0.0] }]);
        assert!((off(&arm, &arm) - sagging_m).abs() < 1e-6, "{sagging_m} {}", off(&arm, &arm));
        let arm = with(&[Effect::Play { at: At::Arm, width_m: 2e-3 }]);
        assert!(off(&arm, &arm) < 0.9 * off(&ideal, &arm), "{} {}", off(&arm, &arm), off(&ideal, &arm));
    }

    #[test]
    fn an_arm_with_servos_has_no_frames_of_its_own() {
        assert_eq!(records(&arm("planar4-hybrid.toml")), Err(ReachError::Servos));
    }
}
