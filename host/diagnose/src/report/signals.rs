//! A search's result put in the shape of a [`Diagnosis`], with intervals, what is not told, and plain words.

use std::cmp::Ordering;

use nalgebra::DMatrix;

use crate::diagnosis::UNEXPLAINED_SHARE;
use crate::judge::next_rows;
use crate::judge::remaining;
use crate::judge::remaining::Remaining;
use crate::judge::scatter;
use crate::linearise::experiment::{Candidate, Experiment, Value};
use crate::linearise::model_effects::{self, Known};
use crate::outcome::{AxisFigure, Rows, Verdict};
use crate::outcome_signals::{
    Alternative, BeforeAfter, Diagnosis, Errors, Figure, Found, Number, Outlier, Parameter, Point,
};
use crate::select::backward::FALSE_SHARE;
use crate::select::factored::Factored;
use crate::select::problem::Trial;
use crate::select::robust_fit::{pseudo_inverse, size, weights};
use crate::select::signals::Channels;
use crate::select::significance::{chance_beyond, discoveries, quantile_975};
use crate::select::simplify;
use crate::signals::Ended;
use crate::signals::Options;

/// A value whose uncertainty these rows lower to no less than this share of what was known before is not told by them.
const NOT_TOLD: f64 = 0.7;
/// A value is not told where all but this share of its column is that of others.
const OWN_SHARE: f64 = 1e-6;
/// Effects up to which each is compared with all others that could stand in its place.
const MOST_COMPARED: usize = 3;
/// Rows this many times farther off than usual are listed.
const FAR: f64 = 8.0;
/// Rows that are listed or plotted at most.
const MOST_ROWS: usize = 4000;

/// Squares of held-out residuals, of one search or of several that each held out other rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeldOut {
    before: Vec<f64>,
    after: Vec<f64>,
}

impl HeldOut {
    /// Adds what a search did not see.
    pub(crate) fn add(&mut self, ended: &Ended) {
        let experiment = &ended.search.kind.experiment;
        self.before.extend(of_rows(experiment, &experiment.residuals, true));
        self.after.extend(of_rows(experiment, &experiment.at(&ended.best.fit.values), true));
    }
}

/// The residuals of the rows that are held out, or of the others.
fn of_rows(experiment: &Experiment, residuals: &[f64], held_out: bool) -> Vec<f64> {
    let n_axes = experiment.axes.len();
    let rows = experiment.rows.iter().enumerate().filter(|(_, row)| row.held_out == held_out);
    rows.flat_map(|(row, _)| residuals[row * n_axes..(row + 1) * n_axes].iter().copied()).collect()
}

fn figure(experiment: &Experiment, residuals: &[f64]) -> Option<Figure> {
    let n_axes = experiment.axes.len();
    let rows = residuals.len() / n_axes;
    let mean = |axis: usize| residuals.iter().skip(axis).step_by(n_axes).map(|r| r * r).sum::<f64>() / rows as f64;
    let axes: Vec<AxisFigure> = experiment
        .axes
        .iter()
        .enumerate()
        .map(|(k, axis)| AxisFigure { axis: axis.name.clone(), value: mean(k).sqrt(), unit: axis.unit })
        .collect();
    let norm = (0..experiment.n_norm).map(mean).sum::<f64>().sqrt();
    let unit = experiment.axes.first().map_or("", |axis| axis.unit).into();
    (rows > 0).then_some(Figure { axes, norm: Number { value: norm, unit } })
}

fn errors(experiment: &Experiment, residuals: &[f64], heldout: Option<&[f64]>) -> Errors {
    let empty = Figure { axes: Vec::new(), norm: Number { value: 0.0, unit: String::new() } };
    let own = of_rows(experiment, residuals, true);
    Errors {
        train: figure(experiment, &of_rows(experiment, residuals, false)).unwrap_or(empty),
        heldout: figure(experiment, heldout.unwrap_or(&own)),
    }
}

