//! What is suspicious about measurements of an arm, row by row.

use darm_arm::arm::{Arm, ArmScratch};
use darm_core::se::{Pose, rotation_exp, rotation_log};

use super::{Finding, FindingKind, Run, Sample, median};

/// A position that is this many times as far from the base as the arm reaches is taken for another unit.
const TOO_FAR: f64 = 20.0;
/// The same for no position in any unit.
const ABSURD: f64 = 1e9;

/// Scales of lengths that a wrong unit leads to, and which: no effect of an arm is as large.
const WRONG_LENGTHS: [(f64, &str); 4] = [
    (1000.0, "they look like mm in columns that end in _m: rename these to x_mm, y_mm, z_mm"),
    (0.001, "they look like m in columns that end in _mm: rename these to x_m, y_m, z_m"),
    (25.4, "they look like mm in columns of inches: correct the numbers, or rename the columns to x_mm, y_mm, z_mm"),
    (1.0 / 25.4, "they look like inches in columns that end in _mm: convert the numbers to mm"),
];
/// A scale is taken for one of these within this factor.
const ALIKE: f64 = 1.25;
/// Orientations agree with degrees read as radians when the median difference is below this, rad; a third of what chance gives.
const ALIKE_RAD: f64 = 0.5;
/// Successive rows with the same pose to the last digit, their words different, that no camera measures.
const FROZEN_ROWS: usize = 5;
/// Rows that a comparison of scales takes.
const ROWS_TO_COMPARE: usize = 6;

/// What the owner of these measurements should know: words that do not fit the arm, time that runs backwards, rows
/// that are repeated, poses that never change, numbers that look like another unit.
pub fn check(arm: &Arm, run: &Run) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (index, sample) in run.samples.iter().enumerate() {
        let fit = fit_of_word(arm, sample).map(|text| Finding::error(FindingKind::RowDoesNotFitArm, text));
        let order = index.checked_sub(1).and_then(|before| order(&run.samples[before], sample));
        findings.extend(fit.into_iter().chain(order).map(|finding| finding.at_line(run.line(index))));
    }
    findings.extend(frozen(run));
    let predicted = predicted(arm, run);
    let scales: Vec<Finding> = length_scale(run, &predicted).into_iter().chain(angle_scale(run, &predicted)).collect();
    findings.extend(if scales.is_empty() { units(run, &predicted).into_iter().collect() } else { scales });
    findings
}

