//! Simplification: fewer effects that do as well, and effects that are only surrogates of others.
//!
//! Columns of several effects may span that of one other: friction of a joint is friction of its neighbour's motor, of their
//! sum and of their difference. A selection that adds one effect at a time may come to such a set. Here each effect whose
//! column the model spans already is put in, and what then is not missed goes; the smaller model is taken when the larger
//! one does not predict unseen rows better by more than chance. Laws whose values have priors take no part: their priors
//! keep small what is not needed. Of few effects the same is tried with all that would do as well in the place of one.
//!
//! The shape of a law is not exact: friction grows a little less than with the speed, and a second law at the same place
//! takes what the first leaves. Such an effect, a surrogate, stays in the model and is not named.

use std::ops::Range;

use nalgebra::{Cholesky, DVector, Dyn};

use super::factored::{Factored, judged};
use super::{SignalFit, Signals};
use crate::effect::Place;
use crate::least_squares::pseudo_inverse;
use crate::progress::Cancelled;
use crate::select::forward::rivals;
use crate::select::problem::{RegressionProblem as _, Trial, Weighted};
use crate::select::significance::RIVAL_LEVEL;

/// Share of its information that an effect keeps beside a model which spans it.
const SPANNED: f64 = 1e-2;
/// Share of what laws that go together at a place take up, below which one of them is a surrogate of the others.
const SURROGATE: f64 = 5e-3;
/// Effects up to which each is compared with all others that could be in its place.
pub(crate) const MAX_COMPARED: usize = 6;
/// Correlation of their columns from which on two laws go together.
const TOGETHER: f64 = 0.5;

/// The better one of two models: the smaller one, unless the other predicts unseen rows better by more than chance.
pub(super) fn simpler_of<'t>(problem: &Signals, a: &'t Trial<Signals>, b: &'t Trial<Signals>) -> &'t Trial<Signals> {
    let under = problem.under(a);
    let (low, high) = if under.is_lower(b, a) { (b, a) } else { (a, b) };
    let is_smaller = problem.n_values(&high.fit) < problem.n_values(&low.fit);
    let is_free = |fit: &SignalFit| !fit.active.iter().any(|&k| problem.experiment.candidates[k].has_prior());
    if is_smaller && is_free(&low.fit) && !under.predicts_better(low, high, RIVAL_LEVEL) { high } else { low }
}

/// A model that takes the place of another; `None` where none does.
type Replacement = Result<Option<Trial<Signals>>, Cancelled>;

/// The model with sets of effects replaced by one that does as well; the first `n_known` stay.
pub(super) fn simplified(
    problem: &Signals,
    mut best: Trial<Signals>,
    n_known: usize,
) -> Result<Trial<Signals>, Cancelled> {
    while let Some(next) = smaller(problem, &best, n_known)? {
        best = next;
    }
    Ok(best)
}

/// A smaller model that does as well.
fn smaller(problem: &Signals, best: &Trial<Signals>, n_known: usize) -> Replacement {
    for other in spanned_by_active(problem, best)? {
        if let Some(smaller) = replaced(problem, best, n_known, other)? {
            return Ok(Some(smaller));
        }
    }
    for order in few_effects(best, n_known) {
        for (other, ..) in single_rivals(problem, best, order)? {
            if !best.fit.active.contains(&other)
                && let Some(smaller) = replaced(problem, best, n_known, other)?
            {
                return Ok(Some(smaller));
            }
        }
    }
    uncoupled(problem, best, n_known)
}

/// Replaces a law at the sum and at the difference of two joints by that law at each of the two joints, where the model then
/// predicts unseen rows as well.
fn uncoupled(problem: &Signals, best: &Trial<Signals>, n_known: usize) -> Replacement {
    let mut sums = n_known..best.fit.active.len();
    sums.find_map(|sum| uncoupled_at(problem, best, n_known, sum).transpose()).transpose()
}