/// The diagnosis; `pooled` has the held-out residuals of other searches where each held out other rows.
pub(crate) fn diagnosis(mut ended: Ended, pooled: Option<HeldOut>, known: &[Known], options: &Options) -> Diagnosis {
    let alternatives = alternatives(&mut ended);
    let ended = &ended;
    let kind = &ended.search.kind;
    let experiment = &kind.experiment;
    let after = experiment.at(&ended.best.fit.values);
    let pooled = pooled.as_ref();
    let error = BeforeAfter {
        before: errors(experiment, &experiment.residuals, pooled.map(|p| &p.before[..])),
        after: errors(experiment, &after, pooled.map(|p| &p.after[..])),
    };
    let ambiguous: Vec<usize> = alternatives.iter().map(|(order, _)| *order).collect();
    let (mut effects, unobservable) = effects(ended);
    let own = |order: usize| kind.experiment.candidates[ended.best.fit.active[order]].clone();
    let has_rivals = |found: &Found| ambiguous.iter().any(|&k| own(k).law == found.law && own(k).place == found.place);
    effects.retain(|found| !has_rivals(found));
    // Effects that help together, and none of them by itself.
    let untold = effects.is_empty() && alternatives.is_empty() && ended.best.fit.active.len() > ended.n_known;
    let doubtful = if untold { likeliest(ended) } else { of_alternatives(ended, &alternatives) };
    let next_measurement = (!doubtful.is_empty()).then(|| next_rows::proposal(kind, &doubtful));
    let Remaining { terms: mut remaining, share: left } = remaining::remaining(kind, &ended.best);
    // Behind a filter noise goes on from row to row as well.
    if effects.is_empty() && remaining.is_empty() && options.preparation.lowpass_hz.is_none() {
        remaining = remaining::memory(kind, &ended.best);
    }
    let verdict = match effects.is_empty() && doubtful.is_empty() {
        true if remaining.is_empty() => Verdict::NoEffect,
        true => Verdict::UnexplainedStructure,
        false if left > UNEXPLAINED_SHARE => Verdict::UnexplainedStructure,
        false if !doubtful.is_empty() => Verdict::NotIdentifiable,
        false => Verdict::EffectFound,
    };
    let heldout = pooled.map_or(of_rows(experiment, &after, true).len(), |p| p.after.len()) / experiment.axes.len();
    let mut diagnosis = Diagnosis {
        kind: experiment.kind,
        rows: Rows { train: kind.groups.training.len(), heldout },
        held_out: ended.held_out.clone(),
        left_out: kind.groups.left_out,
        repeatability: scatter::scatter(experiment),
        error,
        verdict,
        effects,
        alternatives: told(ended, &alternatives),
        unobservable,
        remaining,
        outliers: outliers(kind, &ended.best),
        next_measurement,
        plain: Vec::new(),
        findings: ended.findings.iter().map(ToString::to_string).collect(),
        ladder: ended.search.ladder.clone(),
        points: points(experiment, &after),
        seed: options.seed,
        version: env!("CARGO_PKG_VERSION"),
        model_effects: model_effects::together(known, in_model(ended)),
    };
    diagnosis.plain = plain(&diagnosis);
    diagnosis
}

/// Covariance of fitted values: of independent rows with their priors, or by pieces of rows (sandwich), whichever is wider.
fn deviations(kind: &Channels, best: &Trial<Channels>, indices: &[usize]) -> Vec<f64> {
    let information = kind.information(indices);
    let inverse = pseudo_inverse(&information);
    let residuals = kind.training_residuals(&best.fit);
    let n_axes = kind.sigma.len();
    let entry_weights = weights(&residuals, 1);
    let mut scores = DMatrix::<f64>::zeros(indices.len(), kind.groups.n_blocks);
    for (a, &value) in indices.iter().enumerate() {
        for (k, slope) in kind.column(value).iter().enumerate() {
            scores[(a, kind.groups.blocks[k / n_axes])] += entry_weights[k] * slope * residuals[k] / kind.repeats;
        }
    }
    let sandwich = &inverse * (&scores * scores.transpose()) * &inverse;
    (0..indices.len()).map(|k| sandwich[(k, k)].max(inverse[(k, k)]).max(0.0).sqrt()).collect()
}

