//! Actuators that move nothing: strokes that a synthesis keeps, stops that it leaves, and actuators whose stops are equal.

use darm_core::chain::Parameter;

use crate::arm::Arm;
use crate::arm::frames::{DesiredFrame, StopRange};

/// Stops closer than this are equal, m or rad.
const EQUAL: f64 = 1e-6;

/// The least stroke of an actuator, m; that of a revolute joint turns the tool as far at the arm's length scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MinStroke {
    /// Of an actuator with a state that no frame uses.
    pub free_m: f64,
    /// Of an actuator all of whose states the frames use.
    pub used_m: f64,
}

impl MinStroke {
    /// The same for all actuators.
    pub fn of_all(min_m: f64) -> Self {
        Self { free_m: min_m, used_m: min_m }
    }
}

/// Ranges that keep a least stroke between the states of every actuator whose strokes or stops `ranges` do not fix.
pub fn min_strokes(arm: &Arm, frames: &[DesiredFrame], ranges: &[StopRange], min: MinStroke) -> Vec<StopRange> {
    let is_fixed = |range: &StopRange| range.stroke.1.is_finite() || range.value.0 == range.value.1;
    let is_free = |actuator: &usize| !ranges.iter().any(|range| range.actuator == *actuator && is_fixed(range));
    let is_used = |actuator: usize, state: u8| frames.iter().any(|frame| frame.word.digit(actuator) == state);
    let range = |actuator: usize| {
        let all_used = (0..arm.model.chain.n_states(actuator) as u8).all(|state| is_used(actuator, state));
        let min_m = if all_used { min.used_m } else { min.free_m };
        let min = if arm.turns(actuator) { min_m / arm.length_scale_m } else { min_m };
        StopRange { stroke: (min, f64::INFINITY), ..StopRange::any(actuator) }
    };
    (0..arm.n_actuators()).filter(is_free).map(range).collect()
}

/// Ranges that leave every stop of one actuator where it is.
pub fn stops_as_they_are(arm: &Arm, actuator: usize) -> Vec<StopRange> {
    let range = |(state, value)| StopRange { state: Some(state), value: (value, value), ..StopRange::any(actuator) };
    (0..).zip(stops(arm, actuator)).map(range).collect()
}

/// The actuators two of whose stops are equal, by their numbers: they do not move there.
pub fn equal_stops(arm: &Arm) -> Vec<usize> {
    short_strokes(arm, EQUAL)
}

/// The actuators with a stroke below `min_m`, by their numbers.
pub fn short_strokes(arm: &Arm, min_m: f64) -> Vec<usize> {
    let is_short = |actuator: &usize| {
        let min = if arm.turns(*actuator) { min_m / arm.length_scale_m } else { min_m };
        stops(arm, *actuator).windows(2).any(|pair| (pair[1] - pair[0]).abs() < min - NOISE)
    };
    (0..arm.n_actuators()).filter(is_short).collect()
}

/// Rounding of a stop at its bound, m or rad.
const NOISE: f64 = 1e-9;

/// The values of one actuator's stops, by state.
pub(super) fn stops(arm: &Arm, actuator: usize) -> Vec<f64> {
    let value = |state| {
        let stop = Parameter::Stop { actuator: actuator as u8, state };
        arm.model.chain.get(stop).expect("every state of an actuator has a stop")
    };
    (0..arm.model.chain.n_states(actuator) as u8).map(value).collect()
}
