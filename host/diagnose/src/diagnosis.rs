//! Diagnosis: the stages in their order, for tool poses and for signals.
//!
//! ```text
//! prepare ─► linearise ─► select ─► project ─► judge ─► report
//!               ▲            │ effects kept
//!               └────────────┘ residual again
//! ```
//!
//! A cause is named only when no other explains the measurements as well, and only when it takes up most of what is beyond
//! the noise. The levels of all tests are in [`significance`](crate::select::significance). Rows that are held out are seen
//! by no fit before the errors on them are reported.

use crate::agreement::{self, Agreement};
use crate::correction::{ArmCorrection, Outcome, SignalCorrection};
use crate::effect::{Effect, LawName};
use crate::error::{DiagnoseError, MIN_WORDS};
use crate::judge;
use crate::judge::held_out::HeldOut;
use crate::judge::next_words::Proposal;
use crate::judge::regression::of_axis;
use crate::judge::selected::{SelectedPoses, SelectedSignals};
use crate::linearise::model::Model;
use crate::linearise::model_effects::{self, ModelEffect};
use crate::outcome::{Dependence, Diagnosis, Misreading, Number, OtherReading};
use crate::prepare::observations::{NoPose, Observations};
use crate::prepare::repeatability::{self, PoseRepeatability};
use crate::prepare::run_findings;
use crate::prepare::signals::{Preparation, PrepareError};
use crate::progress::{Cancelled, Progress, Stage};
use crate::rejection::{self, Rejection, is_of_one_law};
use crate::report::{self, Summary, sentences};
use crate::select::forward::{Selection, forward_selection};
use crate::select::poses::cross_validation::folds;
use crate::select::poses::{NoTrial, ToolPoses};
use crate::select::problem::{RegressionProblem as _, Trial};
use crate::select::significance::Levels;
use darm_arm::arm::{Arm, ArmScratch};
use darm_measure::hold_out::HoldOut;
use darm_measure::table::{Names, Table};
use darm_measure::{Finding, Run, Severity, check, demean};
use darm_robot::files::FileRef;

mod search;

use self::search::{in_model, select_until_settled};
pub use crate::report::sentences::effect_sentence;

/// How tool poses are diagnosed.
#[derive(Clone, Debug)]
pub struct PoseOptions {
    /// Shuffles the words into folds.
    pub seed: u64,
    /// How many words a proposed measurement has.
    pub next_words: usize,
    /// Effects that are no candidates.
    pub rejected: Vec<Rejection>,
    /// Of the tests.
    pub levels: Levels,
    /// How far it is.
    pub progress: Progress,
}

impl Default for PoseOptions {
    fn default() -> Self {
        let (levels, progress) = (Levels::default(), Progress::default());
        Self { seed: 1, next_words: 12, rejected: Vec::new(), levels, progress }
    }
}

/// How signals are diagnosed.
#[derive(Clone, Debug, Default)]
pub struct SignalOptions {
    /// How the table is made ready.
    pub preparation: Preparation,
    /// Laws that are in the model from the start, each at all its places.
    pub always: Vec<String>,
    /// Effects that are no candidates.
    pub rejected: Vec<Rejection>,
    /// Reported; nothing is drawn by chance.
    pub seed: u64,
    /// How far it is.
    pub progress: Progress,
}