/// Poses that do not change though the words do.
fn frozen(run: &Run) -> Option<Finding> {
    let samples = &run.samples;
    let is_same = |k: &usize| samples[*k].pose == samples[k - 1].pose;
    let mut first = 0;
    for k in 1..=samples.len() {
        if k < samples.len() && is_same(&k) {
            continue;
        }
        let words = samples[first..k].windows(2).filter(|pair| pair[0].word != pair[1].word).count();
        if words >= FROZEN_ROWS {
            let text = format!(
                "the pose is the same to the last digit up to line {}, and the word changes {words} times: these rows were not \
                 measured; leave them out with --where",
                run.line(k - 1)
            );
            return Some(Finding::error(FindingKind::RepeatedRow, text).at_line(run.line(first)));
        }
        first = k;
    }
    None
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
        .map(|k| format!("actuator {k} has no state {}", sample.word.digit(k)))
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

/// Where the model predicts the tool of each sample.
fn predicted(arm: &Arm, run: &Run) -> Vec<Option<Pose<f64>>> {
    let mut scratch = ArmScratch::default();
    let pose = |s: &Sample| arm.model.predict(&arm.working_condition(s.word, &s.servos_rad), &mut scratch).ok();
    run.samples.iter().map(pose).collect()
}

/// Lengths of another unit. The way from one word to the next is compared, which does not depend on the place of the
/// base of the camera.
fn length_scale(run: &Run, predicted: &[Option<Pose<f64>>]) -> Option<Finding> {
    let pairs = || run.samples.windows(2).zip(predicted.windows(2)).filter(|(pair, _)| pair[0].word != pair[1].word);
    let ways = || pairs().filter_map(|(pair, predicted)| Some((pair, predicted[0]?, predicted[1]?)));
    if ways().count() < ROWS_TO_COMPARE {
        return None;
    }
    let measured_m = median(ways().map(|(pair, ..)| (pair[1].pose.position - pair[0].pose.position).norm()))?;
    let predicted_m = median(ways().map(|(_, from, to)| (to.position - from.position).norm()))?;
    let scale = measured_m / predicted_m;
    let (_, cure) = WRONG_LENGTHS.iter().find(|(wrong, _)| (1.0 / ALIKE..ALIKE).contains(&(scale / wrong)))?;
    let text = format!(
        "the median distance from one word to the next is {measured_m:.4} m measured and {predicted_m:.4} m predicted, \
         {scale:.4} times as much; {cure}"
    );
    Some(Finding::error(FindingKind::SuspectedUnit, text).at_line(run.line(0)))
}

/// Degrees read as radians, or radians as degrees: rotation vectors are compared with those predicted, times 57.3 or by it.
fn angle_scale(run: &Run, predicted: &[Option<Pose<f64>>]) -> Option<Finding> {
    let pairs = || run.samples.iter().zip(predicted).filter_map(|(sample, predicted)| Some((sample, (*predicted)?)));
    let angle_rad = |predicted: &Pose<f64>| rotation_log(&predicted.rotation).norm();
    let predicted_rad = median(pairs().map(|(_, predicted)| angle_rad(&predicted)))?;
    let measured_rad = median(pairs().map(|(sample, _)| angle_rad(&sample.pose)))?;
    let apart = |scale: f64| {
        let scaled = |p: &Pose<f64>| rotation_exp(&(rotation_log(&p.rotation) * scale));
        let apart = pairs().map(|(sample, p)| rotation_log(&(scaled(&p).transpose() * sample.pose.rotation)).norm());
        median(apart).unwrap_or(f64::INFINITY)
    };
    let per_radian = 1f64.to_degrees();
    let are_degrees = predicted_rad * per_radian > 2.0 * ALIKE_RAD && apart(per_radian) < ALIKE_RAD.min(apart(1.0));
    let small = (1.0 / ALIKE..ALIKE).contains(&(measured_rad / predicted_rad * per_radian));
    let are_radians = predicted_rad > 1e-3 && small && apart(1.0 / per_radian) < 0.2 * apart(1.0);
    // What a column is said to be in is known: only the other unit can be wrong. And turns about by chance: poses of which a
    // few differ by the same angle agree with many multiples of it, so the same angles with the other sign must not do as well.
    let is_sign = apart(-1.0) <= apart(per_radian).min(apart(1.0 / per_radian));
    let (are_degrees, are_radians) = (
        are_degrees && !is_sign && run.angles_in_degrees != Some(true),
        are_radians && !is_sign && run.angles_in_degrees != Some(false),
    );
    let cure = match (pairs().count() >= ROWS_TO_COMPARE, are_degrees, are_radians) {
        (true, true, _) => "they look like degrees in columns that end in _rad: let the names end in _deg",
        (true, _, true) => "they look like radians in columns that end in _deg: let the names end in _rad",
        _ => return None,
    };
    let [measured, predicted] = [measured_rad, predicted_rad].map(f64::to_degrees);
    let text = format!("the median orientation is {measured:.3} deg measured and {predicted:.3} deg predicted; {cure}");
    Some(Finding::error(FindingKind::SuspectedUnit, text).at_line(run.line(0)))
}

/// Positions farther than the arm reaches: reported once for the file.
fn units(run: &Run, predicted: &[Option<Pose<f64>>]) -> Option<Finding> {
    let reach_m = predicted.iter().flatten().map(|pose| pose.position.norm()).reduce(f64::max)?;
    let farthest_m = run.samples.iter().map(|s| s.pose.position.norm()).fold(0.0, f64::max);
    let text = format!(
        "the positions go {farthest_m:.0} m far and the arm reaches {reach_m:.1} m: are they in mm? a column whose name \
         ends in _mm is read so"
    );
    let finding = if farthest_m > ABSURD * reach_m { Finding::error } else { Finding::note };
    (farthest_m > TOO_FAR * reach_m).then(|| finding(FindingKind::SuspectedUnit, text))
}
