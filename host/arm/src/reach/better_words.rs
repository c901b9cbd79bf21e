//! The words that bring the tool nearest to desired frames, by a model with its effects.

use super::exact::{Index, Options};
use super::{Candidate, MAX_WORDS, ReachError, best_words, corrected};
use crate::arm::frames::DesiredFrame;
use crate::arm::{Arm, ArmScratch};

/// Times that the words are chosen at most: the word before the first frame is known once all are.
const ROUNDS: usize = 3;
/// Words of the last frame that are tried for what they make of the first one.
const CLOSING: usize = 64;

/// The words of an arm, searched for poses, or with a length scale of zero for positions.
struct Search {
    arm: Arm,
    /// Of more words than can be tried.
    index: Option<Index>,
}

/// The frames with the words and servo angles that the model thinks nearest, each reached from the word of the frame before
/// it, round and round; with each the distance that the model predicts from there, m. Where the orientation of a frame is
/// free its position counts alone. Only the first frame may not have the nearest word from the last one: their words depend on
/// each other.
///
/// Up to [`MAX_WORDS`] words every word is tried; more are searched by [`corrected::nearest`].
///
/// # Errors
///
/// As those.
pub fn better_words(arm: &Arm, frames: &[DesiredFrame]) -> Result<Vec<(DesiredFrame, f64)>, ReachError> {
    let searches = searches(arm, frames)?;
    let mut better = frames.to_vec();
    for _ in 0..ROUNDS {
        let mut changes = false;
        let mut previous = better.last().map(|frame| frame.word);
        for frame in &mut better {
            frame.previous = previous.unwrap_or(frame.previous);
            if let Some(best) = search_of(&searches, arm, frame).nearest(frame, 1)?.into_iter().next() {
                changes |= best.word != frame.word;
                (frame.word, frame.servos_rad) = (best.word, best.servos_rad);
            }
            previous = Some(frame.word);
        }
        if !changes {
            break;
        }
    }
    close(&searches, arm, &mut better)?;
    let predicted = |frame: DesiredFrame| {
        let distance_m = predicted_m(arm, &frame);
        (frame, distance_m)
    };
    Ok(better.into_iter().map(predicted).collect())
}

/// Chooses the word of the last frame such that the first one is reached well from it too.
fn close(searches: &[Search], arm: &Arm, frames: &mut [DesiredFrame]) -> Result<(), ReachError> {
    let [first, .., last] = frames else {
        frames.iter_mut().for_each(|frame| frame.previous = frame.word);
        return Ok(());
    };
    if first.previous == last.word {
        return Ok(());
    }
    let of_first = |previous| predicted_m(arm, &DesiredFrame { previous, ..first.clone() });
    let squares = |last: &Candidate| last.distance_m.powi(2) + of_first(last.word).powi(2);
    let found = search_of(searches, arm, last).nearest(last, CLOSING)?.into_iter();
    if let Some((_, best)) = found.map(|last| (squares(&last), last)).min_by(|a, b| a.0.total_cmp(&b.0)) {
        (last.word, last.servos_rad) = (best.word, best.servos_rad);
    }
    first.previous = last.word;
    Ok(())
}

/// The distance from a frame that the model predicts, m; infinite where it has no pose.
fn predicted_m(arm: &Arm, frame: &DesiredFrame) -> f64 {
    let condition = arm.model.working(frame.word, frame.previous, &frame.servos_rad);
    let pose = arm.model.predict(&condition, &mut ArmScratch::default());
    pose.map_or(f64::INFINITY, |pose| frame.distance_m(arm, &pose))
}

/// The search of a frame's length scale.
fn search_of<'a>(searches: &'a [Search], arm: &Arm, frame: &DesiredFrame) -> &'a Search {
    let scale_m = frame.length_scale_m(arm);
    let search = searches.iter().find(|search| search.arm.length_scale_m == scale_m);
    search.expect("each frame has a search of its length scale")
}