/// The effects with the values that these rows tell, and the names of those that they do not.
fn effects(ended: &Ended) -> (Vec<Found>, Vec<String>) {
    let (kind, best) = (&ended.search.kind, &ended.best);
    let indices = kind.indices(&best.fit.active);
    let deviations = deviations(kind, best, &indices);
    let information = kind.information(&indices);
    let inverse = pseudo_inverse(&information);
    let wide = quantile_975(kind.groups.n_blocks.saturating_sub(1));
    let model = Factored::new(kind, best.fit.active.clone());
    let (mut found, mut unobservable, mut next): (Vec<Found>, _, _) = (Vec::new(), Vec::new(), 0);
    let forms = simplify::forms(kind, best, ended.n_known);
    let named = named(ended, &deviations);
    for (order, &candidate) in best.fit.active.iter().enumerate() {
        let law = &kind.experiment.candidates[candidate];
        let shape = law.shape.iter().map(|(name, value, unit)| Parameter {
            name: (*name).into(),
            value: *value,
            unit: unit.clone(),
            ci95: None,
        });
        let mut parameters: Vec<Parameter> = shape.collect();
        let n_shape = parameters.len();
        for value in &law.values {
            let (index, deviation) = (indices[next], deviations[next]);
            let own = 1.0 / (information[(next, next)] * inverse[(next, next)]).max(f64::MIN_POSITIVE);
            next += 1;
            let told =
                if value.prior.is_finite() { narrows(value, inverse[(next - 1, next - 1)]) } else { own > OWN_SHARE };
            if !told || !best.fit.values[index].is_finite() {
                unobservable.push(value_name(value, law));
                continue;
            }
            let (at, half) = (best.fit.values[index], wide * deviation);
            let ci95 = Some([at - half, at + half]);
            parameters.push(Parameter { name: value.name.clone(), value: at, unit: value.unit.clone(), ci95 });
        }
        if forms[order] {
            unobservable.push(format!("{} at {} beside what else acts there", law.law, law.place));
        } else if let Some(same) = found.iter_mut().find(|found| found.law == law.law && found.place == law.place) {
            same.parameters.extend(parameters);
        } else if parameters.len() > n_shape && named[order] {
            let heldout_gain = heldout_gain(ended, &model, candidate);
            found.push(Found { law: law.law, place: law.place.clone(), parameters, heldout_gain });
        }
    }
    if kind.experiment.is_held_by_priors() {
        unobservable.extend(untold_beside(kind, &best.fit.active));
    }
    (found, unobservable)
}

/// The values of the other candidates that these rows do not tell beside those of a model.
fn untold_beside(kind: &Channels, active: &[usize]) -> Vec<String> {
    let candidates = &kind.experiment.candidates;
    let untold = |k: usize| {
        let indices = kind.indices(&[active, &[k]].concat());
        let inverse = pseudo_inverse(&kind.information(&indices));
        let first = indices.len() - candidates[k].values.len();
        let values = candidates[k].values.iter().enumerate();
        let untold = values.filter(move |(n, value)| !narrows(value, inverse[(first + n, first + n)]));
        untold.map(move |(_, value)| value_name(value, &candidates[k]))
    };
    (0..candidates.len()).filter(|k| !active.contains(k)).flat_map(untold).collect()
}

/// Whether the rows leave a value with a prior a variance that tells it.
fn narrows(value: &Value, variance: f64) -> bool {
    variance.sqrt() < NOT_TOLD * value.prior
}

fn value_name(value: &Value, of: &Candidate) -> String {
    format!("{} of {} at {}", value.name, of.law, of.place)
}

/// Which effects are named: all of a model that was chosen effect by effect; of one that priors hold those that differ from
/// nothing, the others are kept small.
fn named(ended: &Ended, deviations: &[f64]) -> Vec<bool> {
    let mut named = vec![true; ended.best.fit.active.len()];
    if ended.search.kind.experiment.is_held_by_priors() {
        let chances = &chances(ended, deviations)[ended.n_known..];
        named.splice(ended.n_known.., discoveries(chances, FALSE_SHARE));
    }
    named
}

/// The chance of each effect of the model to be nothing, by its values.
fn chances(ended: &Ended, deviations: &[f64]) -> Vec<f64> {
    let (kind, fit) = (&ended.search.kind, &ended.best.fit);
    let mut deviations = deviations.iter();
    let chance = |candidate: &usize| {
        let values = kind.indices(&[*candidate]);
        let of_value = |(&index, deviation): (&usize, &f64)| {
            chance_beyond(fit.values[index] / deviation.max(f64::MIN_POSITIVE), kind.groups.n_blocks.saturating_sub(1))
        };
        let least = values.iter().zip(deviations.by_ref()).map(of_value).fold(1.0, f64::min);
        least * values.len() as f64
    };
    fit.active.iter().map(chance).collect()
}

