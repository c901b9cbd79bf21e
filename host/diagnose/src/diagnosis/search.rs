//! The search for what a model of signals is missing: searches near the model that the one before found, until one finds the
//! same.

use crate::agreement::signals::FirstLook;
use crate::agreement::{self, Agreement};
use crate::diagnosis::SignalOptions;
use crate::effect::LawName;
use crate::error::{DiagnoseError, MIN_PIECES, MIN_ROWS};
use crate::judge::selected::SelectedSignals;
use crate::linearise::experiment::{Candidate, Experiment, TableColumns};
use crate::linearise::model::Model;
use crate::linearise::model_effects::ModelEffect;
use crate::linearise::torque::Near;
use crate::linearise::{columns, linearise_near};
use crate::prepare::groups::Groups;
use crate::prepare::signals::Prepared;
use crate::progress::Stage;
use crate::project::{Projected, project};
use crate::rejection::{self, sorted};
use crate::select::forward::SelectionStep;
use crate::select::problem::Trial;
use crate::select::signals::Signals;
use crate::select::signals::search;
use darm_measure::table::Table;
use darm_measure::{Finding, FindingKind};

/// Slopes and residuals from here on are no measurement.
const LARGEST: f64 = 1e100;
/// Searches of signals, each near the model that the one before found.
const MAX_SEARCHES: usize = 4;
/// Constants of laws that differ by this share are the same.
const SAME_CONSTANT: f64 = 2e-3;

/// Prepares, linearises, selects and projects; with `each` the rows of that value of the column are held out.
pub(super) fn select_until_settled(
    model: &Model,
    table: &Table,
    options: &SignalOptions,
    each: Option<&str>,
) -> Result<SelectedSignals, DiagnoseError> {
    options.progress.enter(Stage::Prepare)?;
    let data = Prepared::new(table.clone(), &options.preparation, each)?;
    let (experiment, rejected) = experiment_near(model, &data, options, None)?;
    let groups = Groups::new(&experiment.rows);
    if groups.training.len() < MIN_ROWS || groups.n_blocks < MIN_PIECES {
        return Err(DiagnoseError::TooFewRows { rows: groups.training.len(), pieces: groups.n_blocks });
    }
    // Of rows that are held out in turn only the first search asks, which has them all.
    let FirstLook { mut agreement, contest } = match each {
        None => agreement::signals::agreement(model, &data, &experiment, &options.progress)?,
        Some(_) => Agreement::AsRead.into(),
    };
    options.progress.enter(Stage::Select)?;
    let mut found = Found::search(experiment, groups, &agreement, &[], options)?;
    // What was selected changes the constants and columns of other laws, and so what is to be selected.
    for _ in 1..MAX_SEARCHES {
        let before = in_model(&found.problem, &found.best);
        let Some(near) = Near::model(&found.problem.experiment, &found.best.fit.values, &before) else { break };
        let (experiment, _) = experiment_near(model, &data, options, Some(near))?;
        found = Found::search(experiment, found.problem.groups, &agreement, &before, options)?;
        if are_same(&before, &in_model(&found.problem, &found.best)) {
            break;
        }
    }
    let lost = contest.and_then(|contest| {
        contest.lost(&found.problem.experiment, &found.best.unseen_residuals, &in_model(&found.problem, &found.best))
    });
    if let Some(reading) = lost {
        found.best = found.problem.fitted(found.best.fit.active[..found.n_known].to_vec())?;
        agreement = Agreement::Otherwise(reading);
    }
    let Found { problem, best, n_known, path } = found;
    let Projected { best, impossible } = project(&problem, best, n_known)?;
    let (held_out, mut findings) = (data.held_out, data.findings);
    findings.extend(problem.experiment.findings.iter().cloned());
    if !best.weighting.has_converged {
        let text = "the noise and the fit that it weighs did not settle: intervals may be too narrow";
        findings.push(Finding::note(FindingKind::NoConvergence, text));
    }
    Ok(SelectedSignals { problem, best, n_known, impossible, rejected, path, agreement, held_out, findings })
}

/// What a search among the candidates of an experiment found.
struct Found {
    problem: Signals,
    best: Trial<Signals>,
    n_known: usize,
    path: Vec<SelectionStep>,
}

impl Found {
    fn search(
        experiment: Experiment,
        groups: Groups,
        agreement: &Agreement,
        before: &[ModelEffect],
        options: &SignalOptions,
    ) -> Result<Self, DiagnoseError> {
        let always = always(&experiment, &options.always)?;
        let n_known = always.len();
        let before = with_those_of(&experiment, always.clone(), before);
        let problem = Signals::new(experiment, groups).with_progress(options.progress.clone());
        let (best, path) = match agreement {
            Agreement::Otherwise(_) => (problem.fitted(always)?, Vec::new()),
            Agreement::AsRead | Agreement::Hardly(_) if before.len() == n_known => search::select(&problem, always)?,
            Agreement::AsRead | Agreement::Hardly(_) => search::select_again(&problem, always, before)?,
        };
        Ok(Self { problem, best, n_known, path })
    }
}

