//! Forward selection with exchange and backward elimination: effects are added one at a time, each the one that predicts
//! rows that no fit has seen best.
//!
//! All candidates are judged by their linear fit first, cross-validated over groups of rows; the best few, if their gain may
//! be more than chance, are fitted in full and judged again. The best is kept when its gain is significant
//! ([`discovery_level`](super::problem::Policy::discovery_level), over all that were tried). After each addition the effects selected before must
//! be significant again.

use serde::Serialize;

use super::problem::{CandidateName, Neighbours, RegressionProblem, Trial};
use super::significance::RIVAL_LEVEL;

/// Candidates of each step that are fitted in full.
const MAX_REFITTED: usize = 8;
/// Effects that one selection adds at most: some may replace each other again and again.
const MAX_STEPS: usize = 80;
/// Exchanges of one effect for another in one selection.
const MAX_EXCHANGES: usize = 12;
/// Reduction of the loss below which an exchange is rounding: the effect may have been exchanged for itself.
const MIN_GAIN: f64 = 1.0;

/// One model that was tried.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SelectionStep {
    /// How many effects had been selected before.
    pub step: usize,
    /// The law that was added, and where.
    #[serde(flatten)]
    pub candidate: CandidateName,
    /// How many values it has that these measurements determine.
    pub values: usize,
    /// Cross-validated error with it, in the unit of the observation's norm.
    pub cross_validated: f64,
    /// Cross-validated error without it.
    pub without: f64,
    /// Chance of such a gain where there is none, times the number of effects tried.
    pub p: f64,
    /// Whether it was fitted in full; the others were judged by their linear fit.
    pub refined: bool,
    /// Whether it was kept.
    pub kept: bool,
}

/// A model that was selected.
#[derive(Debug)]
pub struct Selection<P: RegressionProblem> {
    /// The model with all effects that are significant.
    pub best: Trial<P>,
    /// For the effect that was added last: what else was fitted in full; empty when effects were taken away since.
    pub rivals: Vec<Trial<P>>,
    /// Everything that was tried.
    pub path: Vec<SelectionStep>,
}

/// The models with one effect more than the best one before, those with the lowest loss first.
struct Tried<P: RegressionProblem> {
    /// Each fitted linearly.
    screened: Vec<Trial<P>>,
    /// The most promising of them, fitted in full.
    refitted: Vec<Trial<P>>,
}

/// A candidate that the path reports.
struct Reported<'t, P: RegressionProblem> {
    name: CandidateName,
    trial: &'t Trial<P>,
    /// Its number among those fitted in full; `None` of one that was judged by its linear fit only.
    refitted: Option<usize>,
}

/// Selects effects beside those of `start`; `path` has what was tried before, which counts among the effects tried.
///
/// # Errors
///
/// What the fits of `problem` fail with: a model that cannot predict its rows, or that it was given up.
pub fn forward_selection<P: RegressionProblem>(
    problem: &P,
    start: Trial<P>,
    mut path: Vec<SelectionStep>,
) -> Result<Selection<P>, P::Error> {
    let (policy, n_known) = (problem.policy(), problem.n_effects(&start.fit));
    let mut best = problem.reweight_until_converged(start)?;
    let (mut rivals, mut exchanges) = (Vec::new(), 0);
    for _ in 0..MAX_STEPS {
        problem.progress().check()?;
        if problem.n_effects(&best.fit) >= policy.max_effects {
            break;
        }
        let step = problem.n_effects(&best.fit) - n_known;
        let mut tried = try_candidates(problem, &best)?;
        let before: Vec<&SelectionStep> = path.iter().filter(|old| old.step == step).collect();
        let reported = tried.reported(problem, &before);
        let n_tried = before.len() + reported.len();
        let kept = first_significant(problem, &best, &tried.refitted, n_tried);
        path.extend(reported.into_iter().map(|candidate| {
            let Reported { name, trial, refitted } = candidate;
            SelectionStep {
                step,
                candidate: name,
                values: problem.n_values(&trial.fit) - problem.n_values(&best.fit),
                cross_validated: trial.error,
                without: best.error,
                p: chance(problem, &best, trial, tried.screened.len()),
                refined: refitted.is_some(),
                kept: refitted.is_some() && refitted == kept,
            }
        }));
        if let Some(kept) = kept {
            let n_before = problem.n_effects(&best.fit);
            best = tried.refitted.remove(kept);
            rivals = tried.refitted;
            let n_added = problem.n_effects(&best.fit) - n_before;
            while let Some(without) = drop_one(problem, &best, n_known, n_tried, n_added)? {
                best = without;
                rivals.clear();
            }
        } else if exchanges < MAX_EXCHANGES
            && policy.exchanges
            && let Some(better) = exchanged(problem, &best, n_known)?
        {
            best = better;
            rivals.clear();
            exchanges += 1;
        } else {
            break;
        }
        best = problem.reweight_until_converged(best)?;
    }
    Ok(Selection { best, rivals, path })
}

