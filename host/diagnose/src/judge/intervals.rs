//! Which effects of a model of signals are named, and the confidence intervals of their values.

use nalgebra::{DMatrix, DVector};

use crate::effect::{Effect, EffectValue};
use crate::judge::held_out::HeldOut;
use crate::judge::selected::SelectedSignals;
use crate::least_squares::{pseudo_inverse, weights};
use crate::linearise::experiment::{self, Candidate};
use crate::outcome::Number;
use crate::prepare::groups::{Clusters, Groups};
use crate::progress::Cancelled;
use crate::select::problem::{Neighbours as _, RegressionProblem as _};
use crate::select::signals::backward::FALSE_SHARE;
use crate::select::signals::simplify::surrogates;
use crate::select::signals::{SignalFit, Signals};
use crate::select::significance::{chance_beyond, discoveries, quantile_975};

/// A value whose uncertainty these rows lower to no less than this share of what was known before is not identified.
const NOT_NARROWED: f64 = 0.7;
/// Cosine between the columns of two shapes from which on a shape between them lies between their columns.
const SIMILAR_SHAPES: f64 = 0.5;
/// Standard deviation of a share that is anywhere from 0 to 1/2, about 0.
const SHARE_BETWEEN_SHAPES: f64 = 0.289;
/// A value is not identified where all but this share of its column is that of others.
const OWN_SHARE: f64 = 1e-6;

/// How far a value may be off.
#[derive(Clone, Copy)]
struct Deviation {
    /// One standard deviation.
    sigma: f64,
    /// What it rests on.
    dof: usize,
}

impl Deviation {
    /// Half the width of the interval at 95 %.
    fn half_width(self) -> f64 {
        quantile_975(self.dof) * self.sigma
    }
}

/// Deviations of the values with these numbers: of independent rows with their priors, by pieces of rows or, where there are several, by
/// days, runs or conditions (sandwich), whichever gives the widest interval; with them what the shapes between those that were tried
/// would change.
fn deviations(selected: &SelectedSignals, indices: &[usize]) -> Vec<Deviation> {
    let SelectedSignals { problem, best, .. } = selected;
    let Groups { blocks, n_blocks, clusters, .. } = &problem.groups;
    let inverse = pseudo_inverse(&problem.under(best).information(indices));
    let by_pieces = sandwich(selected, indices, &inverse, blocks, *n_blocks);
    let by_clusters = clusters.as_ref().map(|Clusters { of_rows, count }| {
        // Of few clusters the sandwich is too small by this share: A. C. Cameron, D. L. Miller, J. Human Resources 50 (2015) 317.
        let few = *count as f64 / (count - 1) as f64;
        (few * sandwich(selected, indices, &inverse, of_rows, *count), count - 1)
    });
    let by_shape = by_shape(selected, indices, &inverse);
    let of_value = |k: usize| {
        let deviation = |variance: f64, dof| Deviation { sigma: (variance.max(0.0) + by_shape[k]).sqrt(), dof };
        let by_pieces = deviation(by_pieces[k].max(inverse[(k, k)]), n_blocks.saturating_sub(1));
        let by_clusters = by_clusters.as_ref().map(|(variances, dof)| deviation(variances[k], *dof));
        by_clusters.filter(|other| other.half_width() > by_pieces.half_width()).unwrap_or(by_pieces)
    };
    (0..indices.len()).map(of_value).collect()
}

/// Variances of values when the rows of a group share their errors; `groups` has the group of each training row.
fn sandwich(
    selected: &SelectedSignals,
    indices: &[usize],
    inverse: &DMatrix<f64>,
    groups: &[usize],
    n_groups: usize,
) -> DVector<f64> {
    let SelectedSignals { problem, best, .. } = selected;
    let weighted = problem.under(best);
    let residuals = weighted.training_residuals(&best.fit);
    let n_axes = problem.experiment.axes.len();
    let entry_weights = weights(&residuals, 1);
    let mut scores = DMatrix::<f64>::zeros(indices.len(), n_groups);
    for (a, &value) in indices.iter().enumerate() {
        for (k, slope) in weighted.column(value).iter().enumerate() {
            let score = entry_weights[k] * slope * residuals[k] / best.weighting.autocorrelation_time;
            scores[(a, groups[k / n_axes])] += score;
        }
    }
    (inverse * (&scores * scores.transpose()) * inverse).diagonal()
}