/// The effects of a model, a few at most, that are the least likely to be nothing.
fn likeliest(ended: &Ended) -> Vec<usize> {
    let (kind, active) = (&ended.search.kind, &ended.best.fit.active);
    let chances = chances(ended, &deviations(kind, &ended.best, &kind.indices(active)));
    let mut order: Vec<usize> = (ended.n_known..active.len()).collect();
    order.sort_by(|&a, &b| chances[a].total_cmp(&chances[b]));
    order.iter().take(MOST_COMPARED).map(|&order| active[order]).collect()
}

/// By how much the held-out norm is larger without an effect.
fn heldout_gain(ended: &Ended, model: &Factored, candidate: usize) -> Option<f64> {
    let kind = &ended.search.kind;
    let without = model.without(kind, &[candidate]);
    let norm = |values: &[f64]| {
        let residuals = of_rows(&kind.experiment, &kind.experiment.at(values), true);
        figure(&kind.experiment, &residuals).map(|figure| figure.norm.value)
    };
    Some(norm(&without.fit.values)? - norm(&ended.best.fit.values)?)
}

/// The effects of the model that was found, with all their values.
fn in_model(ended: &Ended) -> Vec<Known> {
    let (kind, fit) = (&ended.search.kind, &ended.best.fit);
    let of = |&candidate: &usize| {
        let values: Vec<f64> = kind.indices(&[candidate]).iter().map(|&at| fit.values[at]).collect();
        Known::of(&kind.experiment.candidates[candidate], &values)
    };
    fit.active.iter().map(of).collect()
}

/// Number of an effect among those of the model, and a candidate that would do as well in its place, with the
/// confidence that it is worse.
type Rival = (usize, (usize, f64));

/// What explains the rows as well in the place of an effect, where there are few of them.
///
/// Another shape of the same law at the same place is no other explanation, and neither is what stands beside it already.
fn alternatives(ended: &mut Ended) -> Vec<Rival> {
    let n_found = ended.best.fit.active.len() - ended.n_known;
    if n_found == 0 || n_found > MOST_COMPARED {
        return Vec::new();
    }
    let (kind, best) = (&ended.search.kind, &ended.best);
    let forms = simplify::forms(kind, best, ended.n_known);
    let mut all: Vec<Rival> = Vec::new();
    for order in (ended.n_known..forms.len()).filter(|&order| !forms[order]) {
        let Ok(rivals) = ended.search.rivals(&ended.best, order, order, None);
        let kind = &ended.search.kind;
        let place = |k: usize| (kind.experiment.candidates[k].law, &kind.experiment.candidates[k].place);
        for (rival, worse_with) in rivals {
            let Some(&[candidate]) = rival.effect.map(|number| &kind.moves[number][..]) else { continue };
            let beside = ended.best.fit.active.iter().any(|&k| place(k) == place(candidate));
            let known = all.iter().any(|(of, (other, _))| *of == order && place(*other) == place(candidate));
            if !beside && !known {
                all.push((order, (candidate, worse_with)));
            }
        }
    }
    all
}