/// The best candidates beside the effects of `current`, fitted in full, the best first.
fn try_candidates<P: RegressionProblem>(problem: &P, current: &Trial<P>) -> Result<Tried<P>, P::Error> {
    let under = problem.under(current);
    let screened = under.sorted(problem.neighbours(current)?.with_one_more()?);
    problem.progress().add_tried(screened.len());
    let promising = screened.iter().filter(|trial| chance(problem, current, trial, screened.len()) < 1.0);
    let refitted = under.sorted(refit(problem, promising)?);
    Ok(Tried { screened, refitted })
}

/// The chance that any of `n_tried` candidates predicts unseen rows better than `current` by as much as this one does, where none
/// helps (Bonferroni).
fn chance<P: RegressionProblem>(problem: &P, current: &Trial<P>, candidate: &Trial<P>, n_tried: usize) -> f64 {
    (problem.under(current).reduction(current, candidate).p * n_tried as f64).min(1.0)
}

impl<P: RegressionProblem> Tried<P> {
    /// All that were fitted in full, and those of the others that neither these nor the steps `before` report.
    fn reported(&self, problem: &P, before: &[&SelectionStep]) -> Vec<Reported<'_, P>> {
        let refitted = self.refitted.iter().enumerate().map(|(k, trial)| (trial, Some(k)));
        let screened = self.screened.iter().map(|trial| (trial, None));
        let mut reported: Vec<Reported<'_, P>> = Vec::new();
        for (trial, refitted) in refitted.chain(screened) {
            let Some(effect) = &trial.effect else { continue };
            let name = problem.name(effect);
            let is_reported =
                before.iter().any(|old| old.candidate == name) || reported.iter().any(|new| new.name == name);
            if refitted.is_some() || !is_reported {
                reported.push(Reported { name, trial, refitted });
            }
        }
        reported
    }
}

/// The first of these fitted in full; one that leaves the arm without a pose somewhere is dropped, and the next one is fitted.
fn refit<'t, P: RegressionProblem + 't>(
    problem: &P,
    trials: impl Iterator<Item = &'t Trial<P>>,
) -> Result<Vec<Trial<P>>, P::Error> {
    let mut refitted = Vec::new();
    for trial in trials {
        refitted.extend(refitted_where_possible(problem, trial)?);
        if refitted.len() == MAX_REFITTED {
            break;
        }
    }
    Ok(refitted)
}

/// A trial fitted in full; `None` where that leaves the arm without a pose somewhere.
fn refitted_where_possible<P: RegressionProblem>(problem: &P, trial: &Trial<P>) -> Result<Option<Trial<P>>, P::Error> {
    let refitted = problem.refitted(trial).ok();
    // An error may be that the selection was given up, which is no property of the trial.
    problem.progress().check()?;
    Ok(refitted)
}

/// The first that is significant; where laws do not overlap only the best may be.
fn first_significant<P: RegressionProblem>(
    problem: &P,
    best: &Trial<P>,
    tried: &[Trial<P>],
    n_tried: usize,
) -> Option<usize> {
    let n_eligible = if problem.policy().laws_overlap { tried.len() } else { tried.len().min(1) };
    tried.iter().take(n_eligible).position(|trial| is_significant(problem, best, trial, n_tried))
}

