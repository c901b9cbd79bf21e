//! What remains when no law helps any more: on which channels each axis of the residual depends, and how.
//!
//! A sparse regression over a dictionary: each channel c, c², |c|, sign(c), waves with up to `WAVES` periods in its range,
//! a smooth curve of any form, c and sign(c) times the time, and, of few channels, their products. The term that explains most of an axis for the columns
//! that it takes (Bayesian information criterion) is listed and taken out, then the next, while each is no chance (F test,
//! times the number of terms tried, rows counting as many times as they do not repeat each other). Numbers that stand out
//! between the rows beside them are drawn in first.

use std::f64::consts::TAU;

use crate::judge::far_rows::far_rows_of_signals;
use crate::judge::regression::{Design, Taken, Term, centred, of_axis, squares};
use crate::linearise::experiment::{Axis, Experiment};
use crate::outcome::{Dependence, Number, Regressor, Shape};
use crate::progress::Cancelled;
use crate::select::problem::{RegressionProblem as _, Trial};
use crate::select::signals::Signals;
use crate::select::significance::STRUCTURE_LEVEL;
use darm_measure::median;

/// Signals up to which their products are tried.
const FEW: usize = 6;
/// Terms of one axis that are listed at most.
const MAX_TERMS: usize = 4;
/// Periods of a wave in the range of its channel.
const WAVES: u8 = 8;
/// Periods of a wave in time, and in the range of postures: a robot's tool is measured in few rows, and gears and instruments have
/// short periods.
const WAVES_IN_TIME: u8 = 32;
const WAVES_OF_POSTURES: u8 = 48;
/// The channel of the time.
const TIME: &str = "time";
/// Where the pieces of a curve meet, as shares of the rows below.
///
/// Source: F. E. Harrell, Regression Modeling Strategies, 2nd ed., Springer (2015), table 2.3.
const KNOTS: [f64; 6] = [0.05, 0.23, 0.41, 0.59, 0.77, 0.95];
/// Straight pieces of a listed term.
const PIECES: usize = 128;
/// Correlation of neighbouring rows from which on a residual is no noise, and the least number of pairs for it.
const MIN_CORRELATION: f64 = 0.5;
const MIN_PAIRS: f64 = 100.0;
/// A residual counts as this multiple of the noise at most.
const FAR: f64 = 4.0;
/// Share of the rows up to which those that are far off are blunders.
const FEW_ROWS: f64 = 0.02;
/// Rows to either side that a number is held against, and how many times farther off than usual it is drawn in from.
const NEIGHBOURS: usize = 2;
const OUTLYING: f64 = 7.5;

/// What remains, and how much of what there was before it is.
pub(crate) struct Remaining {
    /// The terms, axis by axis.
    pub(crate) terms: Vec<Dependence>,
    /// What they take up, as a share of the squares before anything was found, each axis in units of its scatter.
    pub(crate) share: f64,
    /// The largest root mean square of an axis in units of what the terms leave of it.
    pub(crate) over_noise: f64,
}

/// What the residual of a model depends on.
///
/// # Errors
///
/// The diagnosis was given up.
pub(crate) fn remaining(problem: &Signals, best: &Trial<Signals>) -> Result<Remaining, Cancelled> {
    let (experiment, rows) = (&problem.experiment, &problem.groups.training);
    let n_axes = experiment.axes.len();
    let after = experiment.at(&best.fit.values);
    let dictionary = dictionary(experiment);
    let designs = designs(problem, &dictionary)?;
    let mut terms = Vec::new();
    let (mut taken, mut before, mut over_noise) = (0.0, f64::MIN_POSITIVE, 1.0f64);
    let blunders = blunders(problem, best);
    for (axis, of) in own_axes(experiment) {
        let (mut own, scatter) = winsorized(&of_axis(&after, n_axes, axis));
        blunders.iter().for_each(|&row| own[row] = 0.0);
        let in_scatter = |own: &[f64]| squares(own, rows) / (scatter * scatter);
        let total = in_scatter(&own);
        let depends = dependences(problem, of, &designs, own)?;
        let share = depends.iter().map(|term| term.share).sum::<f64>();
        taken += share * total;
        over_noise = over_noise.max((1.0 - share).max(f64::MIN_POSITIVE).sqrt().recip());
        before += in_scatter(&winsorized(&of_axis(&experiment.residuals, n_axes, axis)).0);
        terms.extend(depends);
    }
    Ok(Remaining { terms, share: taken / before, over_noise })
}

