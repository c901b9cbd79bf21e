//! What remains when no law helps any more: terms of a dictionary over the channels that still predict unseen rows.
//!
//! The dictionary holds each channel c, c², |c|, sign(c), waves with up to [`WAVES`] periods in its range and, of few
//! channels, their products; those that go with the residual of an axis most are candidates of the same search, which adds
//! one at a time while the gain is no chance.

use std::f64::consts::TAU;

use super::experiment::{Axis, Candidate, Experiment};
use super::linear::Channels;
use super::outcome::Term;
use crate::diagnose::kind::Trial;
use crate::diagnose::search::Search;

/// Channels up to which their products are tried.
const FEW: usize = 6;
/// Columns that are tried at most, all axes together.
const MOST_COLUMNS: usize = 120;
/// Periods of a wave in the range of its channel.
const WAVES: usize = 8;
/// Correlation of neighbouring rows from which on a residual is no noise, and how many pairs tell it at least.
const GOES_ON: f64 = 0.5;
const LEAST_PAIRS: f64 = 100.0;
/// A residual counts as so many times the noise at most.
const FAR: f64 = 4.0;

/// The terms that help, with the share of the remaining mean square that each takes up, of rows it was not fitted to.
pub(super) fn terms(kind: &Channels, best: &Trial<Channels>) -> Vec<Term> {
    let experiment = &kind.experiment;
    let residuals = experiment.at(&best.fit.values);
    let candidates = dictionary(experiment, &residuals);
    if candidates.is_empty() {
        return Vec::new();
    }
    let left = Experiment {
        kind: experiment.kind,
        axes: experiment.axes.clone(),
        n_norm: experiment.n_norm,
        rows: experiment.rows.clone(),
        residuals,
        candidates,
        channels: Vec::new(),
        masses: Vec::new(),
        relinearise: None,
    };
    let n_terms = left.candidates.len();
    let mut search = Search::new(Channels::new(left, kind.groups.clone()));
    search.kind.moves.truncate(n_terms);
    let start = search.kind.start(Vec::new());
    let Ok((found, _)) = search.run(start);
    let kept = search.ladder.iter().filter(|rung| rung.kept);
    let share = |rung: &crate::diagnose::outcome::Rung| {
        1.0 - (rung.cross_validated / rung.without.max(f64::MIN_POSITIVE)).powi(2)
    };
    let still = |place: &str| found.fit.active.iter().any(|k| search.kind.experiment.candidates[*k].place == place);
    let term = |rung: &crate::diagnose::outcome::Rung| {
        let (axis, term) = rung.place.split_once(": ").unwrap_or(("", &rung.place));
        Term { axis: axis.into(), term: term.into(), share: share(rung) }
    };
    kept.filter(|rung| still(&rung.place)).map(term).collect()
}

/// Axes whose residual goes on from row to row as noise does not, where no effect and no term was found: something is
/// missing, of a shape that is not in the dictionary. The share is that of the mean square which the row before foretells.
pub(super) fn memory(kind: &Channels, best: &Trial<Channels>) -> Vec<Term> {
    let (rows, n_axes) = (&kind.experiment.rows, kind.sigma.len());
    let residuals = kind.training_residuals(&best.fit);
    let of_axis = |(axis, of): (usize, &Axis)| {
        let own: Vec<f64> =
            residuals.iter().skip(axis).step_by(n_axes).map(|residual| residual.clamp(-FAR, FAR)).collect();
        let training = kind.groups.training.windows(2).zip(own.windows(2));
        let pairs = training.filter(|(at, _)| at[1] == at[0] + 1 && rows[at[0]].series == rows[at[1]].series);
        let [both, before, after, count] = pairs.fold([0.0; 4], |[both, before, after, count], (_, r)| {
            [both + r[0] * r[1], before + r[0] * r[0], after + r[1] * r[1], count + 1.0]
        });
        let correlation = both / (before * after).sqrt().max(f64::MIN_POSITIVE);
        let goes_on = correlation > GOES_ON && count >= LEAST_PAIRS;
        goes_on.then(|| Term {
            axis: of.name.clone(),
            term: "its own value a row before".into(),
            share: correlation.powi(2),
        })
    };
    kind.experiment.axes.iter().enumerate().filter_map(of_axis).collect()
}