/// Does what [`uncoupled`] does for one effect at a sum: that with the number `sum` in the model.
fn uncoupled_at(problem: &Signals, best: &Trial<Signals>, n_known: usize, sum: usize) -> Replacement {
    let (candidates, active, under) = (&problem.experiment.candidates, &best.fit.active, problem.under(best));
    let own = &candidates[active[sum]];
    let Place::JointWithLast(joint) = own.site.place else { return Ok(None) };
    let at = |place: Place| {
        (0..candidates.len()).filter(move |&k| candidates[k].law == own.law && candidates[k].site.place == place)
    };
    let difference = at(Place::JointAgainstLast(joint)).find_map(|k| active.iter().position(|&own| own == k));
    let Some(difference) = difference else { return Ok(None) };
    let pairs = at(Place::Joint(joint - 1)).flat_map(|a| at(Place::Joint(joint)).map(move |b| [a, b]));
    let open = pairs.filter(|pair| pair.iter().all(|own| !active.contains(own)));
    let trials = open.map(|[a, b]| {
        let mut active = active.clone();
        (active[sum], active[difference]) = (a, b);
        judged(under, active, None)
    });
    let lowest = under.lowest(trials, |trial| trial)?;
    let is_as_good = |lowest: &Trial<Signals>| !under.predicts_better(best, lowest, RIVAL_LEVEL);
    Ok(lowest.filter(|lowest| difference >= n_known && is_as_good(lowest)))
}

/// The candidates that a model spans already with several of its effects together, with another law or elsewhere.
fn spanned_by_active(problem: &Signals, best: &Trial<Signals>) -> Result<Vec<usize>, Cancelled> {
    let (weighted, active) = (problem.under(best), &best.fit.active);
    let inside = problem.indices(active);
    let root = weighted.information(&inside).cholesky();
    let candidates = &problem.experiment.candidates;
    let Some(root) = root else { return Ok(Vec::new()) };
    let is_open = |&k: &usize| {
        !candidates[k].has_prior() && !active.iter().any(|&other| candidates[other].is_same(&candidates[k]))
    };
    let mut spanned = Vec::new();
    for candidate in (0..candidates.len()).filter(is_open) {
        problem.progress.check()?;
        if spans(&weighted, &inside, &root, candidate) {
            spanned.push(candidate);
        }
    }
    Ok(spanned)
}

/// The effects that are compared with what would do as well in their place: all, where a model has several, but few.
fn few_effects(best: &Trial<Signals>, n_known: usize) -> Range<usize> {
    let n = best.fit.active.len();
    if (2..=MAX_COMPARED).contains(&(n - n_known)) { n_known..n } else { n..n }
}

/// Single candidates that do as well in the place of an effect, each with its model and the confidence that it is worse.
///
/// # Errors
///
/// The diagnosis was given up.
pub(crate) fn single_rivals(
    problem: &Signals,
    best: &Trial<Signals>,
    order: usize,
) -> Result<impl Iterator<Item = (usize, Trial<Signals>, f64)>, Cancelled> {
    let rivals = rivals(problem, best, order, None)?;
    Ok(rivals.into_iter().filter_map(|(rival, worse_with)| match *problem.candidates_of(rival.effect?) {
        [one] => Some((one, rival, worse_with)),
        _ => None,
    }))
}

/// Whether the values `inside`, with the root of their information, explain those of a candidate.
fn spans(weighted: &Weighted<Signals>, inside: &[usize], root: &Cholesky<f64, Dyn>, candidate: usize) -> bool {
    let own = weighted.problem.indices(&[candidate]);
    let all = weighted.information(&[inside, &own].concat());
    let n = inside.len();
    let cross = all.view((0, n), (n, own.len())).into_owned();
    let explained = cross.tr_mul(&root.solve(&cross));
    (0..own.len()).all(|k| all[(n + k, n + k)] - explained[(k, k)] <= SPANNED * all[(n + k, n + k)])
}

/// The model with one more effect, and without those that are not missed then; `None` where it is not smaller or worse.
fn replaced(problem: &Signals, best: &Trial<Signals>, n_known: usize, other: usize) -> Replacement {
    let (weighted, mut active) = (problem.under(best), best.fit.active.clone());
    active.push(other);
    let mut model = Factored::new(weighted, active)?;
    let mut now = model.trial(best.effect);
    loop {
        let own = &now.fit.active;
        let open = own[n_known..].iter().filter(|&&k| k != other);
        let tried = weighted.lowest(open.map(|&k| model.without(&[k])), |trial| trial)?;
        let Some(without) = tried.filter(|without| !weighted.predicts_better(&now, without, RIVAL_LEVEL)) else {
            break;
        };
        model = Factored::new(weighted, without.fit.active)?;
        now = model.trial(best.effect);
    }
    let now = problem.refitted(&now)?;
    let is_smaller = problem.n_values(&now.fit) < problem.n_values(&best.fit);
    Ok((is_smaller && !weighted.predicts_better(best, &now, RIVAL_LEVEL)).then_some(now))
}