/// What `run` says about what the model of `arm` is missing, with what is suspicious about its rows.
///
/// # Errors
///
/// A run that does not fit the arm, or has too few words.
pub fn diagnose(arm: &Arm, run: &Run, options: &PoseOptions) -> Result<Outcome<ArmCorrection>, DiagnoseError> {
    let no_trial = |none| no_trial(run, none);
    options.progress.enter(Stage::Prepare)?;
    let mut findings = check(arm, run);
    let doubt = run_findings::temperature(run);
    findings.extend(doubt.clone());
    if let Some(finding) = findings.iter().find(|finding| finding.severity == Severity::Error) {
        return Err(DiagnoseError::Row(finding.clone()));
    }
    let repeats = repeatability::repeated(arm, run);
    let problem = prepare_poses(arm, run, repeats.as_ref().filter(|noise| noise.is_known()), options)?;
    let start = problem.fitted(&arm.model).map_err(no_trial)?;
    options.progress.enter(Stage::Select)?;
    let mut agreement = agreement::poses::agreement(arm, run, &options.progress)?;
    let nothing = || Selection { best: start.clone(), rivals: Vec::new(), path: Vec::new() };
    let mut selection = match &agreement {
        Agreement::Otherwise(_) => nothing(),
        Agreement::AsRead | Agreement::Hardly(_) => {
            forward_selection(&problem, start.clone(), Vec::new()).map_err(no_trial)?
        }
    };
    if doubt.is_some()
        && agreement.other_reading().is_none()
        && let Some(reading) = read_in_fahrenheit(arm, run, &problem, &selection.best, options)?
    {
        (agreement, selection) = (Agreement::Otherwise(reading), nothing());
    }
    let Selection { best, rivals, path } = selection;
    options.progress.enter(Stage::Judge)?;
    let repeatability = repeats.as_ref();
    let selected = SelectedPoses { arm, run, problem: &problem, repeatability, best: &best, agreement: &agreement };
    let how = Proposal { seed: options.seed, words: options.next_words };
    let (mut judgement, with_terms) = judge::poses::judge(&selected, &start, rivals, how).map_err(no_trial)?;
    if doubt.is_some() {
        withhold_intervals(&mut judgement.effects);
    }
    options.progress.check()?;
    let summary = report::poses::summary(&selected, path, options.seed).map_err(|none| no_trial(none.into()))?;
    let summary = Summary { findings, rejected: options.rejected.clone(), ..summary };
    let diagnosis = report::diagnosis(summary, judgement, |diagnosis| {
        sentences::of_poses(arm, diagnosis, &selected.effects(), with_terms.as_ref())
    });
    let correction = ArmCorrection {
        best_effects: best.fit.model.effects.iter().copied().collect(),
        is_named: diagnosis.verdict.names_effects(),
        with_terms,
    };
    Ok(Outcome { diagnosis, correction })
}

/// Temperatures as degrees Fahrenheit, where no more effects then predict unseen rows better than those selected in °C.
fn read_in_fahrenheit(
    arm: &Arm,
    run: &Run,
    problem: &ToolPoses,
    best: &Trial<ToolPoses>,
    options: &PoseOptions,
) -> Result<Option<OtherReading>, DiagnoseError> {
    let no_trial = |none| no_trial(run, none);
    let read = run_findings::in_fahrenheit(run);
    // In units of the same noise, so that both can be compared.
    let sigma = problem.training.sigma;
    let noise = PoseRepeatability { sigma, dof: repeatability::MIN_DOF, distance_m: 0.0, is_rounded: false };
    let other = prepare_poses(arm, &read, Some(&noise), options)?;
    let start = other.fitted(&arm.model).map_err(no_trial)?;
    let Selection { best: with, .. } = forward_selection(&other, start, Vec::new()).map_err(no_trial)?;
    let n_effects = |trial: &Trial<ToolPoses>| trial.fit.model.effects.len();
    let is_better = problem.under(best).predicts_better(&with, best, options.levels.discovery);
    let reading = OtherReading {
        misreading: Misreading::Fahrenheit,
        as_read: Some(Number::new(best.error, "m")),
        error: Number::new(with.error, "m"),
    };
    Ok((is_better && n_effects(&with) <= n_effects(best)).then_some(reading))
}

/// Takes the intervals from what grows with a temperature whose unit is in doubt: they hold in one unit only.
fn withhold_intervals(effects: &mut [Effect]) {
    let thermal = effects.iter_mut().filter(|effect| effect.law == LawName::ThermalGrowth);
    thermal.flat_map(|effect| &mut effect.values).for_each(|value| value.ci95 = None);
}