fn dictionary(experiment: &Experiment, residuals: &[f64]) -> Vec<Candidate> {
    let n_axes = experiment.axes.len();
    let mut shapes: Vec<(String, Vec<f64>)> = Vec::new();
    for (name, channel) in &experiment.channels {
        let mean = channel.iter().sum::<f64>() / channel.len().max(1) as f64;
        let spread = (channel.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / channel.len().max(1) as f64).sqrt();
        if spread <= 1e-12 {
            continue;
        }
        let of = |shape: &dyn Fn(f64) -> f64| channel.iter().map(|c| shape(c / spread)).collect::<Vec<f64>>();
        shapes.push((name.clone(), of(&|c| c)));
        shapes.push((format!("{name} squared"), of(&|c| c * c)));
        shapes.push((format!("|{name}|"), of(&f64::abs)));
        shapes.push((format!("sign of {name}"), of(&|c| (c / 0.05).tanh())));
    }
    let linear: Vec<usize> = (0..shapes.len()).step_by(4).collect();
    shapes.extend(experiment.channels.iter().flat_map(|(name, channel)| waves(name, channel)));
    if linear.len() <= FEW {
        for (k, &a) in linear.iter().enumerate() {
            for &b in &linear[k + 1..] {
                let product = shapes[a].1.iter().zip(&shapes[b].1).map(|(a, b)| a * b).collect();
                shapes.push((format!("{} times {}", shapes[a].0, shapes[b].0), product));
            }
        }
    }
    let per_axis = MOST_COLUMNS / n_axes.max(1);
    let mut candidates = Vec::new();
    for (axis, of) in experiment.axes.iter().enumerate() {
        let along = |numbers: &Vec<f64>| along(experiment, residuals, axis, numbers);
        let mut sorted: Vec<(f64, &(String, Vec<f64>))> = shapes.iter().map(|shape| (along(&shape.1), shape)).collect();
        sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, (name, numbers)) in sorted.into_iter().take(per_axis) {
            let mut column = vec![0.0; numbers.len() * n_axes];
            numbers.iter().enumerate().for_each(|(row, number)| column[row * n_axes + axis] = *number);
            candidates.push(Candidate::one("fitted-term", &format!("{}: {name}", of.name), ("size", of.unit), column));
        }
    }
    candidates
}

/// sin and cos with whole numbers of periods in the range of a channel.
fn waves(name: &str, channel: &[f64]) -> Vec<(String, Vec<f64>)> {
    let (low, high) = channel.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(*c), h.max(*c)));
    if high - low <= 1e-12 {
        return Vec::new();
    }
    let of = |shape: fn(f64) -> f64, k: usize| {
        channel.iter().map(|c| shape(TAU * k as f64 * (c - low) / (high - low))).collect::<Vec<f64>>()
    };
    let both = |k| [of(f64::sin, k), of(f64::cos, k)].map(|column| (format!("wave {k} of {name}"), column));
    (1..=WAVES).flat_map(both).collect()
}

/// How much a shape goes with the residual of an axis, in the rows that a fit may see: the cosine between the two.
fn along(experiment: &Experiment, residuals: &[f64], axis: usize, numbers: &[f64]) -> f64 {
    let n_axes = experiment.axes.len();
    let rows = (0..numbers.len()).filter(|&row| !experiment.rows[row].held_out);
    let sums = rows.fold([0.0; 3], |[xy, xx, yy], row| {
        let (x, y) = (numbers[row], residuals[row * n_axes + axis]);
        [xy + x * y, xx + x * x, yy + y * y]
    });
    (sums[0] / (sums[1] * sums[2]).sqrt().max(f64::MIN_POSITIVE)).abs()
}
