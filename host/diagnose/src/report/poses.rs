//! The outcome of a diagnosis of tool poses: errors, intervals, outliers and points for plots.

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use crate::judge::poses::Judgement;
use crate::judge::selected::SelectedPoses;
use crate::linearise::arm_candidates;
use crate::measurement::{median, root_mean_square};
use crate::outcome::{
    AxisFigure, BeforeAfter, Diagnosis, Effect, ErrorFigure, Errors, Number, Outlier, Point, Repeatability, RepeatedIn,
    Rows, SelectionStep, Value, Visit,
};
use crate::prepare::groups::FOLDS;
use crate::prepare::observations::{self, NoPose, Observations, axes};
use crate::prepare::repeatability::Noise;
use crate::select::problem::{Neighbours as _, RegressionProblem as _, Trial};
use crate::select::robust_fit::{condition, covariance, size};
use crate::select::significance::quantile_975;
use crate::select::tool_pose::{ToolPoses, values};
use darm_arm::arm::{Arm, ArmModel, ArmScratch};

/// Chance that any row of a run without outliers is called one.
const OUTLIER_LEVEL: f64 = 0.01;

/// The diagnosis, without its sentences.
pub(crate) fn diagnosis(
    selected: &SelectedPoses,
    judgement: Judgement,
    selection_path: Vec<SelectionStep>,
    seed: u64,
) -> Result<Diagnosis, NoPose> {
    let SelectedPoses { arm, problem, repeatability: repeats, best, .. } = *selected;
    let nominal = problem.training.residuals(&arm.model, &mut ArmScratch::default())?;
    let error = BeforeAfter {
        before: errors(arm, problem, &arm.model, &nominal)?,
        after: errors(arm, problem, &best.fit.model, &best.predicted)?,
    };
    let effects = match judgement.verdict {
        verdict if verdict.names_effects() => effects(selected, &error)?,
        _ => Vec::new(),
    };
    let (train, own) = (problem.training.rows.len(), problem.heldout.rows.len());
    Ok(Diagnosis {
        kind: "tool-pose",
        model: Some(arm.model.number),
        rows: Rows { train, heldout: if own == 0 { train } else { own } },
        held_out: held_out(selected),
        left_out: "words",
        repeatability: repeats.map(|noise| repeatability(arm, noise)),
        error,
        verdict: judgement.verdict,
        other_reading: selected.agreement.other_reading(),
        effects,
        alternatives: judgement.alternatives,
        unobservable: unobservable(best),
        outliers: outliers(selected),
        structure: Some(judgement.structure),
        remaining: judgement.remaining,
        selection_path,
        condition: Some(condition(&best.fit, &problem.training)),
        next_measurement: judgement.next_measurement,
        plain: Vec::new(),
        findings: Vec::new(),
        points: points(selected)?,
        seed,
        version: env!("CARGO_PKG_VERSION"),
    })
}

fn repeatability(arm: &Arm, noise: &Noise) -> Repeatability {
    Repeatability {
        norm: Number { value: noise.distance_m, unit: "m" },
        axes: axes(arm).iter().map(|&axis| axis_figure(axis, noise.sigma[axis])).collect(),
        dof: noise.dof,
        repeated_in: RepeatedIn::Rows,
    }
}

