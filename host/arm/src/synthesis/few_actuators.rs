//! Synthesis that turns the stops of few actuators.

use darm_core::effect::Place;

use super::{Method, Options, Status, Synthesis, SynthesisError, stops_as_they_are, synthesize};
use crate::arm::Arm;
use crate::arm::frames::DesiredFrame;

/// As [`synthesize`], but with [`Method::Newton`] a person turns the stops of few actuators where that suffices: of one on which
/// an effect of the model acts, else of all of those, else of every actuator.
///
/// # Errors
///
/// As [`synthesize`].
pub fn synthesize_by_few(
    base_line: &Arm,
    desired: &[DesiredFrame],
    options: &Options,
) -> Result<Synthesis, SynthesisError> {
    let affected = match options.method {
        Method::Newton => affected(base_line),
        Method::Plain | Method::Paper(_) => Vec::new(),
    };
    let alone = affected.iter().map(std::slice::from_ref);
    let all = [affected.as_slice()].into_iter().filter(|all| all.len() > 1);
    for few in alone.chain(all) {
        let kept = (0..base_line.n_actuators()).filter(|actuator| !few.contains(actuator));
        let kept = kept.flat_map(|actuator| stops_as_they_are(base_line, actuator));
        let ranges = options.ranges.iter().copied().chain(kept).collect();
        // So few unknowns have one solution at most, and the base-line is near it.
        let found = synthesize(base_line, desired, &Options { ranges, starts: 1, ..options.clone() })?;
        if found.status == Status::Reached {
            return Ok(found);
        }
    }
    synthesize(base_line, desired, options)
}

/// The actuators on which an effect acts alone.
fn affected(arm: &Arm) -> Vec<usize> {
    let mut affected: Vec<usize> = arm
        .model
        .effects
        .iter()
        .filter_map(|effect| match effect.place() {
            Place::Actuator(actuator) => Some(actuator.into()),
            _ => None,
        })
        .collect();
    affected.sort_unstable();
    affected.dedup();
    affected
}
