//! The words that bring the tool nearest to desired frames, by a model with its effects.

use darm_core::units::Word;

use super::exact::{Index, Options};
use super::{Candidate, MAX_WORDS, ReachError, best_words, corrected};
use crate::arm::frames::DesiredFrame;
use crate::arm::{Arm, ArmScratch};

/// Times that the words are chosen: the word before a frame is known once all are.
const ROUNDS: usize = 3;

/// The frames with the words and servo angles that the model thinks nearest, each reached from the word of the frame before
/// it, round and round; with each the distance that the model predicts from there, m.
///
/// Up to [`MAX_WORDS`] words every word is tried; more are searched by [`corrected::nearest`].
///
/// # Errors
///
/// As those.
pub fn better_words(arm: &Arm, frames: &[DesiredFrame]) -> Result<Vec<(DesiredFrame, f64)>, ReachError> {
    let n_words: f64 = (0..arm.n_actuators()).map(|k| arm.model.chain.n_states(k) as f64).product();
    let index = if n_words > MAX_WORDS as f64 { Some(Index::new(arm, &Options::of(arm))?) } else { None };
    let mut better = frames.to_vec();
    for _ in 0..ROUNDS {
        for frame in &mut better {
            if let Some(best) = nearest(arm, index.as_ref(), frame)? {
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
        let distance_m = pose.map_or(f64::INFINITY, |pose| pose.distance(&frame.pose_base_tool, arm.length_scale_m));
        (frame, distance_m)
    };
    Ok(better.into_iter().map(distance).collect())
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

/// The nearest word of a frame, by the index where there is one.
fn nearest(arm: &Arm, index: Option<&Index>, frame: &DesiredFrame) -> Result<Option<Candidate>, ReachError> {
    let (target, previous) = (&frame.pose_base_tool, &frame.previous);
    let found = match index {
        Some(index) => corrected::nearest(arm, index, target, previous, 1)?,
        None => best_words(arm, target, previous, 1)?,
    };
    Ok(found.into_iter().next())
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
}