/// The effects that have rivals, and these, once each.
fn of_alternatives(ended: &Ended, rivals: &[Rival]) -> Vec<usize> {
    let mut all: Vec<usize> =
        rivals.iter().flat_map(|(order, (rival, _))| [ended.best.fit.active[*order], *rival]).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Alternatives in words, the best one of each set first.
fn told(ended: &Ended, rivals: &[Rival]) -> Vec<Alternative> {
    let mut all = Vec::new();
    let mut before = None;
    for (order, (rival, worse_with)) in rivals {
        let alternative = |candidate: usize, worse_with: f64| {
            let of = &ended.search.kind.experiment.candidates[candidate];
            Alternative { instead_of: order - ended.n_known, law: of.law, place: of.place.clone(), worse_with }
        };
        if before != Some(order) {
            all.push(alternative(ended.best.fit.active[*order], 0.0));
            before = Some(order);
        }
        all.push(alternative(*rival, *worse_with));
    }
    all
}

fn outliers(kind: &Channels, best: &Trial<Channels>) -> Vec<Outlier> {
    let n_axes = kind.sigma.len();
    let residuals = kind.training_residuals(&best.fit);
    let sizes = residuals.chunks(n_axes).map(|row| size(row) / (n_axes as f64).sqrt());
    let far = sizes.enumerate().filter(|(_, sigmas)| *sigmas > FAR);
    let line = |row: usize| kind.experiment.rows[kind.groups.training[row]].line;
    far.take(MOST_ROWS).map(|(row, sigmas)| Outlier { line: line(row), sigmas }).collect()
}

fn points(experiment: &Experiment, after: &[f64]) -> Vec<Point> {
    let n_axes = experiment.axes.len();
    let every = experiment.rows.len().div_ceil(MOST_ROWS).max(1);
    let point = |(k, row): (usize, &crate::linearise::experiment::Row)| Point {
        time_s: row.time_s,
        held_out: row.held_out,
        before: experiment.residuals[k * n_axes..(k + 1) * n_axes].to_vec(),
        after: after[k * n_axes..(k + 1) * n_axes].to_vec(),
    };
    experiment.rows.iter().enumerate().step_by(every).map(point).collect()
}

fn plain(diagnosis: &Diagnosis) -> Vec<String> {
    let mut told = vec![match diagnosis.verdict {
        Verdict::EffectFound => "The model lacks what is named here.".to_string(),
        Verdict::NoEffect => "Nothing that was tried predicts unseen rows better than the model does.".into(),
        Verdict::UnexplainedStructure => "There is more than the laws that are known here explain.".into(),
        Verdict::NotIdentifiable => "Something is missing, but these rows cannot tell what.".into(),
    }];
    told.extend(diagnosis.effects.iter().map(effect_sentence));
    let (before, after) = (&diagnosis.error.before, &diagnosis.error.after);
    if let (Some(b), Some(a)) = (&before.heldout, &after.heldout) {
        let (before, after) = (b.norm.value, a.norm.value);
        let error = match after.total_cmp(&before) {
            Ordering::Equal => format!("is {}", short(before)),
            Ordering::Less => format!("falls from {} to {}", short(before), short(after)),
            Ordering::Greater => format!("rises from {} to {}", short(before), short(after)),
        };
        told.push(format!("On rows that nothing saw ({}) the error {error} {}.", diagnosis.held_out, a.norm.unit));
    }
    if !diagnosis.unobservable.is_empty() {
        told.push(format!("These rows do not tell: {}.", diagnosis.unobservable.join("; ")));
    }
    if !diagnosis.alternatives.is_empty() {
        let all: Vec<String> =
            diagnosis.alternatives.iter().map(|other| format!("{} at {}", other.law, other.place)).collect();
        told.push(format!("These rows cannot tell apart: {}.", all.join("; ")));
    }
    if let Some(next) = &diagnosis.next_measurement {
        let lines: Vec<String> = next.rows.iter().map(|row| row.line.to_string()).collect();
        told.push(format!(
            "Measure once more under the conditions of lines {}: they tell most of it.",
            lines.join(", ")
        ));
    }
    for term in &diagnosis.remaining {
        told.push(format!(
            "What remains of {} depends on {} ({:.0} % of it).",
            term.axis,
            term.term,
            100.0 * term.share
        ));
    }
    if !diagnosis.outliers.is_empty() {
        let lines: Vec<String> = diagnosis.outliers.iter().take(8).map(|outlier| outlier.line.to_string()).collect();
        told.push(format!("{} rows fit nothing: lines {}.", diagnosis.outliers.len(), lines.join(", ")));
    }
    told
}

/// Four digits.
fn short(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || (1e-3..1e5).contains(&size) { format!("{value:.4}") } else { format!("{value:.3e}") }
}

fn effect_sentence(found: &Found) -> String {
    let value = |parameter: &Parameter| format!("{} {} {}", parameter.name, short(parameter.value), parameter.unit);
    let values: Vec<String> = found.parameters.iter().map(value).collect();
    let gain = match found.heldout_gain {
        Some(gain) if gain > 0.0 => format!("; without it the error of unseen rows grows by {}", short(gain)),
        _ => String::new(),
    };
    format!("{} at {}: {}{gain}.", found.law, found.place, values.join(", "))
}
