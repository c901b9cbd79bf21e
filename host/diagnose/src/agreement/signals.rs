//! Whether signals agree with their model, read as they are or in another way.
//!
//! Models of robots are rough before they are identified: friction is missing and masses are guesses. So readings are compared
//! by what is left with every law at every place, on rows that are left out in turn: the sum over the axes of the logarithm of
//! the error as a share of what was measured, which another unit does not change.

use std::collections::BTreeMap;

use rayon::prelude::{IntoParallelIterator as _, ParallelIterator as _};

use super::column_readings::{Hypothesis, around, hypotheses, units};
use super::{Agreement, FEW, trimmed_root_mean_square};
use crate::effect::Law;
use crate::error::MIN_PIECES;
use crate::linearise::experiment::{Columns, Experiment};
use crate::linearise::model::Model;
use crate::linearise::{columns, linearise};
use crate::measurement::{median, root_mean_square};
use crate::misreading::Misreading;
use crate::outcome::{Number, OtherReading};
use crate::prepare::column_reading::ColumnReading;
use crate::prepare::groups::Groups;
use crate::prepare::signals::Prepared;
use crate::select::backward::every_law;
use crate::select::signals::Signals;
use crate::select::significance::{DISCOVERY_LEVEL, chance_of_mean};

/// Rows that readings are compared on.
const ROWS: usize = 600;
/// A model whose error is below this share of what was measured, on every axis, belongs to its log.
const NEAR: f64 = 0.1;
/// Factor by which the product of the axes' errors falls under another reading, with every law.
const MUCH_LESS: f64 = 2.0;
/// Share of its error that is left of the model as it is under another reading.
const MUCH_LESS_AS_IT_IS: f64 = 0.25;
/// Share of the variance that a model explains whose error is larger than what was measured varies, by far: rough models of a
/// robot have neither friction nor motors, and explain little.
const WORSE_THAN_NONE: f64 = -1.0;
/// Least variation of what is predicted, as a share of that of the error, with which an error says that a model is wrong.
const MIN_VARIATION: f64 = 0.25;
/// Error under another reading as a share of what was measured, at the most.
const AGREES: f64 = 0.5;
/// What remains of the variation of a log in another unit, as a share, at the most.
const FOLLOWS: f64 = 0.9;
/// Factor between measured and predicted signals from which on they are in different units.
const OTHER_UNIT: f64 = 20.0;
/// Hypotheses that are compared with every law, the best ones of the model as it is.
const COMPARED: usize = 12;
/// Times that laws with impossible sizes are taken out of a fit.
const MAX_ROUNDS: usize = 4;
/// A row counts as this multiple of the usual error at most.
const FAR: f64 = 4.0;

/// How the training rows of a table agree with its model; `experiment` is of the table as it is read.
pub(crate) fn agreement(model: &Model, data: &Prepared, experiment: &Experiment) -> Agreement {
    let Some(training) = Training::of(experiment) else { return Agreement::AsRead };
    let is_near = (0..experiment.n_norm).all(|axis| training.share(experiment, axis) < NEAR);
    if is_near {
        return Agreement::AsRead;
    }
    let columns = columns(model, data);
    if let Some((factor, error)) = training.other_unit(experiment) {
        // Of a wrench the norm is the centre of pressure, which moments are in.
        let columns = columns.measured.iter().filter_map(|group| group.last().cloned()).collect();
        return otherwise(Misreading::ColumnScale { columns, factor }, error, experiment);
    }
    let (comparison, tests_the_model) = (Comparison { model, data }, training.tests_the_model(experiment));
    let tried = if tests_the_model { hypotheses(model, data, &columns) } else { units(&columns) };
    match comparison.better(tried, &columns) {
        Some((error, misreading)) => otherwise(misreading, error, experiment),
        None if !tests_the_model => {
            // A constant error that is larger than all that was measured is no effect: the model is another robot's.
            let is_worse = size(experiment, &training.residuals) > size(experiment, &training.measured);
            if is_worse { Agreement::Hardly(0) } else { Agreement::AsRead }
        }
        None if training.explained(experiment, &training.residuals) < WORSE_THAN_NONE => Agreement::Hardly(FEW),
        None => Agreement::AsRead,
    }
}

/// Share of the variance of the training rows that a model explains which leaves these residuals, by the norm, without what is
/// far off in both; 1 where nothing but differences is measured, or nothing is predicted but a constant.
pub(crate) fn explained(experiment: &Experiment, residuals: &[f64]) -> f64 {
    match Training::of(experiment).filter(|training| training.tests_the_model(experiment)) {
        None => 1.0,
        Some(training) => training.explained(experiment, residuals),
    }
}

