//! Actuators that move nothing: strokes that a synthesis keeps, and actuators whose stops are equal.

use crate::arm::Arm;
use crate::arm::frames::{DesiredFrame, StopRange};

/// Stops closer than this are equal, m or rad.
const EQUAL: f64 = 1e-6;

/// Ranges that keep a stroke of at least `least_m` between the states of actuators with lengths, where the frames file bounds
/// no stroke itself; `free_only` leaves out the actuators all of whose states the frames use.
pub fn min_strokes(
    arm: &Arm,
    frames: &[DesiredFrame],
    ranges: &[StopRange],
    min_m: f64,
    free_only: bool,
) -> Vec<StopRange> {
    let bounded = |actuator| ranges.iter().any(|range| range.actuator == actuator && range.stroke.1.is_finite());
    let is_used = |actuator: usize, state: u8| frames.iter().any(|frame| frame.word.digit(actuator) == state);
    let is_free =
        |actuator: usize| (0..arm.model.chain.n_states(actuator) as u8).any(|state| !is_used(actuator, state));
    let keeps = |actuator: &usize| !arm.turns(*actuator) && !bounded(*actuator) && (!free_only || is_free(*actuator));
    let range =
        |actuator| StopRange { actuator, value: (f64::NEG_INFINITY, f64::INFINITY), stroke: (min_m, f64::INFINITY) };
    (0..arm.n_actuators()).filter(keeps).map(range).collect()
}

/// The actuators two of whose stops are equal, by their numbers: they do not move there.
pub fn equal_stops(arm: &Arm) -> Vec<usize> {
    let value = |actuator: usize, state: usize| {
        let stop = darm_core::chain::Parameter::Stop { actuator: actuator as u8, state: state as u8 };
        arm.model.chain.get(stop).unwrap_or_default()
    };
    let is_equal = |actuator: &usize| {
        (1..arm.model.chain.n_states(*actuator))
            .any(|state| (value(*actuator, state) - value(*actuator, state - 1)).abs() < EQUAL)
    };
    (0..arm.n_actuators()).filter(is_equal).collect()
}