/// The terms of a dictionary, made ready for the rows that fits see.
fn designs<'a>(problem: &'a Signals, dictionary: &'a [Term]) -> Result<Vec<Design<'a>>, Cancelled> {
    let mut designs = Vec::new();
    for term in dictionary {
        problem.progress().check()?;
        designs.extend(Design::new(term, &problem.groups.training));
    }
    Ok(designs)
}

/// What the residual of an axis depends on most in a model without one of its effects, and the residuals of all axes without that.
///
/// # Errors
///
/// The diagnosis was given up.
pub(crate) fn instead(
    problem: &Signals,
    without: &Trial<Signals>,
    axis: usize,
) -> Result<Option<(Dependence, Vec<f64>)>, Cancelled> {
    let experiment = &problem.experiment;
    let n_axes = experiment.axes.len();
    let mut residuals = experiment.at(&without.fit.values);
    let dictionary = dictionary(experiment);
    let designs = designs(problem, &dictionary)?;
    let (own, _) = winsorized(&of_axis(&residuals, n_axes, axis));
    let first = dependences(problem, &experiment.axes[axis], &designs, own)?.into_iter().next();
    let is_of = |design: &&Design, first: &Dependence| {
        design.term.regressor == first.regressor && design.term.shape == first.shape
    };
    let design = first.as_ref().and_then(|first| designs.iter().find(|design| is_of(design, first)));
    let Some((first, design)) = first.zip(design) else { return Ok(None) };
    let left = design.take(&of_axis(&residuals, n_axes, axis)).left;
    let mean = problem.groups.training.iter().map(|&row| left[row]).sum::<f64>() / problem.groups.training.len() as f64;
    residuals.iter_mut().skip(axis).step_by(n_axes).zip(left).for_each(|(own, left)| *own = left - mean);
    Ok(Some((first, residuals)))
}

/// Training rows that are listed as outliers, where they are few: what residuals depend on is not theirs.
fn blunders(problem: &Signals, best: &Trial<Signals>) -> Vec<usize> {
    let training = &problem.groups.training;
    let far = far_rows_of_signals(&problem.under(best).training_residuals(&best.fit), problem.experiment.axes.len());
    let are_few = far.len() as f64 <= FEW_ROWS * training.len() as f64;
    far.into_iter().filter(|_| are_few).map(|(row, _)| training[row]).collect()
}

/// The terms of one axis, the strongest first. Rows repeat each other as far as what a term leaves is correlated from row
/// to row.
fn dependences(
    problem: &Signals,
    axis: &Axis,
    designs: &[Design],
    own: Vec<f64>,
) -> Result<Vec<Dependence>, Cancelled> {
    let (experiment, rows) = (&problem.experiment, &problem.groups.training);
    let n_tried = (designs.len() * experiment.axes.len()) as f64;
    let held_out: Vec<usize> = (0..experiment.rows.len()).filter(|&row| experiment.rows[row].held_out).collect();
    let error = |of: &[f64]| (squares(of, &held_out) / held_out.len() as f64).sqrt();
    let total = squares(&own, rows).max(f64::MIN_POSITIVE);
    // The terms have no mean over the rows; the first one takes that of the residual with it.
    let mut mean = rows.iter().map(|&row| own[row]).sum::<f64>() / rows.len().max(1) as f64;
    let (mut found, mut left): (Vec<Dependence>, _) = (Vec::new(), own);
    while found.len() < MAX_TERMS {
        let mut first: Option<(&Design, Taken)> = None;
        for design in designs {
            problem.progress().check()?;
            let taken = design.take(&left);
            if first.as_ref().is_none_or(|(_, first)| taken.criterion.total_cmp(&first.criterion).is_lt()) {
                first = Some((design, taken));
            }
        }
        let Some((design, taken)) = first else { break };
        let own = centred(&taken.left, rows);
        let seen: Vec<f64> = rows.iter().map(|&row| own[row]).collect();
        let p = taken.p(problem.groups.autocorrelation_time(&seen, 1)) * n_tried;
        if p >= STRUCTURE_LEVEL || taken.criterion >= 0.0 {
            break;
        }
        let fitted: Vec<f64> = left.iter().zip(&taken.left).map(|(before, after)| before - after + mean).collect();
        mean = 0.0;
        let regressor = design.term.regressor.clone();
        let channel = match &regressor {
            Regressor::Signals(names) if names.len() == 1 => {
                experiment.channels.iter().find(|(name, _)| *name == names[0])
            }
            _ => None,
        };
        found.push(Dependence {
            axis: Some(axis.name.clone()),
            variable: regressor.to_string(),
            regressor,
            shape: design.term.shape,
            frame: None,
            share: taken.square / total,
            p: Some(p),
            held_out_gain: (!held_out.is_empty()).then(|| Number::new(error(&left) - error(&taken.left), axis.unit)),
            curve: channel.map_or(Vec::new(), |(_, channel)| curve_along(channel, &fitted)),
            terms: Vec::new(),
        });
        left = taken.left;
    }
    Ok(found)
}

