//! Synthesis again around an actuator that is dead in one state, and what that costs.

use darm_core::units::Word;
use serde::Serialize;

use super::stroke::stops;
use super::words::choose_words;
use super::{Options, Status, Synthesis, SynthesisError, synthesize};
use crate::arm::Arm;
use crate::arm::frames::DesiredFrame;

/// An actuator that stays in one state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StuckActuator {
    /// Its number.
    pub actuator: usize,
    /// The state that it stays in.
    pub state: u8,
}

/// What a repair costs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// Frames that need another word than the one with the dead digit put in.
    pub words_changed: usize,
    /// Frames that are met.
    pub frames_met: usize,
    /// Requested frames.
    pub frames: usize,
    /// Stops that have to be turned, by more than a micrometre or microradian.
    pub stops_turned: usize,
    /// Root of the sum of squares of what they are turned by, m.
    pub alteration_m: f64,
    /// What a stop of the dead actuator is turned by at most, m; an angle weighs as the arm's length scale. An actuator
    /// that is jammed cannot be turned: [`stops_as_they_are`](super::stops_as_they_are) keeps its stops.
    pub dead_turned_m: f64,
    /// Words that the arm has left, as a share of all.
    pub words_left: f64,
}

/// Looks for stops of `arm` with which its frames are met although one actuator is dead: with the same words but for the
/// dead digit, where those stay distinct, or with other words where that alters the stops less.
///
/// # Errors
///
/// As [`choose_words`]; with the words of `desired` nothing was found either.
pub fn repair(
    arm: &Arm,
    desired: &[DesiredFrame],
    dead: StuckActuator,
    options: &Options,
) -> Result<(Synthesis, Cost), SynthesisError> {
    let StuckActuator { actuator, state } = dead;
    let stuck: Vec<DesiredFrame> = desired
        .iter()
        .map(|frame| DesiredFrame { word: frame.word.with_digit(actuator, state), ..frame.clone() })
        .collect();
    let distinct = stuck.iter().enumerate().all(|(index, frame)| stuck[..index].iter().all(|f| f.word != frame.word));
    let same_words = if distinct { synthesize(arm, &stuck, options).ok() } else { None };
    let chosen = choose_words(arm, &stuck, options, &|word: &Word| word.digit(actuator) == state);
    let found = match (same_words, chosen) {
        (Some(same), Ok(chosen)) if is_better(&same, &chosen) => same,
        (_, Ok(chosen)) => chosen,
        (Some(same), Err(_)) => same,
        (None, Err(error)) => return Err(error),
    };
    let words_changed =
        found.frames.iter().zip(&stuck).filter(|(reached, frame)| reached.frame.word != frame.word).count();
    let cost = Cost {
        words_changed,
        frames_met: found.frames.iter().filter(|reached| reached.is_met()).count(),
        frames: desired.len(),
        stops_turned: found.stops_turned(arm),
        alteration_m: found.alteration_m,
        dead_turned_m: turned_m(arm, &found.arm, actuator),
        words_left: 1.0 / arm.model.chain.n_states(actuator).max(1) as f64,
    };
    Ok((found, cost))
}

/// What the stops of one actuator are turned by at most, m.
fn turned_m(from: &Arm, to: &Arm, actuator: usize) -> f64 {
    let per_unit_m = if from.turns(actuator) { from.length_scale_m } else { 1.0 };
    let turned = stops(from, actuator).into_iter().zip(stops(to, actuator)).map(|(from, to)| (to - from).abs());
    per_unit_m * turned.fold(0.0, f64::max)
}

/// Whether one geometry meets the frames with less alteration than another, or comes nearer where neither meets them.
fn is_better(one: &Synthesis, other: &Synthesis) -> bool {
    match (one.status, other.status) {
        (Status::Reached, Status::Reached) => one.alteration_m <= other.alteration_m,
        (Status::Closest, Status::Closest) => one.is_nearer(other),
        (status, _) => status == Status::Reached,
    }
}
