//! The last step of the search: fewer effects that do as well, and effects that are only the form of others.
//!
//! Columns of several effects may hold that of one other between them: friction of a joint is friction of its neighbour's
//! motor, of their sum and of their difference. A search that adds one effect at a time may come to such a set. Here each
//! effect that the model holds already in others is put in, and what then is not missed goes; the smaller model is taken
//! when the larger one does not predict unseen rows better by more than chance. Laws whose values have priors take no part:
//! their priors keep small what is not needed.
//!
//! The form of a law is not exact: friction grows a little less than with the speed, and a second law at the same place
//! takes what the first leaves. Such an effect stays in the model and is not named.

use nalgebra::{DMatrix, DVector};

use crate::select::factored::Factored;
use crate::select::problem::{Kind as _, Trial};
use crate::select::robust_fit::pseudo_inverse;
use crate::select::signals::{Channels, Fit};
use crate::select::significance::RIVAL_LEVEL;

/// Share of its information that an effect keeps beside a model which holds it already.
const HELD: f64 = 1e-2;
/// Share of what laws that go together at a place take up, below which one of them is the form of the others.
const FORM: f64 = 5e-3;
/// Correlation of their columns from which on two laws go together.
const TOGETHER: f64 = 0.5;

/// Whether a candidate has values with priors.
fn bounded(kind: &Channels, candidate: usize) -> bool {
    kind.experiment.candidates[candidate].values.iter().any(|value| value.prior.is_finite())
}

/// The better one of two models: the smaller one, unless the other predicts unseen rows better by more than chance.
pub(crate) fn better(kind: &Channels, a: Trial<Channels>, b: Trial<Channels>) -> Trial<Channels> {
    let (low, high) = if a.loss <= b.loss { (a, b) } else { (b, a) };
    let smaller = kind.n_values(&high.fit) < kind.n_values(&low.fit);
    let free = |fit: &Fit| !fit.active.iter().any(|&k| bounded(kind, k));
    if smaller && free(&low.fit) && kind.fall(&high, &low).p > RIVAL_LEVEL { high } else { low }
}

/// The model with sets of effects replaced by one that does as well; the first `n_known` stay.
pub(crate) fn simplified(kind: &Channels, mut best: Trial<Channels>, n_known: usize) -> Trial<Channels> {
    while let Some(smaller) = held(kind, &best).into_iter().find_map(|other| replaced(kind, &best, n_known, other)) {
        best = smaller;
    }
    best
}

/// The candidates that a model holds already in several of its effects together, with another law or elsewhere.
fn held(kind: &Channels, best: &Trial<Channels>) -> Vec<usize> {
    let active = &best.fit.active;
    let inside = kind.indices(active);
    let root = kind.information(&inside).cholesky();
    let candidates = &kind.experiment.candidates;
    let same =
        |a: usize, b: usize| candidates[a].law == candidates[b].law && candidates[a].place == candidates[b].place;
    let is_held = |&candidate: &usize| {
        let own = kind.indices(&[candidate]);
        let all = kind.information(&[&inside[..], &own].concat());
        let n = inside.len();
        let cross = all.view((0, n), (n, own.len())).into_owned();
        let explained = root.as_ref().map(|root| cross.tr_mul(&root.solve(&cross)));
        let left = |explained: &DMatrix<f64>| {
            (0..own.len()).all(|k| all[(n + k, n + k)] - explained[(k, k)] <= HELD * all[(n + k, n + k)])
        };
        explained.is_some_and(|explained| left(&explained))
    };
    let open = (0..candidates.len()).filter(|&k| !bounded(kind, k) && !active.iter().any(|&other| same(other, k)));
    open.filter(is_held).collect()
}

/// The model with one more effect, and without those that are not missed then; `None` where it is not smaller or worse.
fn replaced(kind: &Channels, best: &Trial<Channels>, n_known: usize, other: usize) -> Option<Trial<Channels>> {
    let mut active = best.fit.active.clone();
    active.push(other);
    let mut model = Factored::new(kind, active);
    let mut now = model.trial(kind, best.effect);
    loop {
        let own = &now.fit.active;
        let open = own[n_known..].iter().filter(|&&k| k != other);
        let tried = open.map(|&k| model.without(kind, &[k])).min_by(|a, b| a.loss.total_cmp(&b.loss));
        let Some(without) = tried.filter(|without| kind.fall(without, &now).p > RIVAL_LEVEL) else { break };
        model = Factored::new(kind, without.fit.active);
        now = model.trial(kind, best.effect);
    }
    let smaller = kind.n_values(&now.fit) < kind.n_values(&best.fit);
    (smaller && kind.fall(&now, best).p > RIVAL_LEVEL).then_some(now)
}