/// The rows that fits see of what was predicted and measured: rows × axes, one row at least.
struct Training {
    residuals: Vec<f64>,
    measured: Vec<f64>,
}

impl Training {
    /// Those of an experiment; `None` where nothing but differences is measured.
    fn of(experiment: &Experiment) -> Option<Self> {
        let residuals = experiment.of_rows(&experiment.residuals, false);
        let measured = experiment.of_rows(experiment.measured.as_ref()?, false);
        (!residuals.is_empty()).then_some(Self { residuals, measured })
    }

    /// The error of the norm.
    fn error(&self, experiment: &Experiment) -> f64 {
        experiment.norm(&self.residuals).expect("there are training rows")
    }

    /// Whether what is predicted varies enough beside the error to say that the model is wrong: at rest it does not.
    fn tests_the_model(&self, experiment: &Experiment) -> bool {
        let predicted: Vec<f64> = self.residuals.iter().zip(&self.measured).map(|(r, measured)| r + measured).collect();
        varies(experiment, &predicted) > MIN_VARIATION * varies(experiment, &self.residuals)
    }

    /// Share of the variance that a model explains which leaves these residuals.
    fn explained(&self, experiment: &Experiment, residuals: &[f64]) -> f64 {
        1.0 - (size(experiment, residuals) / varies(experiment, &self.measured).max(f64::MIN_POSITIVE)).powi(2)
    }

    /// The error of an axis as a share of how much it varies.
    fn share(&self, experiment: &Experiment, axis: usize) -> f64 {
        let of = |rows: &[f64]| trimmed_of_axis(rows, axis, experiment.axes.len());
        of(&self.residuals) / of(&variation(experiment, &self.measured))
    }

    /// How many times larger the numbers of the log are where it is in another unit, and the error without that; most of what
    /// was measured must be explained then, and some of what varies.
    fn other_unit(&self, experiment: &Experiment) -> Option<(f64, f64)> {
        let factor = self.ratio(experiment).filter(|factor| factor.ln().abs() > OTHER_UNIT.ln())?;
        let pairs = self.residuals.iter().zip(&self.measured);
        let residuals = pairs.map(|(residual, measured)| residual + measured * (1.0 - 1.0 / factor)).collect();
        let measured = self.measured.iter().map(|measured| measured / factor).collect();
        let read = Self { residuals, measured };
        let is_near = size(experiment, &read.residuals) < AGREES * size(experiment, &read.measured);
        let follows = varies(experiment, &read.residuals) < FOLLOWS * varies(experiment, &read.measured);
        (is_near && follows).then(|| (factor, read.error(experiment)))
    }

    /// How many times what is predicted was measured, axes of the norm together, by the median of large numbers.
    fn ratio(&self, experiment: &Experiment) -> Option<f64> {
        let n_axes = experiment.axes.len();
        let pairs =
            self.residuals.iter().zip(&self.measured).map(|(r, measured)| [r + measured, *measured]).enumerate();
        let pairs: Vec<[f64; 2]> =
            pairs.filter(|(k, _)| k % n_axes < experiment.n_norm).map(|(_, pair)| pair).collect();
        let usual = root_mean_square(&pairs.iter().map(|pair| pair[0]).collect::<Vec<f64>>());
        let large = pairs.iter().filter(|[predicted, _]| predicted.abs() > 0.5 * usual);
        median(large.map(|[predicted, measured]| measured / predicted)).filter(|ratio| *ratio > 0.0)
    }
}

/// Rows × axes less the mean of each axis.
fn variation(experiment: &Experiment, rows: &[f64]) -> Vec<f64> {
    let n_axes = experiment.axes.len();
    let n_rows = (rows.len() / n_axes).max(1) as f64;
    let mean: Vec<f64> = (0..n_axes).map(|axis| rows.iter().skip(axis).step_by(n_axes).sum::<f64>() / n_rows).collect();
    rows.iter().enumerate().map(|(k, number)| number - mean[k % n_axes]).collect()
}

/// How much rows × axes vary.
fn varies(experiment: &Experiment, rows: &[f64]) -> f64 {
    size(experiment, &variation(experiment, rows))
}

/// Root mean square of the norm of rows × axes, without what is far off on each axis.
pub(crate) fn size(experiment: &Experiment, rows: &[f64]) -> f64 {
    let n_axes = experiment.axes.len();
    (0..experiment.n_norm).map(|axis| trimmed_of_axis(rows, axis, n_axes).powi(2)).sum::<f64>().sqrt()
}

/// Root mean square of one axis of rows × axes, without what is far off.
fn trimmed_of_axis(rows: &[f64], axis: usize, n_axes: usize) -> f64 {
    trimmed_root_mean_square(rows.iter().skip(axis).step_by(n_axes).copied().collect())
}