/// Of all effects of a model whether each is only a surrogate of others at its place; the first `n_known` are named anyway.
///
/// What effects take up beside all others is xᵀ·C⁻¹·x of their values x with their covariance C.
pub(crate) fn surrogates(problem: &Signals, best: &Trial<Signals>, n_known: usize) -> Vec<bool> {
    let active = &best.fit.active;
    let candidates = &problem.experiment.candidates;
    let sizes: Vec<usize> = active.iter().map(|&k| candidates[k].values.len()).collect();
    let first = |order: usize| sizes[..order].iter().sum::<usize>();
    let indices = problem.indices(active);
    let information = problem.under(best).information(&indices);
    let inverse = pseudo_inverse(&information);
    let taken = |orders: &[usize]| {
        let at: Vec<usize> = orders.iter().flat_map(|&order| first(order)..first(order) + sizes[order]).collect();
        let values = DVector::from_iterator(at.len(), at.iter().map(|&k| best.fit.values[indices[k]]));
        let own = inverse.select_rows(&at).select_columns(&at).cholesky();
        own.map_or(0.0, |root| values.dot(&root.solve(&values)))
    };
    let candidate = |order: usize| &candidates[active[order]];
    let correlation = |a: usize, b: usize| information[(a, b)].powi(2) / (information[(a, a)] * information[(b, b)]);
    let together = |one: usize, other: usize| {
        let of = |order: usize| first(order)..first(order) + sizes[order];
        let correlated = of(one).any(|a| of(other).any(|b| correlation(a, b) > TOGETHER * TOGETHER));
        candidate(one).site == candidate(other).site && correlated
    };
    let law = |order: usize| candidate(order).law;
    // One law in several shapes is one effect.
    let of_law = |here: &[usize], named: usize| {
        let own: Vec<usize> = here.iter().copied().filter(|&other| law(other) == law(named)).collect();
        taken(&own)
    };
    // Where none takes up much beside the others the largest of them is named.
    let is_surrogate = |order: usize| {
        let here: Vec<usize> = (0..active.len()).filter(|&other| together(order, other)).collect();
        let own = of_law(&here, order);
        let is_less = here.iter().any(|&other| law(other) != law(order) && of_law(&here, other) > own);
        !candidate(order).has_prior() && is_less && own < SURROGATE * taken(&here)
    };
    (0..active.len()).map(|order| order >= n_known && is_surrogate(order)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{LawName, Site};
    use crate::linearise::experiment::{Axis, Candidate, Curvature, Experiment};
    use crate::measured::Measured;
    use crate::prepare::groups::Groups;
    use crate::prepare::groups::SignalRow;

    const ROWS: usize = 600;

    /// A law, its place, and what it adds on both joints at their speeds.
    type Added<'a> = (LawName, Place, &'a dyn Fn([f64; 2]) -> [f64; 2]);

    /// Two joints whose speeds wave, candidates, and a residual.
    fn signals(candidates: &[Added<'_>], residual: impl Fn([f64; 2]) -> [f64; 2]) -> Signals {
        let speeds = |k: usize| [(k as f64 * 0.11).sin(), (k as f64 * 0.07 + 1.0).cos()];
        let noise = |k: usize| 0.02 * ((k * 7919 % 1013) as f64 / 1013.0 - 0.5);
        let column = |of: &dyn Fn([f64; 2]) -> [f64; 2]| (0..ROWS).flat_map(|k| of(speeds(k))).collect::<Vec<f64>>();
        let row = |k: usize| SignalRow { line: k, time_s: k as f64, series: 0, motion: 0, key: None, held_out: false };
        let all = candidates
            .iter()
            .map(|(law, place, of)| Candidate::one(*law, Site::new(*place, "here"), ("size", "N·m"), column(of)));
        let residuals: Vec<f64> = column(&residual).iter().enumerate().map(|(k, r)| noise(k) - r).collect();
        let experiment = Experiment {
            kind: Measured::JointTorque,
            axes: ["1", "2"].map(|name| Axis::new(name, "N·m")).into(),
            n_norm: 2,
            rows: (0..ROWS).map(row).collect(),
            residuals,
            measured: None,
            candidates: all.collect(),
            channels: Vec::new(),
            bodies: Vec::new(),
            findings: Vec::new(),
            curvature: Curvature::None,
        };
        let groups = Groups::new(&experiment.rows);
        Signals::new(experiment, groups)
    }

    #[test]
    fn three_effects_that_span_one_other_are_replaced_by_it() {
        let problem = signals(
            &[
                (LawName::ViscousFriction, Place::Joint(0), &|[v, _]| [v, 0.0]),
                (LawName::ViscousFriction, Place::Joint(1), &|[_, w]| [0.0, w]),
                (LawName::ViscousFriction, Place::JointWithLast(1), &|[v, w]| [v + w, v + w]),
                (LawName::ViscousFriction, Place::JointAgainstLast(1), &|[v, w]| [v - w, w - v]),
            ],
            |[v, _]| [0.8 * v, 0.0],
        );
        let model = problem.fitted(vec![1, 2, 3]).unwrap();
        assert_eq!(simplified(&problem, model.clone(), 0).unwrap().fit.active, [0]);
        // What is known stays, and with it nothing smaller is left.
        assert_eq!(simplified(&problem, model, 3).unwrap().fit.active, [1, 2, 3]);
    }

    #[test]
    fn effects_of_two_joints_are_no_sum_and_difference() {
        let problem = signals(
            &[
                (LawName::ViscousFriction, Place::Joint(0), &|[v, _]| [v, 0.0]),
                (LawName::ViscousFriction, Place::Joint(1), &|[_, w]| [0.0, w]),
                (LawName::ViscousFriction, Place::JointWithLast(1), &|[v, w]| [v + w, v + w]),
                (LawName::ViscousFriction, Place::JointAgainstLast(1), &|[v, w]| [v - w, w - v]),
            ],
            |[v, w]| [0.8 * v, 0.8 * w],
        );
        let mut active = simplified(&problem, problem.fitted(vec![2, 3]).unwrap(), 0).unwrap().fit.active;
        active.sort_unstable();
        assert_eq!(active, [0, 1]);
    }

    #[test]
    fn what_an_inexact_shape_leaves_is_a_surrogate() {
        let laws: [Added<'_>; 3] = [
            (LawName::ViscousFriction, Place::Joint(0), &|[v, _]| [v, 0.0]),
            (LawName::CoulombFriction, Place::Joint(0), &|[v, _]| [(v / 0.05).tanh(), 0.0]),
            (LawName::CoulombFriction, Place::Joint(1), &|[_, w]| [0.0, (w / 0.05).tanh()]),
        ];
        let are_surrogates = |residual: &dyn Fn([f64; 2]) -> [f64; 2]| {
            let problem = signals(&laws, residual);
            let model = problem.fitted(vec![0, 1, 2]).unwrap();
            surrogates(&problem, &model, 0)
        };
        assert_eq!(
            are_surrogates(&|[v, w]| [v / (1.0 + 0.1 * v.abs()), 0.05 * (w / 0.05).tanh()]),
            [false, true, false]
        );
        assert_eq!(are_surrogates(&|[v, w]| [v + 0.5 * (v / 0.05).tanh(), 0.05 * w.signum()]), [false, false, false]);
    }

    #[test]
    fn of_laws_that_are_surrogates_of_each_other_one_is_named() {
        let laws: [Added<'_>; 2] = [
            (LawName::ViscousFriction, Place::Joint(0), &|[v, _]| [v, 0.0]),
            (LawName::CoulombFriction, Place::Joint(0), &|[v, _]| [v / (1.0 + 0.05 * v.abs()), 0.0]),
        ];
        let problem = signals(&laws, |[v, _]| [v + 0.5 * v / (1.0 + 0.05 * v.abs()), 0.0]);
        let model = problem.fitted(vec![0, 1]).unwrap();
        assert_eq!(surrogates(&problem, &model, 0).iter().filter(|is_surrogate| **is_surrogate).count(), 1);
    }
}