/// Of all effects of a model whether each is only the form of others at its place; the first `n_known` are named anyway.
///
/// What effects take up beside all others is xᵀ·C⁻¹·x of their values x with their covariance C.
pub(crate) fn forms(kind: &Channels, best: &Trial<Channels>, n_known: usize) -> Vec<bool> {
    let active = &best.fit.active;
    let candidates = &kind.experiment.candidates;
    let sizes: Vec<usize> = active.iter().map(|&k| candidates[k].values.len()).collect();
    let first = |order: usize| sizes[..order].iter().sum::<usize>();
    let indices = kind.indices(active);
    let information = kind.information(&indices);
    let inverse = pseudo_inverse(&information);
    let taken = |orders: &[usize]| {
        let at: Vec<usize> = orders.iter().flat_map(|&order| first(order)..first(order) + sizes[order]).collect();
        let values = DVector::from_iterator(at.len(), at.iter().map(|&k| best.fit.values[indices[k]]));
        let own = inverse.select_rows(&at).select_columns(&at).cholesky();
        own.map_or(0.0, |root| values.dot(&root.solve(&values)))
    };
    let place = |order: usize| &candidates[active[order]].place;
    let law = |order: usize| candidates[active[order]].law;
    let correlation = |a: usize, b: usize| information[(a, b)].powi(2) / (information[(a, a)] * information[(b, b)]);
    let together = |one: usize, other: usize| {
        let of = |order: usize| first(order)..first(order) + sizes[order];
        place(one) == place(other) && of(one).any(|a| of(other).any(|b| correlation(a, b) > TOGETHER * TOGETHER))
    };
    let is_form = |order: usize| {
        let here: Vec<usize> = (0..active.len()).filter(|&other| together(order, other)).collect();
        // One law in several shapes is one effect.
        let of_law = |named: usize| {
            let own: Vec<usize> = here.iter().copied().filter(|&other| law(other) == law(named)).collect();
            taken(&own)
        };
        // Where none takes up much beside the others the largest of them is named.
        let own = of_law(order);
        let is_less = here.iter().any(|&other| law(other) != law(order) && of_law(other) > own);
        !bounded(kind, active[order]) && is_less && own < FORM * taken(&here)
    };
    (0..active.len()).map(|order| order >= n_known && is_form(order)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linearise::experiment::{Axis, Candidate, Experiment, Row};
    use crate::prepare::groups::Groups;

    const ROWS: usize = 600;

    /// A law, its place, and what it adds on both joints at their speeds.
    type Added<'a> = (&'static str, &'a str, &'a dyn Fn([f64; 2]) -> [f64; 2]);

    /// Two joints whose speeds wave, candidates, and a residual.
    fn channels(candidates: &[Added<'_>], residual: impl Fn([f64; 2]) -> [f64; 2]) -> Channels {
        let speeds = |k: usize| [(k as f64 * 0.11).sin(), (k as f64 * 0.07 + 1.0).cos()];
        let noise = |k: usize| 0.02 * ((k * 7919 % 1013) as f64 / 1013.0 - 0.5);
        let column = |of: &dyn Fn([f64; 2]) -> [f64; 2]| (0..ROWS).flat_map(|k| of(speeds(k))).collect::<Vec<f64>>();
        let row = |k: usize| Row { line: k, time_s: k as f64, series: 0, motion: 0, key: None, held_out: false };
        let all = candidates.iter().map(|(law, place, of)| Candidate::one(law, place, ("size", "N·m"), column(of)));
        let residuals: Vec<f64> = column(&residual).iter().enumerate().map(|(k, r)| noise(k) - r).collect();
        let experiment = Experiment {
            kind: "joint-torque",
            axes: ["1", "2"].map(|name| Axis::new(name, "N·m")).into(),
            n_norm: 2,
            rows: (0..ROWS).map(row).collect(),
            residuals,
            candidates: all.collect(),
            channels: Vec::new(),
            masses: Vec::new(),
            relinearise: None,
        };
        let groups = Groups::new(&experiment.rows);
        Channels::new(experiment, groups)
    }

    #[test]
    fn three_effects_that_hold_one_other_give_it_their_place() {
        let mut kind = channels(
            &[
                ("friction", "1", &|[v, _]| [v, 0.0]),
                ("friction", "2", &|[_, w]| [0.0, w]),
                ("friction", "both", &|[v, w]| [v + w, v + w]),
                ("friction", "difference", &|[v, w]| [v - w, w - v]),
            ],
            |[v, _]| [0.8 * v, 0.0],
        );
        let Ok(model) = kind.settled(kind.start(vec![1, 2, 3]));
        assert_eq!(simplified(&kind, model.clone(), 0).fit.active, [0]);
        // What is known stays, and with it nothing smaller is left.
        assert_eq!(simplified(&kind, model, 3).fit.active, [1, 2, 3]);
    }

    #[test]
    fn what_the_form_of_a_law_leaves_is_not_told_from_it() {
        let laws: [Added<'_>; 3] = [
            ("viscous", "1", &|[v, _]| [v, 0.0]),
            ("dry", "1", &|[v, _]| [(v / 0.05).tanh(), 0.0]),
            ("dry", "2", &|[_, w]| [0.0, (w / 0.05).tanh()]),
        ];
        let told = |residual: &dyn Fn([f64; 2]) -> [f64; 2]| {
            let mut kind = channels(&laws, residual);
            let Ok(model) = kind.settled(kind.start(vec![0, 1, 2]));
            forms(&kind, &model, 0)
        };
        assert_eq!(told(&|[v, w]| [v / (1.0 + 0.1 * v.abs()), 0.05 * (w / 0.05).tanh()]), [false, true, false]);
        assert_eq!(told(&|[v, w]| [v + 0.5 * (v / 0.05).tanh(), 0.05 * w.signum()]), [false, false, false]);
    }

    #[test]
    fn of_laws_that_are_each_others_form_one_is_named() {
        let laws: [Added<'_>; 2] =
            [("viscous", "1", &|[v, _]| [v, 0.0]), ("dry", "1", &|[v, _]| [v / (1.0 + 0.05 * v.abs()), 0.0])];
        let mut kind = channels(&laws, |[v, _]| [v + 0.5 * v / (1.0 + 0.05 * v.abs()), 0.0]);
        let Ok(model) = kind.settled(kind.start(vec![0, 1]));
        assert_eq!(forms(&kind, &model, 0).iter().filter(|is_form| **is_form).count(), 1);
    }
}