/// The rows of a run as a regression problem, in units of the noise of its repeats; without enough repeats in that of the residuals
/// that remain once the effects which are selected first are in the model.
fn prepare_poses(
    arm: &Arm,
    run: &Run,
    repeats: Option<&PoseRepeatability>,
    options: &PoseOptions,
) -> Result<ToolPoses, DiagnoseError> {
    let no_trial = |none| no_trial(run, none);
    let sigma = match repeats {
        Some(noise) => noise.sigma,
        None => scatter(arm, run).map_err(|none| no_trial(none.into()))?.sigma,
    };
    let training = Observations::new(arm, run, sigma, |sample| !sample.held_out);
    let held_out = Observations::new(arm, run, sigma, |sample| sample.held_out);
    let of_rows = |parts: &[usize]| -> Vec<usize> { training.rows.iter().map(|row| parts[row.sample]).collect() };
    let folds = match (run.choice.parts_in_turn(), &run.choice.parts) {
        (Some(parts), _) => of_rows(parts),
        (None, Some(parts)) => folds(&of_rows(parts), options.seed),
        (None, None) => folds(&training.groups(), options.seed),
    };
    if training.n_groups < MIN_WORDS {
        return Err(DiagnoseError::TooFewWords { words: training.n_groups });
    }
    if folds.iter().all(|fold| *fold == folds[0]) {
        return Err(DiagnoseError::OneGroup { selection: run.choice.description.clone() });
    }
    let problem = ToolPoses::new(training, held_out, folds)
        .without(rejection::of_arm(arm, &options.rejected)?)
        .with_levels(options.levels)
        .with_progress(options.progress.clone());
    if repeats.is_some() {
        return Ok(problem);
    }
    let start = problem.fitted(&arm.model).map_err(no_trial)?;
    let Selection { best, .. } = forward_selection(&problem, start, Vec::new()).map_err(no_trial)?;
    let sigma = repeatability::of_residuals(arm, &problem.training, &best.fit.residuals).sigma;
    Ok(problem.with_noise(sigma))
}

/// Why there is no model of a run, with the line of its row.
fn no_trial(run: &Run, none: NoTrial) -> DiagnoseError {
    match none {
        NoTrial::NoPose(NoPose { sample, error }) => DiagnoseError::NoPose { line: run.line(sample), error },
        NoTrial::Cancelled => Cancelled.into(),
    }
}

/// Without repeats: the model's own residuals give the noise that weighs the axes, though they hold more than noise.
fn scatter(arm: &Arm, run: &Run) -> Result<PoseRepeatability, NoPose> {
    let plain = Observations::new(arm, run, [1.0; 6], |sample| !sample.held_out);
    let residuals = plain.residuals(&arm.model, &mut ArmScratch::default())?;
    Ok(repeatability::of_residuals(arm, &plain, &residuals))
}

/// Reads a table and finds what `model` is missing.
///
/// # Errors
///
/// A table that cannot be read, or that gives no experiment.
pub fn diagnose_file<'a>(
    model: &Model,
    data: impl Into<FileRef<'a>>,
    names: &Names,
    options: &SignalOptions,
) -> Result<Outcome<SignalCorrection>, DiagnoseError> {
    let (table, findings) = Table::read(data, names)?;
    diagnose_table_read(model, &table, findings, options)
}

/// What a table says about what `model` is missing.
///
/// # Errors
///
/// A table that gives no experiment.
pub fn diagnose_table(
    model: &Model,
    table: &Table,
    options: &SignalOptions,
) -> Result<Outcome<SignalCorrection>, DiagnoseError> {
    diagnose_table_read(model, table, Vec::new(), options)
}

