//! The words that bring the tool nearest to desired frames, by a model with its effects.

use darm_core::units::Word;

use super::exact::{Index, Options};
use super::{Candidate, MAX_WORDS, ReachError, best_words, corrected};
use crate::arm::frames::DesiredFrame;
use crate::arm::{Arm, ArmScratch};

/// Times that the words are chosen: the word before a frame is known once all are.
const ROUNDS: usize = 3;

/// The words of an arm, searched for poses, or with a length scale of zero for positions.
struct Search {
    arm: Arm,
    /// Of more words than can be tried.
    index: Option<Index>,
}

/// The frames with the words and servo angles that the model thinks nearest, each reached from the word of the frame before
/// it, round and round; with each the distance that the model predicts from there, m. Where the orientation of a frame is
/// free its position counts alone.
///
/// Up to [`MAX_WORDS`] words every word is tried; more are searched by [`corrected::nearest`].
///
/// # Errors
///
/// As those.
#[expect(clippy::missing_panics_doc, reason = "each frame has a search of its length scale")]
pub fn better_words(arm: &Arm, frames: &[DesiredFrame]) -> Result<Vec<(DesiredFrame, f64)>, ReachError> {
    let searches = searches(arm, frames)?;
    let mut better = frames.to_vec();
    for _ in 0..ROUNDS {
        for frame in &mut better {
            let scale_m = frame.length_scale_m(arm);
            let search = searches.iter().find(|search| search.arm.length_scale_m == scale_m);
            if let Some(best) = search.expect("each frame has its search").nearest(frame)? {
                (frame.word, frame.servos_rad) = (best.word, best.servos_rad);
            }
        }
        if !turn_round(&mut better) {
            break;
        }
    }
    let mut scratch = ArmScratch::default();
    let distance = |frame: DesiredFrame| {
        let condition = arm.model.working(frame.word, frame.previous, &frame.servos_rad);
        let pose = arm.model.predict(&condition, &mut scratch);
        let distance_m = pose.map_or(f64::INFINITY, |pose| frame.distance_m(arm, &pose));
        (frame, distance_m)
    };
    Ok(better.into_iter().map(distance).collect())
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

    /// The nearest word of a frame.
    fn nearest(&self, frame: &DesiredFrame) -> Result<Option<Candidate>, ReachError> {
        let (target, previous) = (&frame.pose_base_tool, &frame.previous);
        let found = match &self.index {
            Some(index) => corrected::nearest(&self.arm, index, target, previous, 1)?,
            None => best_words(&self.arm, target, previous, 1)?,
        };
        Ok(found.into_iter().next())
    }
}

/// Makes the word of each frame the word before of the next one; whether that changes one.
fn turn_round(frames: &mut [DesiredFrame]) -> bool {
    let words: Vec<Word> = frames.iter().map(|frame| frame.word).collect();
    let mut changes = false;
    for (frame, before) in frames.iter_mut().zip(words.iter().cycle().skip(words.len().saturating_sub(1))) {
        changes |= frame.previous != *before;
        frame.previous = *before;
    }
    changes
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_core::effect::Place;
    use darm_core::effect::play::Play;

    use super::better_words;
    use crate::arm::Arm;
    use crate::arm::frames;
    use crate::reach::best_words;

    #[test]
    fn a_word_is_the_nearest_from_the_word_of_the_frame_before() {
        let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
        let mut arm = Arm::read(&examples.join("planar4.toml")).unwrap();
        arm.model.effects.push(Play { at: Place::Arm, width_m: 0.004 }.into()).unwrap();
        let frames = frames::read(&examples.join("planar4-frames.toml"), &arm).unwrap();
        let better = better_words(&arm, &frames).unwrap();
        let before = better.iter().cycle().skip(better.len() - 1);
        for ((frame, distance_m), (before, _)) in better.iter().zip(before) {
            assert_eq!(frame.previous, before.word);
            let best = &best_words(&arm, &frame.pose_base_tool, &frame.previous, 1).unwrap()[0];
            assert!((distance_m - best.distance_m).abs() < 1e-12, "{}: {distance_m}, {}", frame.name, best.distance_m);
        }
    }
    #[test]
    fn a_free_orientation_lets_the_position_choose_the_word() {
        let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
        let arm = Arm::read(&examples.join("planar4.toml")).unwrap();
        let mut frames = frames::read(&examples.join("planar4-frames.toml"), &arm).unwrap();
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