/// A term against its channel, in rising order.
fn curve_along(channel: &[f64], fitted: &[f64]) -> Vec<[f64; 2]> {
    let mut points: Vec<[f64; 2]> = channel.iter().zip(fitted).map(|(at, term)| [*at, *term]).collect();
    points.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    points.dedup_by(|a, b| a[0] == b[0]);
    let last = points.len().saturating_sub(1);
    let pieces = last.min(PIECES);
    (0..=pieces).filter_map(|k| points.get(k * last / pieces.max(1)).copied()).collect()
}

/// Numbers with those brought back that stand out between the ones beside them, and the usual scatter about these.
fn winsorized(numbers: &[f64]) -> (Vec<f64>, f64) {
    let around = |k: usize| median(numbers[k.saturating_sub(NEIGHBOURS)..].iter().copied().take(2 * NEIGHBOURS + 1));
    let near: Vec<f64> = (0..numbers.len()).map(|k| around(k).unwrap_or(numbers[k])).collect();
    let off = |k: usize| (numbers[k] - near[k]).abs();
    let largest = numbers.iter().fold(f64::MIN_POSITIVE, |largest, number| largest.max(number.abs()));
    let scatter = median((0..numbers.len()).map(off)).unwrap_or_default().max(1e-9 * largest);
    let back = |k: usize| if off(k) > OUTLYING * scatter { near[k] } else { numbers[k] };
    ((0..numbers.len()).map(back).collect(), scatter)
}

/// Axes whose residual is correlated from row to row, unlike noise, where no effect and no term was found: something is
/// missing, of a shape that is not in the dictionary. The share is that of the mean square which the row before foretells.
pub(crate) fn memory(problem: &Signals, best: &Trial<Signals>) -> Vec<Dependence> {
    let n_axes = problem.experiment.axes.len();
    let residuals = problem.under(best).training_residuals(&best.fit);
    let dependence = |(axis, of): (usize, &Axis)| {
        let own: Vec<f64> = of_axis(&residuals, n_axes, axis).iter().map(|r| r.clamp(-FAR, FAR)).collect();
        let (correlation, n_pairs) = correlation_with_row_before(problem, &own);
        (correlation > MIN_CORRELATION && n_pairs >= MIN_PAIRS).then(|| on_row_before(of, correlation.powi(2)))
    };
    own_axes(&problem.experiment).filter_map(dependence).collect()
}

/// The correlation of the residuals of training rows with those of the rows before, and the number of pairs.
fn correlation_with_row_before(problem: &Signals, residuals: &[f64]) -> (f64, f64) {
    let rows = &problem.experiment.rows;
    let training = problem.groups.training.windows(2).zip(residuals.windows(2));
    let is_other = |at: &[usize]| !problem.experiment.kind.is_of_tool() || !is_same_posture(&problem.experiment, at);
    let follows = |at: &[usize]| at[1] == at[0] + 1 && rows[at[0]].series == rows[at[1]].series;
    let pairs = training.filter(|(at, _)| follows(at) && is_other(at));
    let [both, before, after, count] = pairs.fold([0.0; 4], |[both, before, after, count], (_, r)| {
        [both + r[0] * r[1], before + r[0] * r[0], after + r[1] * r[1], count + 1.0]
    });
    (both / (before * after).sqrt().max(f64::MIN_POSITIVE), count)
}

/// Whether two rows are repeats of one posture: what they share is that posture's, not what lasts from row to row.
fn is_same_posture(experiment: &Experiment, at: &[usize]) -> bool {
    let mut postures = experiment.channels.iter().filter(|(name, _)| name != TIME);
    postures.all(|(_, channel)| channel[at[0]] == channel[at[1]])
}

/// The dependence of an axis on its row before, which explains `share` of the mean square.
fn on_row_before(axis: &Axis, share: f64) -> Dependence {
    Dependence { axis: Some(axis.name.clone()), ..Dependence::of_share(Regressor::RowBefore, share) }
}