/// Whether an effect, one of `n_tried`, predicts rows that it was not fitted to.
fn is_significant<P: RegressionProblem>(problem: &P, without: &Trial<P>, with: &Trial<P>, n_tried: usize) -> bool {
    problem.under(without).predicts_better_among(with, without, n_tried, problem.policy().discovery_level)
}

/// The best model in which one selected effect is exchanged for another, where that predicts unseen rows better.
fn exchanged<P: RegressionProblem>(problem: &P, best: &Trial<P>, n_known: usize) -> Result<Option<Trial<P>>, P::Error> {
    let (neighbours, under) = (problem.neighbours(best)?, problem.under(best));
    let mut better: Option<Trial<P>> = None;
    for effect in n_known..problem.n_effects(&best.fit) {
        let without = neighbours.with_one_less(effect)?;
        let all = problem.neighbours(&without)?.with_one_more()?.into_iter().map(Ok::<_, P::Error>);
        let Some(tried) = under.lowest(all, |trial| trial)? else { continue };
        let Some(tried) = refitted_where_possible(problem, &tried)? else { continue };
        let gain = under.gain(better.as_ref().unwrap_or(best), &tried);
        if gain > MIN_GAIN && under.predicts_better(&tried, best, RIVAL_LEVEL) {
            better = Some(tried);
        }
    }
    Ok(better)
}

/// The model without an effect that is superfluous: one that would not be selected beside those that came later; where laws
/// overlap, one that is worth nothing at all. The last one stays where it came by itself; of a law that came at `n_added`
/// places each must be worth something, by as many tests.
fn drop_one<P: RegressionProblem>(
    problem: &P,
    best: &Trial<P>,
    n_known: usize,
    n_tried: usize,
    n_added: usize,
) -> Result<Option<Trial<P>>, P::Error> {
    let n = problem.n_effects(&best.fit);
    if n < n_known + 2 {
        return Ok(None);
    }
    let neighbours = problem.neighbours(best)?;
    for dropped in n_known..n - usize::from(n_added == 1) {
        let without = neighbours.with_one_less(dropped)?;
        let level = if dropped + n_added < n { RIVAL_LEVEL } else { RIVAL_LEVEL / n_added as f64 };
        let is_missed = match problem.policy().laws_overlap {
            true => problem.under(best).predicts_better(best, &without, level),
            false => is_significant(problem, &without, best, n_tried),
        };
        if !is_missed {
            return Ok(Some(without));
        }
    }
    Ok(None)
}

/// What else explains the rows as well as one effect of the best model does, with the confidence that it is worse; `known`
/// are the candidates in its place where these have been fitted already. Some may not be significant themselves: beside a
/// weak effect they explain the rows as well.
///
/// # Errors
///
/// What the fits of `problem` fail with: a model that cannot predict its rows.
pub fn rivals<P: RegressionProblem>(
    problem: &P,
    best: &Trial<P>,
    effect: usize,
    known: Option<Vec<Trial<P>>>,
) -> Result<Vec<(Trial<P>, f64)>, P::Error> {
    let rivals = match known.filter(|known| known.len() + 1 >= MAX_REFITTED) {
        Some(rivals) => rivals,
        None => {
            let without = problem.neighbours(best)?.with_one_less(effect)?;
            let under = problem.under(&without);
            let screened = under.sorted(problem.neighbours(&without)?.with_one_more()?);
            under.sorted(refit(problem, screened.iter())?)
        }
    };
    let judged = rivals.into_iter().map(|rival| {
        let as_good = problem.under(best).reduction(&rival, best).p;
        (rival, as_good)
    });
    let level = problem.policy().rival_level;
    Ok(judged.filter(|(_, as_good)| *as_good > level).map(|(rival, p)| (rival, 1.0 - p)).collect())
}