/// How the rows were chosen that the fit did not see.
fn held_out(selected: &SelectedPoses) -> String {
    let choice = &selected.run.choice;
    match (selected.problem.heldout.rows.is_empty(), &choice.parts) {
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
    let ToolPoses { training, heldout, .. } = problem;
    let train = error_figure(arm, training, &training.residuals(model, &mut scratch)?);
    let heldout = match heldout.rows.is_empty() {
        true => error_figure(arm, training, cross_validated),
        false => error_figure(arm, heldout, &heldout.residuals(model, &mut scratch)?),
    };
    Ok(Errors { train, heldout: Some(heldout) })
}

/// The effects selected, with intervals of their values.
fn effects(selected: &SelectedPoses, error: &BeforeAfter) -> Result<Vec<Effect>, NoPose> {
    let SelectedPoses { arm, problem, best, .. } = *selected;
    let fit = &best.fit;
    let covariance = covariance(fit, &problem.training);
    let width = quantile_975(problem.training.n_groups.saturating_sub(fit.values.len()));
    let mut found = Vec::new();
    for (index, effect) in fit.model.effects.iter().enumerate().skip(selected.n_known()) {
        let law = effect.law();
        let value = |(column, &(_, value)): (usize, &observations::Value)| {
            let half = width * covariance[(column, column)].max(0.0).sqrt();
            let (quantity, value) = (law.quantities()[value], law.values()[value]);
            let ci95 = Some([value - half, value + half]);
            Value { name: quantity.name.into(), value, unit: quantity.unit.into(), ci95 }
        };
        let of_effect = fit.values.iter().enumerate().filter(|(_, (owner, _))| *owner == index);
        found.push(Effect {
            law: law.name(),
            site: arm_candidates::site(arm, effect),
            values: of_effect.map(value).collect(),
            heldout_gain: heldout_gain(selected, index, error)?,
        });
    }
    Ok(found)
}

/// By how much the held-out error is larger without one of the effects.
fn heldout_gain(selected: &SelectedPoses, effect: usize, error: &BeforeAfter) -> Result<Option<f64>, NoPose> {
    let SelectedPoses { arm, problem, best, .. } = *selected;
    let Some(after) = &error.after.heldout else { return Ok(None) };
    let without = if best.fit.model.effects.len() == selected.n_known() + 1 {
        error.before.heldout.clone()
    } else {
        let Trial { fit, predicted, .. } = problem.neighbours(best).with_one_less(effect)?;
        errors(arm, problem, &fit.model, &predicted)?.heldout
    };
    Ok(without.map(|without| without.norm.value - after.norm.value))
}

/// Values of the effects selected that no row identifies; on a planar arm, offsets out of the plane say.
fn unobservable(best: &Trial<ToolPoses>) -> Vec<String> {
    let name = |&(effect, value): &observations::Value| {
        let effect = &best.fit.model.effects[effect];
        let law = effect.law();
        format!("{} of {} at {}", law.quantities()[value].name, law.name(), arm_candidates::place_code(effect))
    };
    values(&best.fit.model).iter().filter(|value| !best.fit.values.contains(value)).map(name).collect()
}

/// Rows that are farther off than the noise, itself known by limited degrees of freedom, would ever be.
fn outliers(selected: &SelectedPoses) -> Vec<Outlier> {
    let training = &selected.problem.training;
    let (n_axes, residuals) = (training.n_axes(), &selected.best.fit.residuals);
    let per_axis = selected.repeats().map_or(training.rows.len(), |noise| noise.dof);
    let noise_dof = (per_axis * n_axes) as f64;
    let (Ok(chi), Ok(f)) = (ChiSquared::new(n_axes as f64), FisherSnedecor::new(n_axes as f64, noise_dof)) else {
        return Vec::new();
    };
    let squares: Vec<f64> = residuals.chunks(n_axes).map(|row| size(row).powi(2)).collect();
    let usual = median(squares.iter().copied()).unwrap_or(1.0) / chi.inverse_cdf(0.5);
    let rare = 1.0 - OUTLIER_LEVEL / squares.len().max(1) as f64;
    let limit = n_axes as f64 * f.inverse_cdf(rare) * usual.max(1.0);
    let distances = training.distances_m(residuals);
    let far = squares.iter().enumerate().filter(|(_, square)| **square > limit);
    let outlier = |(row, square): (usize, &f64)| Outlier {
        line: selected.run.line(training.rows[row].sample),
        error: distances[row],
        sigmas: square.sqrt(),
    };
    far.map(outlier).collect()
}

fn points(selected: &SelectedPoses) -> Result<Vec<Point>, NoPose> {
    let SelectedPoses { arm, run, problem, best, .. } = *selected;
    let (mut points, mut scratch) = (Vec::new(), ArmScratch::default());
    for (held_out, observations) in [(false, &problem.training), (true, &problem.heldout)] {
        let before = observations.residuals(&arm.model, &mut scratch)?;
        let after = observations.residuals(&best.fit.model, &mut scratch)?;
        let (before_m, after_m) = (observations.distances_m(&before), observations.distances_m(&after));
        for (k, row) in observations.rows.iter().enumerate() {
            let sample = &run.samples[row.sample];
            let visit = Visit {
                word: sample.word.to_string(),
                servos_rad: sample.servos_rad.clone(),
                supply: sample.supply,
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
    let axes = axes(arm).iter().zip(observations.rms(residuals)).map(|(&axis, rms)| axis_figure(axis, rms)).collect();
    ErrorFigure {
        axes,
        norm: Number { value: root_mean_square(&distances), unit: "m" },
        largest: distances.iter().copied().fold(0.0, f64::max),
    }
}

/// A component of a twist, ω first, by name and unit.
fn axis_figure(axis: usize, value: f64) -> AxisFigure {
    let (name, unit) =
        [("about x", "rad"), ("about y", "rad"), ("about z", "rad"), ("x", "m"), ("y", "m"), ("z", "m")][axis];
    AxisFigure { axis: name.into(), value, unit }
}
