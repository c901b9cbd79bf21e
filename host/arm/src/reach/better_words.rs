//! The words that bring the tool nearest to desired frames, by a model with its effects.

use darm_core::units::Word;

use super::exact::{Index, Options};
use super::{Candidate, MAX_WORDS, ReachError, best_words, corrected};
use crate::arm::Arm;
use crate::arm::frames::DesiredFrame;

/// The frames with the words and servo angles that the model thinks nearest, each reached from the word of the frame before
/// it, round and round; with each the distance that the model predicts, m.
///
/// Up to [`MAX_WORDS`] words every word is tried; more are searched by [`corrected::nearest`].
///
/// # Errors
///
/// As those.
pub fn better_words(arm: &Arm, frames: &[DesiredFrame]) -> Result<Vec<(DesiredFrame, f64)>, ReachError> {
    let n_words: f64 = (0..arm.n_actuators()).map(|k| arm.model.chain.n_states(k) as f64).product();
    let index = if n_words > MAX_WORDS as f64 { Some(Index::new(arm, &Options::of(arm))?) } else { None };
    let mut better = Vec::new();
    for frame in frames {
        let (mut frame, mut distance_m) = (frame.clone(), f64::INFINITY);
        if let Some(best) = nearest(arm, index.as_ref(), &frame)? {
            (frame.word, frame.servos_rad, distance_m) = (best.word, best.servos_rad, best.distance_m);
        }
        better.push((frame, distance_m));
    }
    let words: Vec<Word> = better.iter().map(|(frame, _)| frame.word).collect();
    for ((frame, _), before) in better.iter_mut().zip(words.iter().cycle().skip(words.len().saturating_sub(1))) {
        frame.previous = *before;
    }
    Ok(better)
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
