//! What is suspicious about measurements of an arm, row by row.

use super::{Finding, FindingKind, Run, Sample};
use darm_arm::arm::{Arm, ArmScratch};

/// A position that is this many times as far from the base as the arm reaches is taken for another unit.
const TOO_FAR: f64 = 20.0;

/// What the owner of these measurements should know: words that do not fit the arm, time that runs backwards, rows
/// that are repeated, numbers that look like another unit.
pub fn check(arm: &Arm, run: &Run) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (index, sample) in run.samples.iter().enumerate() {
        let fit = fit_of_word(arm, sample).map(|text| Finding::error(FindingKind::RowDoesNotFitArm, text));
        let order = index.checked_sub(1).and_then(|before| order(&run.samples[before], sample));
        findings.extend(fit.into_iter().chain(order).map(|finding| finding.at_line(run.line(index))));
    }
    findings.extend(units(arm, run));
    findings
}

fn fit_of_word(arm: &Arm, sample: &Sample) -> Option<String> {
    let (digits, actuators) = (sample.word.len(), arm.n_actuators());
    if digits != actuators {
        return Some(format!("the word has {digits} digits, the arm has {actuators} actuators"));
    }
    if sample.previous.is_some_and(|previous| previous.len() != actuators) {
        return Some(format!("the word before has another number of digits than the arm's {actuators}"));
    }
    let (given, servos) = (sample.servos_rad.len(), arm.n_servos());
    if given != servos {
        return Some(format!("{given} servo positions are given, the arm has {servos} servo joints"));
    }
    (0..actuators)
        .find(|&k| usize::from(sample.word.digit(k)) >= arm.model.chain.n_states(k))
        .map(|k| format!("digit {} of actuator {k} is no state that it has", sample.word.digit(k)))
}

fn order(before: &Sample, sample: &Sample) -> Option<Finding> {
    if before.run != sample.run {
        return None;
    }
    if before.time_s == sample.time_s && before.pose == sample.pose && before.word == sample.word {
        return Some(Finding::note(FindingKind::RepeatedRow, "the row repeats the one before"));
    }
    let text = || format!("time {} s is not after the {} s of the row before", sample.time_s, before.time_s);
    (sample.time_s <= before.time_s).then(|| Finding::note(FindingKind::TimeRunsBack, text()))
}

/// Millimetres for metres: reported once for the file.
fn units(arm: &Arm, run: &Run) -> Option<Finding> {
    let reach_m = reach(arm, run)?;
    let farthest_m = run.samples.iter().map(|s| s.pose.position.norm()).fold(0.0, f64::max);
    let text = format!(
        "the positions go {farthest_m:.0} m far and the arm reaches {reach_m:.1} m: are they in mm? a column whose name \
         ends in _mm is read so"
    );
    (farthest_m > TOO_FAR * reach_m).then(|| Finding::note(FindingKind::SuspectedUnit, text))
}

/// The largest distance from the base that the model gives the words of the run.
fn reach(arm: &Arm, run: &Run) -> Option<f64> {
    let mut scratch = ArmScratch::default();
    let poses = run.samples.iter().filter_map(|s| {
        let condition = arm.working_condition(s.word, &s.servos_rad);
        arm.model.predict(&condition, &mut scratch).ok()
    });
    poses.map(|pose| pose.position.norm()).reduce(f64::max)
}