fn otherwise(misreading: Misreading, error: f64, experiment: &Experiment) -> Agreement {
    let error = Number::new(error, experiment.unit());
    Agreement::Otherwise(OtherReading { misreading, error })
}

/// A table and its model, which may be read in other ways.
struct Comparison<'a> {
    model: &'a Model,
    data: &'a Prepared,
}

/// A hypothesis with what it leaves.
struct Tried {
    left: Left,
    hypothesis: Hypothesis,
}

impl Comparison<'_> {
    /// The best of these hypotheses, where it explains far more than the table as it is read and most of what was measured, and
    /// its error.
    fn better(&self, hypotheses: Vec<Hypothesis>, columns: &Columns) -> Option<(f64, Misreading)> {
        let n_tried = hypotheses.len() as f64;
        let is_chance = |as_read: &Left, left: &Left| as_read.chance_of_fall_to(left) * n_tried >= DISCOVERY_LEVEL;
        let mut tried = self.tried(hypotheses, |_| Laws::None);
        let mut as_read = AsRead { comparison: self, left: BTreeMap::new() };
        let without_laws = tried.iter().position(|Tried { left, hypothesis }| {
            as_read.left(hypothesis, Laws::None).is_some_and(|as_read| {
                let is_near = left.share < AGREES || left.share < FOLLOWS && OTHER_UNIT * left.norm < as_read.norm;
                is_near && left.norm < MUCH_LESS_AS_IT_IS * as_read.norm && !is_chance(as_read, left)
            })
        });
        if let Some(best) = without_laws {
            return self.refined(tried.swap_remove(best), columns, Laws::None);
        }
        // Friction that the model does not have hides what a short delay changes.
        let is_compared = |(rank, tried): &(usize, Tried)| *rank < COMPARED || tried.hypothesis.is_short_delay();
        let compared = tried.into_iter().enumerate().filter(is_compared);
        let hypotheses = compared.map(|(_, tried)| tried.hypothesis).collect();
        let far_better = |Tried { left, hypothesis }: &Tried| {
            left.share < AGREES
                && as_read
                    .left(hypothesis, Laws::compared_with(&hypothesis.misreading))
                    .is_some_and(|as_read| left.log < as_read.log - MUCH_LESS.ln() && !is_chance(as_read, left))
        };
        let best = self.tried(hypotheses, Laws::compared_with).into_iter().find(far_better)?;
        let laws = Laws::compared_with(&best.hypothesis.misreading);
        self.refined(best, columns, laws)
    }

    /// A delay with those around it tried too; any other reading as it is.
    fn refined(&self, best: Tried, columns: &Columns, laws: Laws) -> Option<(f64, Misreading)> {
        let best = match best.hypothesis.misreading {
            Misreading::Delay { delay_s } => {
                self.tried(around(self.data, &columns.measured.concat(), delay_s), |_| laws).into_iter().next()?
            }
            _ => best,
        };
        Some((best.left.norm, best.hypothesis.misreading))
    }

    /// Hypotheses with what they leave, the best one first.
    fn tried(&self, hypotheses: Vec<Hypothesis>, laws: impl Fn(&Misreading) -> Laws + Sync) -> Vec<Tried> {
        let tried = hypotheses.into_par_iter().filter_map(|hypothesis| {
            let Hypothesis { misreading, columns, model } = &hypothesis;
            let left = self.left(columns, columns.rows_later(), model.as_ref(), laws(misreading))?;
            Some(Tried { left, hypothesis })
        });
        let mut tried: Vec<Tried> = tried.collect();
        tried.sort_by(|a, b| a.left.log.total_cmp(&b.left.log));
        tried
    }

    /// What a reading leaves with these laws, in rows from which the one `rows_later` is in the same stretch; `None` where
    /// it gives no experiment.
    fn left(&self, reading: &ColumnReading, rows_later: isize, model: Option<&Model>, laws: Laws) -> Option<Left> {
        let data = self.data.read_as(reading.clone(), rows_later, ROWS);
        let experiment = linearise(model.unwrap_or(self.model), &data).ok()?;
        let measured = variation(&experiment, &Training::of(&experiment)?.measured);
        let (n_axes, n_norm) = (experiment.axes.len(), experiment.n_norm);
        let groups = Groups::new(&experiment.rows);
        let blocks = groups.blocks.clone();
        if groups.n_blocks < MIN_PIECES {
            return None;
        }
        let residuals = match laws {
            Laws::None => experiment.of_rows(&experiment.residuals, false),
            Laws::All => predicted_in_turn(experiment, groups, None),
            Laws::AllBut(law) => predicted_in_turn(experiment, groups, Some(law)),
        };
        let of = |numbers: &[f64], axis: usize| trimmed_of_axis(numbers, axis, n_axes);
        let axes: Vec<AxisLeft> = (0..n_norm)
            .map(|axis| AxisLeft { axis, left: of(&residuals, axis), measured: of(&measured, axis) })
            .filter(|axis| axis.measured > 0.0)
            .collect();
        Left::of(&axes, &residuals, n_axes, &blocks)
    }
}

