//! What a report shows of tool poses: errors, outliers and points for plots.

use crate::judge::far_rows::far_rows;
use crate::judge::selected::SelectedPoses;
use crate::outcome::{
    AxisFigure, BeforeAfter, ErrorFigure, Errors, Measured, Number, Outlier, Point, Rows, SelectionStep, Visit,
};
use crate::prepare::groups::FOLDS;
use crate::prepare::observations::{NoPose, Observations, axes};
use crate::report::Summary;
use crate::select::poses::ToolPoses;
use crate::select::poses::robust_fit::condition;
use darm_arm::arm::{Arm, ArmModel, ArmScratch};
use darm_measure::{root_mean_square, without_farthest};

/// What a report shows of the rows.
pub(crate) fn summary(
    selected: &SelectedPoses,
    selection_path: Vec<SelectionStep>,
    seed: u64,
) -> Result<Summary, NoPose> {
    let SelectedPoses { arm, problem, best, .. } = *selected;
    let nominal = problem.training.residuals(&arm.model, &mut ArmScratch::default())?;
    let (train, own) = (problem.training.rows.len(), problem.held_out.rows.len());
    Ok(Summary {
        kind: Measured::ToolPose,
        model: Some(arm.model.number),
        rows: Rows { train, held_out: if own == 0 { train } else { own } },
        held_out: held_out(selected),
        is_cross_validated: own == 0,
        left_out: "words",
        error: BeforeAfter {
            before: errors(arm, problem, &arm.model, &nominal)?,
            after: errors(arm, problem, &best.fit.model, &best.unseen_residuals)?,
        },
        other_reading: selected.agreement.other_reading(),
        outliers: outliers(selected),
        selection_path,
        condition: Some(condition(&best.fit, &problem.training)),
        points: points(selected)?,
        findings: Vec::new(),
        rejected: Vec::new(),
        seed,
    })
}

/// How the rows were chosen that the fit did not see.
fn held_out(selected: &SelectedPoses) -> String {
    let choice = &selected.run.choice;
    match (selected.problem.held_out.rows.is_empty(), &choice.parts) {
        (false, _) if choice.description.is_empty() => "the column held_out".into(),
        (false, _) => choice.description.clone(),
        (true, Some(_)) if choice.parts_in_turn().is_some() => choice.description.clone(),
        (true, Some(_)) => format!("{}, in {FOLDS} parts", choice.description),
        (true, None) => format!("each word in turn, in {FOLDS} parts"),
    }
}

/// Errors of a model; `cross_validated` are its residuals in turn, which serve where nothing is held out for good.
fn errors(arm: &Arm, problem: &ToolPoses, model: &ArmModel, cross_validated: &[f64]) -> Result<Errors, NoPose> {
    let mut scratch = ArmScratch::default();
    let ToolPoses { training, held_out, .. } = problem;
    let train = error_figure(arm, training, &training.residuals(model, &mut scratch)?);
    let held_out = match held_out.rows.is_empty() {
        true => error_figure(arm, training, cross_validated),
        false => error_figure(arm, held_out, &held_out.residuals(model, &mut scratch)?),
    };
    Ok(Errors { train, held_out: Some(held_out) })
}

/// Rows that are farther off than noise ever is.
fn outliers(selected: &SelectedPoses) -> Vec<Outlier> {
    let training = &selected.problem.training;
    let distances = training.distances_m(&selected.best.fit.residuals);
    let outlier = |(row, sigmas): (usize, f64)| Outlier {
        line: selected.run.line(training.rows[row].sample),
        error: Number::new(distances[row], "m"),
        sigmas,
    };
    far_rows(selected).into_iter().map(outlier).collect()
}

fn points(selected: &SelectedPoses) -> Result<Vec<Point>, NoPose> {
    let SelectedPoses { arm, run, problem, best, .. } = *selected;
    let (mut points, mut scratch) = (Vec::new(), ArmScratch::default());
    for (held_out, observations) in [(false, &problem.training), (true, &problem.held_out)] {
        let before = observations.residuals(&arm.model, &mut scratch)?;
        let after = observations.residuals(&best.fit.model, &mut scratch)?;
        let (before_m, after_m) = (observations.distances_m(&before), observations.distances_m(&after));
        for (k, row) in observations.rows.iter().enumerate() {
            let sample = &run.samples[row.sample];
            let visit = Visit {
                word: sample.word.to_string(),
                servos_rad: sample.servos_rad.clone(),
                supply_pa: sample.supply,
                temperature_c: sample.temperature_c,
                before_m: before_m[k],
                after_m: after_m[k],
            };
            points.push(Point {
                time_s: sample.time_s,
                held_out,
                before: observations.components(&before, k),
                after: observations.components(&after, k),
                visit: Some(visit),
            });
        }
    }
    points.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Ok(points)
}

fn error_figure(arm: &Arm, observations: &Observations, residuals: &[f64]) -> ErrorFigure {
    let distances = observations.distances_m(residuals);
    let axes =
        axes(arm).iter().zip(observations.rms(residuals)).map(|(&axis, rms)| AxisFigure::of_twist(axis, rms)).collect();
    ErrorFigure {
        axes,
        norm: Number::new(root_mean_square(&distances), "m"),
        largest: Number::new(distances.iter().copied().fold(0.0, f64::max), "m"),
        without_farthest: Number::new(root_mean_square(&without_farthest(distances)), "m"),
    }
}
