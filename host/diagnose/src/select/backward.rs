//! The second way of the search: from a model with every law at every place, what is not missed is taken away.
//!
//! Laws that only help together (an offset, an area and a friction, say) are never found one at a time. Here each law
//! stands at each of its places once, in the shape that predicts unseen rows best, and goes when those rows do not miss
//! it. Of m effects out of n that were tried each must be missed with a chance of at most [`FALSE_SHARE`]·m/n, so that
//! this share of what is named is false (Y. Benjamini, Y. Hochberg, J. R. Statist. Soc. B 57 (1995) 289).
//!
//! Where all values are small errors with priors (closure), these keep small what is not needed, and laws share their work, so
//! that none of them is missed alone: there every law stays at all its places, unless a few effects do as well. Those places
//! are named at which it differs from nothing, as many as leave this share of false ones.

use rayon::prelude::{IntoParallelRefIterator as _, ParallelIterator as _};

use crate::outcome::Rung;
use crate::select::factored::Factored;
use crate::select::problem::{Kind as _, Trial};
use crate::select::signals::Channels;
use crate::select::significance::DISCOVERY_LEVEL;

/// Share of the effects named that may be false.
pub(crate) const FALSE_SHARE: f64 = 0.05;
/// Times that all effects left are looked at.
const SWEEPS: usize = 8;

/// The model that is left, and what went and what stayed; the first `n_known` candidates of `start` always stay.
pub(crate) fn thinned(kind: &mut Channels, start: &Trial<Channels>) -> (Trial<Channels>, Vec<Rung>) {
    let known = start.fit.active.clone();
    let Ok(_) = kind.settled(start.clone());
    let Ok(full) = kind.settled(kind.start(full(kind, &known)));
    let shaped = shaped(kind, full, known.len());
    let n_tried = shaped.fit.active.len() - known.len();
    let (mut best, mut ladder) = (shaped, Vec::new());
    for _ in 0..SWEEPS {
        let Ok(settled) = kind.settled(best);
        best = settled;
        let n_before = best.fit.active.len();
        ladder = sweep(kind, &mut best, known.len(), n_tried);
        if best.fit.active.len() == n_before {
            break;
        }
    }
    let empty = kind.judged(known, None);
    if kind.fall(&empty, &best).p < DISCOVERY_LEVEL { (best, ladder) } else { (empty, Vec::new()) }
}

/// One candidate for each law at each place, the middle one of its shapes, after those that are known.
fn full(kind: &Channels, known: &[usize]) -> Vec<usize> {
    let candidates = &kind.experiment.candidates;
    let same =
        |a: usize, b: usize| candidates[a].law == candidates[b].law && candidates[a].place == candidates[b].place;
    let mut active = known.to_vec();
    for k in 0..candidates.len() {
        if !active.iter().any(|&other| same(other, k)) {
            let shapes: Vec<usize> = (k..candidates.len()).filter(|&other| same(other, k)).collect();
            active.push(shapes[shapes.len() / 2]);
        }
    }
    active
}

/// The same with the shapes that predict best, one law after the other, all its places alike.
fn shaped(kind: &Channels, mut best: Trial<Channels>, n_known: usize) -> Trial<Channels> {
    let candidates = &kind.experiment.candidates;
    for family in kind.moves.iter().filter(|family| candidates[family[0]].shape.is_some()) {
        let place = |&k: &usize| (candidates[k].law, &candidates[k].place);
        let other = |(position, k): (usize, &usize)| {
            let shape = family.iter().find(|other| place(other) == place(k)).filter(|_| position >= n_known);
            *shape.unwrap_or(k)
        };
        let active: Vec<usize> = best.fit.active.iter().enumerate().map(other).collect();
        if active != best.fit.active {
            let trial = kind.judged(active, None);
            if trial.loss < best.loss {
                best = trial;
            }
        }
    }
    best
}

/// The model with every law at every place, and what each law gives; without any where they do not help together.
pub(crate) fn whole(kind: &mut Channels, start: &Trial<Channels>) -> (Trial<Channels>, Vec<Rung>) {
    let known = start.fit.active.clone();
    let Ok(best) = kind.settled(kind.start(full(kind, &known)));
    let model = Factored::new(kind, best.fit.active.clone());
    let mut laws: Vec<Vec<usize>> = Vec::new();
    for &k in &best.fit.active[known.len()..] {
        let law = |k: usize| kind.experiment.candidates[k].law;
        match laws.iter_mut().find(|places| law(places[0]) == law(k)) {
            Some(places) => places.push(k),
            None => laws.push(vec![k]),
        }
    }
    let rung = |places: &Vec<usize>| rung(kind, places, &best, &model.without(kind, places), true);
    let ladder = laws.iter().map(rung).collect();
    let empty = kind.judged(known, None);
    if kind.fall(&empty, &best).p < DISCOVERY_LEVEL { (best, ladder) } else { (empty, Vec::new()) }
}

/// What the rows say of effects that the best model has.
fn rung(kind: &Channels, effects: &[usize], best: &Trial<Channels>, without: &Trial<Channels>, kept: bool) -> Rung {
    let (law, place) = kind.name(&effects[0]);
    Rung {
        step: 0,
        law,
        place: if effects.len() > 1 { format!("{} places", effects.len()) } else { place },
        values: kind.indices(effects).len(),
        cross_validated: best.error,
        without: without.error,
        p: kind.fall(without, best).p,
        refined: true,
        kept,
    }
}

/// Looks at every effect once, the least missed first, and takes away what is not missed.
fn sweep(kind: &Channels, best: &mut Trial<Channels>, n_known: usize, n_tried: usize) -> Vec<Rung> {
    let mut model = Factored::new(kind, best.fit.active.clone());
    let mut n_left = best.fit.active.len() - n_known;
    let loss = |&k: &usize| (model.without(kind, &[k]).loss, k);
    let mut order: Vec<(f64, usize)> = best.fit.active[n_known..].par_iter().map(loss).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut ladder = Vec::new();
    for (_, effect) in order {
        let without = model.without(kind, &[effect]);
        let kept = kind.fall(&without, best).p <= FALSE_SHARE * n_left as f64 / n_tried as f64;
        ladder.push(rung(kind, &[effect], best, &without, kept));
        if !kept {
            *best = without;
            n_left -= 1;
            model = Factored::new(kind, best.fit.active.clone());
        }
    }
    ladder
}