/// Variances of values because the numbers in the shapes of laws come from a grid. The law with the next shape in place of a
/// share w of the own one would move the others by w·A⁻¹·(change of its column); w lies anywhere up to the middle of the gap.
fn by_shape(selected: &SelectedSignals, indices: &[usize], inverse: &DMatrix<f64>) -> Vec<f64> {
    let SelectedSignals { problem, best, .. } = selected;
    let mut variances = vec![0.0; indices.len()];
    for &candidate in &best.fit.active {
        let own = problem.indices(&[candidate]);
        let shifts = next_shapes(selected, candidate).map(|next| {
            let both = [indices, &own[..1], &problem.indices(&[next])[..1]].concat();
            let information = problem.under(best).information(&both);
            let n = indices.len();
            let change = DVector::from_fn(n, |k, _| information[(k, n + 1)] - information[(k, n)]);
            inverse * change * (best.fit.values[own[0]] * SHARE_BETWEEN_SHAPES)
        });
        let squares = shifts.map(|shift| shift.component_mul(&shift));
        let largest = squares.fold(DVector::zeros(indices.len()), |largest: DVector<f64>, square| largest.sup(&square));
        variances.iter_mut().zip(largest.iter()).for_each(|(variance, square)| *variance += square);
    }
    variances
}

/// The candidates of this law at this place with the next smaller and the next larger number in their shape, without those
/// that the model has, and those whose columns differ too much for a value between them, such as two periods.
fn next_shapes(selected: &SelectedSignals, candidate: usize) -> impl Iterator<Item = usize> {
    let SelectedSignals { problem, best, .. } = selected;
    let all = &problem.experiment.candidates;
    let number = |k: usize| all[k].shape.as_ref().map_or(0.0, |(_, number, _)| *number);
    let others = (0..all.len()).filter(|&k| k != candidate && all[k].is_same(&all[candidate]));
    let (below, above): (Vec<usize>, Vec<usize>) = others.partition(|&k| number(k) < number(candidate));
    let below = below.into_iter().max_by(|&a, &b| number(a).total_cmp(&number(b)));
    let above = above.into_iter().min_by(|&a, &b| number(a).total_cmp(&number(b)));
    let is_near = move |k: &usize| {
        let both = problem.indices(&[candidate, *k]);
        let information = problem.under(best).information(&both);
        information[(0, 1)] > SIMILAR_SHAPES * (information[(0, 0)] * information[(1, 1)]).sqrt()
    };
    below.into_iter().chain(above).filter(|k| !best.fit.active.contains(k)).filter(is_near)
}

/// The effects with the values that these rows identify, and the names of those that they do not.
///
/// # Errors
///
/// The diagnosis was given up.
pub(crate) fn effects(selected: &SelectedSignals) -> Result<(Vec<Effect>, Vec<String>), Cancelled> {
    let SelectedSignals { problem, best, n_known, .. } = selected;
    let indices = problem.indices(&best.fit.active);
    let deviations = deviations(selected, &indices);
    let information = problem.under(best).information(&indices);
    let inverse = pseudo_inverse(&information);
    let (mut found, mut unobservable, mut next): (Vec<Effect>, _, _) = (Vec::new(), Vec::new(), 0);
    let surrogates = surrogates(problem, best, *n_known);
    let (named, neighbours) = (named(selected, &deviations), problem.neighbours(best)?);
    for order in 0..best.fit.active.len() {
        let candidate = selected.candidate(order);
        let mut values: Vec<EffectValue> = candidate.shape.iter().map(shape).collect();
        let n_shape = values.len();
        let number = best.fit.active[order];
        let body = problem.experiment.bodies.iter().find(|body| body.candidate == number);
        for (k, value) in candidate.values.iter().enumerate() {
            let (at, half) = (best.fit.values[indices[next]], deviations[next].half_width());
            let own_share = 1.0 / (information[(next, next)] * inverse[(next, next)]).max(f64::MIN_POSITIVE);
            let is_identified = match value.prior.is_finite() {
                true => narrows(value, inverse[(next, next)]),
                false => own_share > OWN_SHARE,
            };
            next += 1;
            if is_identified && at.is_finite() {
                let ci95 = Some([at - half, at + half]);
                let nominal = body.map(|body| body.nominal[k]);
                values.push(EffectValue {
                    name: value.name.clone(),
                    value: at,
                    unit: value.unit.clone(),
                    ci95,
                    nominal,
                });
            } else {
                unobservable.push(value_name(value, candidate));
            }
        }
        let same = found.iter_mut().find(|found| found.law == candidate.law && found.site == candidate.site);
        if surrogates[order] {
            unobservable.push(format!("{} at {} beside what else acts there", candidate.law, candidate.site));
        } else if let Some(same) = same {
            same.values.extend(values);
        } else if values.len() > n_shape && named[order] {
            let without = neighbours.with_one_less(order)?.fit;
            let held_out_gain = held_out_gain(selected, &without);
            if order < *n_known || is_confirmed(selected, &without, held_out_gain.as_ref()) {
                found.push(Effect { law: candidate.law, site: candidate.site.clone(), values, held_out_gain });
            }
        }
    }
    if problem.experiment.all_priors_informative() {
        unobservable.extend(not_narrowed_with(selected)?);
    }
    Ok((found, unobservable))
}