/// Diagnoses a table; `findings` are those of reading it.
fn diagnose_table_read(
    model: &Model,
    table: &Table,
    findings: Vec<Finding>,
    options: &SignalOptions,
) -> Result<Outcome<SignalCorrection>, DiagnoseError> {
    let pooled = held_out_in_turn(model, table, options)?;
    let mut selected = select_until_settled(model, table, options, None)?;
    options.progress.enter(Stage::Judge)?;
    selected.findings.splice(0..0, findings);
    Ok(conclude(model, &selected, pooled.as_ref(), options)?)
}

/// The held-out residuals of one search for each value of the column whose rows are held out in turn.
fn held_out_in_turn(model: &Model, table: &Table, options: &SignalOptions) -> Result<Option<HeldOut>, DiagnoseError> {
    let HoldOut::Each(column) = &options.preparation.hold_out else { return Ok(None) };
    let mut kept = table.clone();
    if let Some(keep) = &options.preparation.keep {
        kept.retain(&keep.rows(table).map_err(PrepareError::from)?);
    }
    let mut pooled = HeldOut::default();
    for value in kept.values_of(column).map_err(PrepareError::from)? {
        pooled.add(&select_until_settled(model, table, options, Some(&value))?);
    }
    Ok(Some(pooled))
}

/// Judges and reports.
fn conclude(
    model: &Model,
    selected: &SelectedSignals,
    pooled: Option<&HeldOut>,
    options: &SignalOptions,
) -> Result<Outcome<SignalCorrection>, Cancelled> {
    let judgement = judge::signals::judge(selected, pooled, options.preparation.lowpass_hz.is_some())?;
    let summary = report::signals::summary(selected, pooled, options.seed);
    let summary = Summary { rejected: options.rejected.clone(), ..summary };
    let diagnosis = report::diagnosis(summary, judgement, sentences::of_signals);
    let effects = model_effects::merge(&model.effects, in_model(&selected.problem, &selected.best));
    let correction = SignalCorrection { effects, terms: terms(&diagnosis, selected) };
    Ok(Outcome { diagnosis, correction })
}

/// What remains along one signal, as fitted terms.
fn terms(diagnosis: &Diagnosis, selected: &SelectedSignals) -> Vec<ModelEffect> {
    let term = |one: &Dependence| {
        let axis = one.axis.as_deref()?;
        // A time does not come again.
        (one.variable != "time" && !one.curve.is_empty())
            .then(|| ModelEffect::fitted_term(axis, &one.variable, &one.curve))
    };
    let all: Vec<ModelEffect> = diagnosis.remaining.depends_on.iter().filter_map(term).collect();
    let signal = |term: &ModelEffect| (term.place.clone(), term.along.clone());
    let replacing: Vec<_> = all.iter().filter(|term| replaces_rejected(term, selected)).map(signal).collect();
    all.into_iter().filter(|term| !replacing.contains(&signal(term))).collect()
}

/// Whether a fitted term adds what a rejected law would.
fn replaces_rejected(term: &ModelEffect, selected: &SelectedSignals) -> bool {
    let experiment = &selected.problem.experiment;
    let n_axes = experiment.axes.len();
    let axis = experiment.axes.iter().position(|axis| axis.name == term.place);
    let channel = experiment.channels.iter().find(|(name, _)| Some(name) == term.along.as_ref());
    let Some((axis, (_, channel))) = axis.zip(channel) else { return false };
    let added = demean(&channel.iter().map(|channel| term.at(*channel)).collect::<Vec<f64>>());
    let values = selected.rejected.iter().flat_map(|one| one.values.iter().map(|value| (one.law, value)));
    let columns = values.map(|(law, value)| (law, demean(&of_axis(&value.column, n_axes, axis))));
    is_of_one_law(&added, columns.collect())
}

#[cfg(test)]
mod cases;
#[cfg(test)]
mod given_up;
#[cfg(test)]
mod signal_tests;
#[cfg(test)]
mod tests;