/// The axes that prove something, with their numbers.
fn own_axes(experiment: &Experiment) -> impl Iterator<Item = (usize, &Axis)> {
    experiment.axes.iter().enumerate().filter(|(_, axis)| axis.proves())
}

fn dictionary(experiment: &Experiment) -> Vec<Term> {
    let mut terms = Vec::new();
    let mut straight: Vec<(&String, Vec<f64>)> = Vec::new();
    for (variable, channel) in &experiment.channels {
        let mean = channel.iter().sum::<f64>() / channel.len().max(1) as f64;
        let spread = (channel.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / channel.len().max(1) as f64).sqrt();
        if spread <= 1e-12 {
            continue;
        }
        let scaled: Vec<f64> = channel.iter().map(|c| c / spread).collect();
        let mut term = |shape, columns| {
            let regressor = Regressor::Signals(vec![variable.clone()]);
            terms.push(Term { regressor, shape, columns, kept: Vec::new() });
        };
        let of = |shape: &dyn Fn(f64) -> f64| scaled.iter().map(|c| shape(*c)).collect::<Vec<f64>>();
        term(Shape::Straight, vec![scaled.clone()]);
        term(Shape::Square, vec![of(&|c| c * c)]);
        term(Shape::Size, vec![of(&f64::abs)]);
        term(Shape::Sign, vec![of(&|c| (c / 0.05).tanh())]);
        term(Shape::Curve, curve(&scaled));
        let (low, high) = scaled.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(*c), h.max(*c)));
        let waves = match () {
            () if variable == TIME => WAVES_IN_TIME,
            () if experiment.kind.is_of_tool() => WAVES_OF_POSTURES,
            () => WAVES,
        };
        for periods in 1..=waves {
            let turn = |c: f64| TAU * f64::from(periods) * (c - low) / (high - low);
            term(Shape::Periods(periods), vec![of(&|c| turn(c).sin()), of(&|c| turn(c).cos())]);
        }
        straight.push((variable, scaled));
    }
    if straight.len() > FEW
        && let Some((_, time)) = straight.iter().find(|(name, _)| *name == TIME)
    {
        terms.extend(
            straight.iter().filter(|(name, _)| *name != TIME).map(|(name, channel)| with_time(name, time, channel)),
        );
    }
    if straight.len() <= FEW {
        for (k, (name, a)) in straight.iter().enumerate() {
            for (other, b) in &straight[k + 1..] {
                let columns = vec![a.iter().zip(b).map(|(a, b)| a * b).collect()];
                let regressor = Regressor::Signals(vec![(*name).clone(), (*other).clone()]);
                terms.push(Term { regressor, shape: Shape::Together, columns, kept: Vec::new() });
            }
        }
    }
    terms
}

/// A channel and its sign with coefficients that grow or fall with time, such as a gain and a friction.
fn with_time(name: &str, time: &[f64], channel: &[f64]) -> Term {
    let mean = time.iter().sum::<f64>() / time.len().max(1) as f64;
    let column = |of: &dyn Fn(f64) -> f64| time.iter().zip(channel).map(|(t, c)| (t - mean) * of(*c)).collect();
    let sign = |c: f64| (c / 0.05).tanh();
    let signs = channel.iter().map(|c| sign(*c)).collect();
    let columns = vec![channel.to_vec(), signs, column(&|c| c), column(&sign)];
    Term {
        regressor: Regressor::Signals(vec![TIME.into(), name.into()]),
        shape: Shape::Together,
        columns,
        kept: Vec::new(),
    }
}

/// The channel itself, and cubic pieces between knots that continue straight beyond the last ones.
fn curve(channel: &[f64]) -> Vec<Vec<f64>> {
    let mut sorted = channel.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let knots = KNOTS.map(|share| sorted[(share * (sorted.len() - 1) as f64) as usize]);
    let [.., before, last] = knots;
    let mut columns = vec![channel.to_vec()];
    if before < last {
        let cube = |c: f64, knot: f64| (c - knot).max(0.0).powi(3);
        for knot in &knots[..4] {
            let [of_before, of_last] = [last - knot, before - knot].map(|reach| reach / (last - before));
            let piece = |c: &f64| cube(*c, *knot) - of_before * cube(*c, before) + of_last * cube(*c, last);
            columns.push(channel.iter().map(piece).collect());
        }
    }
    columns
}
