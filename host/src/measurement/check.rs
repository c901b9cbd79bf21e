//! What is suspicious about measurements of an arm, row by row.

use super::{Finding, Run, Sample};
use crate::arm::{Arm, ArmScratch};

/// A position that is this many times as far from the base as the arm reaches is taken for another unit.
const TOO_FAR: f64 = 20.0;

/// What the owner of these measurements should know: words that do not fit the arm, time that runs backwards, rows
/// that are repeated, numbers that look like another unit.
pub fn check(arm: &Arm, run: &Run) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (index, sample) in run.samples.iter().enumerate() {
        let mut tell = |what: String| findings.push(Finding { line: Some(run.line(index)), what });
        fit_of_word(arm, sample).into_iter().for_each(&mut tell);
        if let Some(before) = index.checked_sub(1).map(|before| &run.samples[before]) {
            order(before, sample).into_iter().for_each(&mut tell);
        }
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

fn order(before: &Sample, sample: &Sample) -> Option<String> {
    if before.run != sample.run {
        return None;
    }
    if before.time_s == sample.time_s && before.pose == sample.pose && before.word == sample.word {
        return Some("the row repeats the one before".into());
    }
    (sample.time_s <= before.time_s)
        .then(|| format!("time {} s is not after the {} s of the row before", sample.time_s, before.time_s))
}

/// Millimetres for metres, radians for degrees: told once for the file.
fn units(arm: &Arm, run: &Run) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut tell = |what: &str| findings.push(Finding { line: None, what: what.into() });
    if let Some(reach_m) = reach(arm, run) {
        let farthest_m = run.samples.iter().map(|s| s.pose.position.norm()).fold(0.0, f64::max);
        if farthest_m > TOO_FAR * reach_m {
            tell("the positions are far out of the arm's reach: are they in mm? the columns are read as m");
        }
    }
    let turned_deg = |s: &Sample| s.servos_rad.iter().fold(0f64, |most, angle| most.max(angle.to_degrees().abs()));
    let most_deg = run.samples.iter().map(turned_deg).fold(0.0, f64::max);
    if most_deg > 0.0 && most_deg < 3.2 && run.samples.len() > 10 {
        tell("no servo turns by more than 3.2: are the positions in rad? the columns are read as degrees");
    }
    findings
}

/// The largest distance from the base that the model gives the words of the run.
fn reach(arm: &Arm, run: &Run) -> Option<f64> {
    let mut scratch = ArmScratch::default();
    let poses = run.samples.iter().filter_map(|s| {
        let condition = arm.model.nominal(s.word, &s.servos_rad);
        arm.model.predict(&condition, &mut scratch).ok()
    });
    poses.map(|pose| pose.position.norm()).reduce(f64::max)
}
