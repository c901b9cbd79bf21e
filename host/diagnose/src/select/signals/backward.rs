//! Backward elimination: from a model with every law at every place, what is not missed is taken away.
//!
//! Laws that only help together (an offset, an area and a friction, say) are never found one at a time. Here each law
//! acts at each of its places once, in the shape that predicts unseen rows best, and goes when those rows do not miss
//! it. Of m effects out of n that were tried each must be missed with a chance of at most `FALSE_SHARE`·m/n, so that
//! this share of what is named is false (Y. Benjamini, Y. Hochberg, J. R. Statist. Soc. B 57 (1995) 289).
//!
//! Where all values are small errors with priors (point contact), these keep small what is not needed, and laws share their
//! work, so that none of them is missed alone: there every law stays at all its places, unless a few effects do as well.
//! Those places are named whose values differ from zero, at the same share of false ones.

use rayon::prelude::{IntoParallelRefIterator as _, ParallelIterator as _};

use super::Signals;
use super::factored::{Factored, judged};
use crate::effect::LawName;
use crate::progress::Cancelled;
use crate::select::forward::SelectionStep;
use crate::select::problem::{RegressionProblem as _, Trial};
use crate::select::significance::DISCOVERY_LEVEL;

/// A model that was selected, and what was tried.
pub(super) type Selected = Result<(Trial<Signals>, Vec<SelectionStep>), Cancelled>;

/// Share of the effects named that may be false.
pub(crate) const FALSE_SHARE: f64 = 0.05;
/// Times that all effects left are looked at.
const SWEEPS: usize = 8;

/// The model that is left, and what went and what stayed; the first candidates of `start` always stay.
pub(super) fn backward_elimination(problem: &Signals, start: &Trial<Signals>) -> Selected {
    let known = start.fit.active.clone();
    let full = problem.fitted(every_law(problem, &known))?;
    let shaped = best_shapes(problem, full, known.len())?;
    let (best, path) = eliminate(problem, shaped, known.len())?;
    or_empty(problem, known, best, path)
}

/// What elimination leaves of a model, and what went and what stayed; the first `n_known` always stay.
pub(super) fn eliminate(problem: &Signals, mut best: Trial<Signals>, n_known: usize) -> Selected {
    let n_tried = every_law(problem, &best.fit.active[..n_known]).len() - n_known;
    let mut path = Vec::new();
    for _ in 0..SWEEPS {
        let reweighted = problem.reweight_until_converged(best)?;
        let n_before = reweighted.fit.active.len();
        (best, path) = sweep(problem, reweighted, n_known, n_tried)?;
        if best.fit.active.len() == n_before {
            break;
        }
    }
    Ok((best, path))
}

/// The model with every law at every place, and what each law gives.
pub(super) fn all_laws(problem: &Signals, start: &Trial<Signals>) -> Selected {
    let known = start.fit.active.clone();
    let best = problem.fitted(every_law(problem, &known))?;
    let path = {
        let model = Factored::new(problem.under(&best), best.fit.active.clone())?;
        let law = |k: usize| problem.experiment.candidates[k].law;
        let mut laws: Vec<(LawName, Vec<usize>)> = Vec::new();
        for &k in &best.fit.active[known.len()..] {
            match laws.iter_mut().find(|(own, _)| *own == law(k)) {
                Some((_, places)) => places.push(k),
                None => laws.push((law(k), vec![k])),
            }
        }
        let step =
            |(_, places): &(LawName, Vec<usize>)| Ok(step(problem, places, &best, &model.without(places)?, true));
        laws.iter().map(step).collect::<Result<_, Cancelled>>()?
    };
    or_empty(problem, known, best, path)
}

/// A model and its path; the model without any effect, and no path, where all effects do not help together.
fn or_empty(problem: &Signals, known: Vec<usize>, best: Trial<Signals>, path: Vec<SelectionStep>) -> Selected {
    let empty = judged(problem.under(&best), known, None)?;
    let is_better = problem.under(&best).predicts_better(&best, &empty, DISCOVERY_LEVEL);
    Ok(if is_better { (best, path) } else { (empty, Vec::new()) })
}

/// The candidates `known`, and for every other law at every place one candidate, that with the middle one of the shapes. What
/// all joints have in common is left out: it is the sum of what each joint has.
pub(crate) fn every_law(problem: &Signals, known: &[usize]) -> Vec<usize> {
    let candidates = &problem.experiment.candidates;
    let mut active = known.to_vec();
    for k in 0..candidates.len() {
        let is_in = active.iter().any(|&other| candidates[other].is_same(&candidates[k]));
        if !is_in && !candidates[k].is_common() {
            let shapes: Vec<usize> =
                (k..candidates.len()).filter(|&other| candidates[other].is_same(&candidates[k])).collect();
            active.push(shapes[shapes.len() / 2]);
        }
    }
    active
}

/// Gives each law of a model the shape that predicts unseen rows best, one law after the other. A law has one shape at all its
/// places; the first `n_known` candidates keep theirs.
fn best_shapes(problem: &Signals, mut best: Trial<Signals>, n_known: usize) -> Result<Trial<Signals>, Cancelled> {
    let candidates = &problem.experiment.candidates;
    let families = problem.moves().map(|family| problem.candidates_of(family));
    for family in families.filter(|family| candidates[family[0]].shape.is_some()) {
        let other = |(position, k): (usize, &usize)| {
            let shape = family.iter().find(|&&other| candidates[other].is_same(&candidates[*k]));
            *shape.filter(|_| position >= n_known).unwrap_or(k)
        };
        let active: Vec<usize> = best.fit.active.iter().enumerate().map(other).collect();
        if active != best.fit.active {
            let trial = judged(problem.under(&best), active, None)?;
            if problem.under(&best).is_lower(&trial, &best) {
                best = trial;
            }
        }
    }
    Ok(best)
}

/// What the rows say of effects that the best model has.
fn step(
    problem: &Signals,
    effects: &[usize],
    best: &Trial<Signals>,
    without: &Trial<Signals>,
    kept: bool,
) -> SelectionStep {
    SelectionStep {
        step: 0,
        candidate: problem.name_of(effects),
        values: problem.indices(effects).len(),
        cross_validated: best.error,
        without: without.error,
        p: problem.under(best).reduction(without, best).p,
        refined: true,
        kept,
    }
}

/// Looks at every effect once, the least missed first, and takes away what is not missed.
fn sweep(problem: &Signals, start: Trial<Signals>, n_known: usize, n_tried: usize) -> Selected {
    let under = problem.under(&start);
    let mut model = Factored::new(under, start.fit.active.clone())?;
    let mut n_left = start.fit.active.len() - n_known;
    let missed = |&k: &usize| Ok((k, under.gain(&model.without(&[k])?, &start)));
    let order = start.fit.active[n_known..].par_iter().map(missed);
    let mut order = order.collect::<Result<Vec<(usize, f64)>, Cancelled>>()?;
    order.sort_by(|(_, a), (_, b)| a.total_cmp(b));
    let (mut best, mut path) = (start.clone(), Vec::new());
    for (effect, _) in order {
        problem.progress.add_tried(1);
        let without = model.without(&[effect])?;
        let kept = under.predicts_better(&best, &without, FALSE_SHARE * n_left as f64 / n_tried as f64);
        path.push(step(problem, &[effect], &best, &without, kept));
        if !kept {
            best = without;
            n_left -= 1;
            model = Factored::new(under, best.fit.active.clone())?;
        }
    }
    Ok((best, path))
}