/// The number in the shape of a law.
fn shape((name, value, unit): &(&'static str, f64, String)) -> EffectValue {
    EffectValue { name: (*name).into(), value: *value, unit: unit.clone(), ci95: None, nominal: None }
}

/// The values of the other candidates that these rows do not identify beside those of a model.
fn not_narrowed_with(selected: &SelectedSignals) -> Result<Vec<String>, Cancelled> {
    let others = (0..selected.problem.experiment.candidates.len()).filter(|k| !selected.best.fit.active.contains(k));
    let mut all = Vec::new();
    for k in others {
        selected.problem.progress().check()?;
        all.extend(not_narrowed(selected, k));
    }
    Ok(all)
}

/// The values of the candidate `k` that these rows do not identify beside those of a model.
fn not_narrowed(selected: &SelectedSignals, k: usize) -> Vec<String> {
    let SelectedSignals { problem, best, .. } = selected;
    let candidate = &problem.experiment.candidates[k];
    let indices = problem.indices(&[&best.fit.active[..], &[k]].concat());
    let inverse = pseudo_inverse(&problem.under(best).information(&indices));
    let first = indices.len() - candidate.values.len();
    let values = candidate.values.iter().enumerate();
    let open = values.filter(|(n, value)| !narrows(value, inverse[(first + n, first + n)]));
    open.map(|(_, value)| value_name(value, candidate)).collect()
}

/// Whether the rows leave a value with a prior a variance that identifies it.
fn narrows(value: &experiment::CandidateValue, variance: f64) -> bool {
    variance.sqrt() < NOT_NARROWED * value.prior
}

fn value_name(value: &experiment::CandidateValue, of: &Candidate) -> String {
    format!("{} of {} at {}", value.name, of.law, of.site)
}

/// Which effects are named: the known ones, and of those selected the ones that differ from zero.
fn named(selected: &SelectedSignals, deviations: &[Deviation]) -> Vec<bool> {
    let mut named = vec![true; selected.n_known];
    named.extend(discoveries(&chances(selected, deviations)[selected.n_known..], FALSE_SHARE));
    named
}

/// The chance of each effect of the model to be zero, by its values.
fn chances(selected: &SelectedSignals, deviations: &[Deviation]) -> Vec<f64> {
    let SelectedSignals { problem, best, .. } = selected;
    let mut deviations = deviations.iter();
    let of_value = |(&index, deviation): (&usize, &Deviation)| {
        let errors = best.fit.values[index] / deviation.sigma.max(f64::MIN_POSITIVE);
        chance_beyond(errors, deviation.dof)
    };
    let chance = |candidate: &usize| {
        let values = problem.indices(&[*candidate]);
        let smallest = values.iter().zip(deviations.by_ref()).map(of_value).fold(1.0, f64::min);
        smallest * values.len() as f64
    };
    best.fit.active.iter().map(chance).collect()
}

/// The effects of a model, a few at most, that are the least likely to be zero.
pub(crate) fn likeliest(selected: &SelectedSignals, count: usize) -> Vec<usize> {
    let active = &selected.best.fit.active;
    let chances = chances(selected, &deviations(selected, &selected.problem.indices(active)));
    let mut order: Vec<usize> = (selected.n_known..active.len()).collect();
    order.sort_by(|&a, &b| chances[a].total_cmp(&chances[b]));
    order.iter().take(count).map(|&order| active[order]).collect()
}

/// Whether rows that no fit has seen are predicted worse without an effect. One that fits the others' errors has an interval without zero
/// too.
fn is_confirmed(selected: &SelectedSignals, without: &SignalFit, gain: Option<&Number>) -> bool {
    let falls = HeldOut::from(selected, &without.values)
        .falls(&selected.best.weighting.sigma, selected.problem.experiment.n_norm);
    falls && gain.is_none_or(|gain| gain.value > 0.0)
}

/// By how much the held-out norm is larger without an effect.
fn held_out_gain(selected: &SelectedSignals, without: &SignalFit) -> Option<Number> {
    let SelectedSignals { problem, best, .. } = selected;
    let gain = held_out_norm(problem, &without.values)? - held_out_norm(problem, &best.fit.values)?;
    Some(Number::new(gain, problem.experiment.unit()))
}

fn held_out_norm(problem: &Signals, values: &[f64]) -> Option<f64> {
    let experiment = &problem.experiment;
    experiment.norm(&experiment.held_out_rows(&experiment.at(values)))
}