/// One search for each length scale of the frames.
fn searches(arm: &Arm, frames: &[DesiredFrame]) -> Result<Vec<Search>, ReachError> {
    let mut searches: Vec<Search> = Vec::new();
    for scale_m in frames.iter().map(|frame| frame.length_scale_m(arm)) {
        if searches.iter().all(|search| search.arm.length_scale_m != scale_m) {
            searches.push(Search::new(Arm { length_scale_m: scale_m, ..arm.clone() })?);
        }
    }
    Ok(searches)
}

impl Search {
    fn new(arm: Arm) -> Result<Self, ReachError> {
        let n_words: f64 = (0..arm.n_actuators()).map(|k| arm.model.chain.n_states(k) as f64).product();
        let index = if n_words > MAX_WORDS as f64 { Some(Index::new(&arm, &Options::of(&arm))?) } else { None };
        Ok(Self { arm, index })
    }

    /// The nearest words of a frame.
    fn nearest(&self, frame: &DesiredFrame, count: usize) -> Result<Vec<Candidate>, ReachError> {
        let (target, previous) = (&frame.pose_base_tool, &frame.previous);
        match &self.index {
            Some(index) => corrected::nearest(&self.arm, index, target, previous, count),
            None => best_words(&self.arm, target, previous, count),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_core::effect::{Effect, Place};

    use super::better_words;
    use crate::arm::Arm;
    use crate::arm::frames;
    use crate::reach::best_words;

    fn example(file: &str) -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(file)
    }

    #[test]
    fn a_word_is_the_nearest_from_the_word_of_the_frame_before() {
        let mut arm = Arm::read(&example("planar4.toml")).unwrap();
        arm.model.effects.push(Effect::Play { at: Place::Arm, width_m: 0.004 }).unwrap();
        let frames = frames::read(&example("planar4-frames.toml"), &arm).unwrap();
        let better = better_words(&arm, &frames).unwrap();
        let before = better.iter().cycle().skip(better.len() - 1);
        for ((frame, distance_m), (before, _)) in better.iter().zip(before).take(better.len() - 1).skip(1) {
            assert_eq!(frame.previous, before.word);
            let best = &best_words(&arm, &frame.pose_base_tool, &frame.previous, 1).unwrap()[0];
            assert!((distance_m - best.distance_m).abs() < 1e-12, "{}: {distance_m}, {}", frame.name, best.distance_m);
        }
    }

    #[test]
    fn frames_in_a_circle_of_64_6_words_are_reached_in_spite_of_play() {
        let nominal = Arm::read(&example("spatial6.toml")).unwrap();
        let frames = frames::read(&example("spatial6-positions.toml"), &nominal).unwrap();
        for actuator in [0, 32] {
            let mut arm = nominal.clone();
            arm.model.effects.push(Effect::Play { at: Place::Actuator(actuator), width_m: 0.01 }).unwrap();
            for (frame, distance_m) in better_words(&arm, &frames).unwrap() {
                assert!(distance_m < 1e-3, "play of actuator {actuator}, frame {}: {distance_m} m", frame.name);
            }
        }
    }

    #[test]
    fn a_free_orientation_lets_the_position_choose_the_word() {
        let arm = Arm::read(&example("planar4.toml")).unwrap();
        let mut frames = frames::read(&example("planar4-frames.toml"), &arm).unwrap();
        frames[0].weights.orientation = 0.0;
        let better = better_words(&arm, &frames).unwrap();
        let positions = Arm { length_scale_m: 0.0, ..arm.clone() };
        for ((frame, distance_m), arm) in better.iter().zip([&positions, &arm, &arm, &arm, &arm]) {
            let best = &best_words(arm, &frame.pose_base_tool, &frame.previous, 1).unwrap()[0];
            assert!((distance_m - best.distance_m).abs() < 1e-12, "{}: {distance_m}, {}", frame.name, best.distance_m);
        }
        let as_pose = &best_words(&arm, &better[0].0.pose_base_tool, &better[0].0.previous, 1).unwrap()[0];
        assert_ne!(as_pose.word, better[0].0.word, "the orientation decided before");
    }
}