/// What a table leaves as it is read: many hypotheses are judged by the same rows and laws.
struct AsRead<'a> {
    comparison: &'a Comparison<'a>,
    left: BTreeMap<(isize, Laws), Option<Left>>,
}

impl AsRead<'_> {
    /// In the rows that a hypothesis was judged by.
    fn left(&mut self, hypothesis: &Hypothesis, laws: Laws) -> Option<&Left> {
        let rows_later = hypothesis.columns.rows_later();
        let compute = || self.comparison.left(&ColumnReading::default(), rows_later, None, laws);
        self.left.entry((rows_later, laws)).or_insert_with(compute).as_ref()
    }
}

/// The errors of one axis.
struct AxisLeft {
    axis: usize,
    left: f64,
    measured: f64,
}

/// Laws that a model is fitted with, each at all its places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Laws {
    None,
    All,
    AllBut(Law),
}

impl Laws {
    /// All but the law that would do the same as a reading.
    fn compared_with(misreading: &Misreading) -> Self {
        match misreading {
            Misreading::Delay { .. } => Self::AllBut(Law::Delay),
            Misreading::InvertedColumns { .. } => Self::AllBut(Law::Gain),
            _ => Self::All,
        }
    }
}

/// Residuals of the training rows, each of a fit with every law at every place that has not seen it; a law that fits best
/// with an impossible size, a friction below zero, is left out.
fn predicted_in_turn(experiment: Experiment, groups: Groups, without: Option<Law>) -> Vec<f64> {
    let problem = Signals::new(experiment, groups);
    let candidates = &problem.experiment.candidates;
    let mut laws = every_law(&problem, &[]);
    laws.retain(|&k| Some(candidates[k].law) != without);
    let mut best = problem.fitted(laws);
    for _ in 0..MAX_ROUNDS {
        let can_be = |k: &usize| {
            let values = problem.indices(&[*k]).into_iter().zip(&candidates[*k].values);
            values.into_iter().all(|(index, value)| best.fit.values[index] >= value.min)
        };
        let possible: Vec<usize> = best.fit.active.iter().copied().filter(can_be).collect();
        if possible.len() == best.fit.active.len() {
            break;
        }
        best = problem.fitted(possible);
    }
    best.predicted
}

/// What is left by a reading.
struct Left {
    /// Sum over the axes of the norm of the logarithm of the error as a share of what was measured.
    log: f64,
    /// Root mean square of these axes together.
    norm: f64,
    /// The same as a share of what was measured.
    share: f64,
    /// Sum over the axes of the logarithm of the error in each piece of rows, rows that are far off drawn near.
    pieces: Vec<f64>,
}

impl Left {
    /// By the errors of the axes; `None` where nothing was measured.
    fn of(axes: &[AxisLeft], residuals: &[f64], n_axes: usize, blocks: &[usize]) -> Option<Self> {
        let log: f64 = axes.iter().map(|axis| (axis.left / axis.measured).max(f64::MIN_POSITIVE).ln()).sum();
        let rows: Vec<(&[f64], usize)> = residuals.chunks(n_axes).zip(blocks.iter().copied()).collect();
        let of_piece = |piece: &[(&[f64], usize)]| {
            let square = |axis: &AxisLeft| {
                let near = piece.iter().map(|(row, _)| row[axis.axis].abs().min(FAR * axis.left).powi(2));
                near.sum::<f64>() / piece.len() as f64
            };
            axes.iter().map(|axis| 0.5 * square(axis).max(f64::MIN_POSITIVE).ln()).sum()
        };
        let norm = |of: fn(&AxisLeft) -> f64| axes.iter().map(|axis| of(axis).powi(2)).sum::<f64>().sqrt();
        (!axes.is_empty() && log.is_finite()).then_some(Self {
            log,
            norm: norm(|axis| axis.left),
            share: norm(|axis| axis.left) / norm(|axis| axis.measured),
            pieces: rows.chunk_by(|a, b| a.1 == b.1).map(of_piece).collect(),
        })
    }

    /// The chance of as large a fall to what another reading of the same rows leaves.
    fn chance_of_fall_to(&self, other: &Self) -> f64 {
        let falls: Vec<f64> = self.pieces.iter().zip(&other.pieces).map(|(own, other)| own - other).collect();
        chance_of_mean(&falls)
    }
}