/// These candidates and those of the effects of another search, with the constants that are nearest.
fn with_those_of(experiment: &Experiment, mut active: Vec<usize>, effects: &[ModelEffect]) -> Vec<usize> {
    let candidates = &experiment.candidates;
    for effect in effects {
        let is_one = |&k: &usize| candidates[k].law == effect.law && candidates[k].site.code == effect.place;
        let off = |k: &usize| {
            let constant = candidates[*k].shape.as_ref().map(|(_, constant, _)| *constant);
            constant.zip(effect.constant).map_or(0.0, |(one, other)| (one - other).abs())
        };
        let nearest = (0..candidates.len()).filter(is_one).min_by(|a, b| off(a).total_cmp(&off(b)));
        active.extend(nearest.filter(|nearest| !active.contains(nearest)));
    }
    active
}

/// The experiment of a model and a table without the candidates that were rejected, and these; near a model that was found.
fn experiment_near(
    model: &Model,
    data: &Prepared,
    options: &SignalOptions,
    near: Option<Near>,
) -> Result<(Experiment, Vec<Candidate>), DiagnoseError> {
    let linearised = linearise_near(model, data, near, &options.progress)?;
    let (mut experiment, rejected) = rejection::of_signals(linearised, &model.effects, &options.rejected)?;
    check_numbers(model, data, &experiment)?;
    // A column that overflows determines nothing.
    let values = experiment.candidates.iter_mut().flat_map(|candidate| &mut candidate.values);
    for value in values.filter(|value| !value.column.iter().all(|slope| slope.abs() < LARGEST)) {
        value.column.fill(0.0);
    }
    Ok((experiment, rejected))
}

/// The effects of a model that was selected, with all their values.
pub(super) fn in_model(problem: &Signals, best: &Trial<Signals>) -> Vec<ModelEffect> {
    let fit = &best.fit;
    let of = |&candidate: &usize| {
        let values: Vec<f64> = problem.indices(&[candidate]).iter().map(|&at| fit.values[at]).collect();
        ModelEffect::of(&problem.experiment.candidates[candidate], &values)
    };
    fit.active.iter().map(of).collect()
}

/// Whether two searches selected the same effects, in whatever order, with constants that differ by little.
fn are_same(before: &[ModelEffect], after: &[ModelEffect]) -> bool {
    let is_near = |a: Option<f64>, b: Option<f64>| match (a, b) {
        (Some(a), Some(b)) => (a - b).abs() <= SAME_CONSTANT * a.abs(),
        (a, b) => a == b,
    };
    let has = |all: &[ModelEffect], one: &ModelEffect| {
        let is_same = |other: &ModelEffect| other.law == one.law && other.place == one.place;
        all.iter().any(|other| is_same(other) && is_near(other.constant, one.constant))
    };
    before.len() == after.len() && after.iter().all(|one| has(before, one))
}

/// The candidates of the laws that are always in the model; of a law with several shapes the first.
fn always(experiment: &Experiment, laws: &[String]) -> Result<Vec<usize>, DiagnoseError> {
    let candidates = &experiment.candidates;
    let mut active: Vec<usize> = Vec::new();
    for name in laws {
        let law = LawName::named(name);
        let all: Vec<usize> = (0..candidates.len()).filter(|&k| Some(candidates[k].law) == law).collect();
        if all.is_empty() {
            let known = sorted(candidates.iter().map(|candidate| candidate.law.as_str()), ", ");
            return Err(DiagnoseError::UnknownLaw { law: name.clone(), known });
        }
        for k in all {
            if !active.iter().any(|&other| candidates[other].is_same(&candidates[k])) {
                active.push(k);
            }
        }
    }
    Ok(active)
}

/// Whether all residuals are numbers; else which column is not, or that the model predicts none.
fn check_numbers(model: &Model, data: &Prepared, experiment: &Experiment) -> Result<(), DiagnoseError> {
    let is_none = |residual: &f64| residual.is_nan() || residual.abs() >= LARGEST;
    let Some(at) = experiment.residuals.iter().position(is_none) else { return Ok(()) };
    let TableColumns { measured, moving } = columns(model, data);
    let mut names = measured.into_iter().chain(moving.into_iter().map(|joint| joint.columns)).flatten();
    let line = experiment.rows[at / experiment.axes.len()].line;
    let cause = names.find_map(|name| data.first_not_a_number(&name, LARGEST));
    Err(cause.map_or(DiagnoseError::NotANumber { line }, DiagnoseError::from))
}
