//! Whether signals agree with their model, read as they are or in another way.
//!
//! Models of robots are rough before they are identified: friction is missing and masses are guesses. So readings are compared
//! by what is left with every law at every place, on rows that are left out in turn: the sum over the axes of the logarithm of
//! the error as a share of what was measured, which another unit does not change.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::{IntoParallelIterator as _, ParallelIterator as _};

use super::column_readings::{Reading, around, readings};
use super::{Agreement, FEW, trimmed_root_mean_square};
use crate::effect::Law;
use crate::linearise::experiment::{Columns, Experiment};
use crate::linearise::model::Model;
use crate::linearise::{columns, linearise};
use crate::measurement::median;
use crate::misreading::Misreading;
use crate::outcome::{Number, OtherReading};
use crate::prepare::groups::Groups;
use crate::prepare::signals::Prepared;
use crate::select::backward::every_law;
use crate::select::signals::Signals;

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
/// Least variation of what is predicted, as a share of the error, with which an error says that a model is wrong.
const MIN_VARIATION: f64 = 0.5;
/// Error under another reading as a share of what was measured, at the most on every axis.
const AGREES: f64 = 0.5;
/// Factor between measured and predicted signals from which on they are in different units.
const OTHER_UNIT: f64 = 20.0;
/// Correlation of measured and predicted from which on their ratio is that of units.
const CORRELATED: f64 = 0.9;
/// Readings that are compared with every law, the best ones of the model as it is.
const COMPARED: usize = 12;

/// How the training rows of a table agree with its model; `experiment` is of the table as it is read.
pub(crate) fn agreement(model: &Model, data: &Prepared, experiment: &Experiment) -> Agreement {
    let Some(training) = Training::of(experiment) else { return Agreement::AsRead };
    let is_near = (0..experiment.n_norm).all(|axis| training.share(experiment, axis) < NEAR);
    if is_near {
        return Agreement::AsRead;
    }
    let error = norm(experiment, &training.residuals);
    if !training.tests_the_model(experiment, error) {
        // A constant error that is larger than all that was measured is no effect: the model is another robot's.
        return if error > norm(experiment, &training.measured) { Agreement::Hardly(0) } else { Agreement::AsRead };
    }
    let columns = columns(model, data);
    if let Some(factor) = training.ratio(experiment).filter(|factor| factor.ln().abs() > OTHER_UNIT.ln()) {
        // Of a wrench the norm is the centre of pressure, which moments are in.
        let scaled = columns.measured.iter().filter_map(|group| group.last().cloned()).collect();
        return training.in_another_unit(experiment, scaled, factor);
    }
    let comparison = Comparison { model, data };
    match comparison.better(readings(model, data, &columns), &columns) {
        Some((own, misreading)) => otherwise(misreading, own.norm, experiment),
        None if explained(experiment, error) < WORSE_THAN_NONE => Agreement::Hardly(FEW),
        None => Agreement::AsRead,
    }
}

/// Share of the variance of the training rows that a model with this error explains, by the norm; 1 where nothing but
/// differences is measured, or nothing is predicted but a constant.
pub(crate) fn explained(experiment: &Experiment, error: f64) -> f64 {
    match Training::of(experiment).filter(|training| training.tests_the_model(experiment, error)) {
        None => 1.0,
        Some(training) => {
            let varies = norm(experiment, &variation(experiment, &training.measured));
            1.0 - (error / varies.max(f64::MIN_POSITIVE)).powi(2)
        }
    }
}

/// The rows that fits see of what was predicted and measured: rows × axes.
struct Training {
    residuals: Vec<f64>,
    measured: Vec<f64>,
}

impl Training {
    /// Those of an experiment; `None` where nothing but differences is measured.
    fn of(experiment: &Experiment) -> Option<Self> {
        let residuals = experiment.of_rows(&experiment.residuals, false);
        Some(Self { residuals, measured: experiment.of_rows(experiment.measured.as_ref()?, false) })
    }

    /// Whether what is predicted varies enough for an error of this size to say that the model is wrong: at rest it does not.
    fn tests_the_model(&self, experiment: &Experiment, error: f64) -> bool {
        let predicted: Vec<f64> = self.residuals.iter().zip(&self.measured).map(|(r, measured)| r + measured).collect();
        norm(experiment, &variation(experiment, &predicted)) > MIN_VARIATION * error
    }

    /// The error of an axis as a share of how much it varies.
    fn share(&self, experiment: &Experiment, axis: usize) -> f64 {
        let varies = experiment.mean_square(&variation(experiment, &self.measured), axis);
        (experiment.mean_square(&self.residuals, axis) / varies).sqrt()
    }

    /// How many times what is predicted was measured, axes of the norm together; `None` where both hardly correlate.
    fn ratio(&self, experiment: &Experiment) -> Option<f64> {
        let n_axes = experiment.axes.len();
        let of_norm = |(k, (residual, measured)): (usize, (&f64, &f64))| {
            (k % n_axes < experiment.n_norm).then_some([residual + measured, *measured])
        };
        let pairs: Vec<[f64; 2]> = self.residuals.iter().zip(&self.measured).enumerate().filter_map(of_norm).collect();
        let sum = |a: usize, b: usize| pairs.iter().map(|pair| pair[a] * pair[b]).sum::<f64>();
        let correlation = sum(0, 1) / (sum(0, 0) * sum(1, 1)).sqrt();
        let usual = (sum(0, 0) / pairs.len().max(1) as f64).sqrt();
        let large = pairs.iter().filter(|[predicted, _]| predicted.abs() > 0.5 * usual);
        let ratio = median(large.map(|[predicted, measured]| measured / predicted))?;
        (correlation > CORRELATED && ratio > 0.0).then_some(ratio)
    }

    /// That what was measured is `factor` times what is predicted.
    fn in_another_unit(&self, experiment: &Experiment, columns: Vec<String>, factor: f64) -> Agreement {
        let pairs = self.residuals.iter().zip(&self.measured);
        let read: Vec<f64> = pairs.map(|(residual, measured)| residual + measured * (1.0 - 1.0 / factor)).collect();
        otherwise(Misreading::ColumnScale { columns, factor }, norm(experiment, &read), experiment)
    }
}

/// Rows × axes less the mean of each axis.
fn variation(experiment: &Experiment, rows: &[f64]) -> Vec<f64> {
    let n_axes = experiment.axes.len();
    let n_rows = (rows.len() / n_axes).max(1) as f64;
    let mean: Vec<f64> = (0..n_axes).map(|axis| rows.iter().skip(axis).step_by(n_axes).sum::<f64>() / n_rows).collect();
    rows.iter().enumerate().map(|(k, number)| number - mean[k % n_axes]).collect()
}

/// Root mean square of the norm; 0 without rows.
fn norm(experiment: &Experiment, rows: &[f64]) -> f64 {
    experiment.norm(rows).unwrap_or_default()
}

fn otherwise(misreading: Misreading, error: f64, experiment: &Experiment) -> Agreement {
    let error = Number { value: error, unit: experiment.unit() };
    Agreement::Otherwise(OtherReading { misreading, error })
}

/// A table and its model, which may be read in other ways.
struct Comparison<'a> {
    model: &'a Model,
    data: &'a Prepared,
}

impl Comparison<'_> {
    /// The best of these readings, where it explains far more than the table as it is read, and most of it.
    fn better(&self, readings: Vec<Reading>, columns: &Columns) -> Option<(Left, Misreading)> {
        let as_read = self.left(&Reading::as_it_is(), Laws::None)?;
        let mut tried = self.best(readings, |_| Laws::None);
        if tried.first()?.0.norm < MUCH_LESS_AS_IT_IS * as_read.norm {
            let (own, reading) = self.refined(tried.swap_remove(0), columns, Laws::None)?;
            return Some((own, reading.misreading));
        }
        tried.truncate(COMPARED);
        let tried = self.best(tried.into_iter().map(|(_, reading)| reading).collect(), Laws::compared_with);
        let sets =
            tried.iter().map(|(_, reading)| Laws::compared_with(&reading.misreading)).collect::<BTreeSet<Laws>>();
        let as_read: BTreeMap<Laws, Left> =
            sets.into_iter().filter_map(|laws| Some((laws, self.left(&Reading::as_it_is(), laws)?))).collect();
        let far_better = |(own, reading): &(Left, Reading)| {
            let as_read = as_read.get(&Laws::compared_with(&reading.misreading));
            own.worst < AGREES && as_read.is_some_and(|as_read| own.log < as_read.log - MUCH_LESS.ln())
        };
        let best = tried.into_iter().find(far_better)?;
        let laws = Laws::compared_with(&best.1.misreading);
        let (own, reading) = self.refined(best, columns, laws)?;
        Some((own, reading.misreading))
    }

    /// A delay with those around it tried too; any other reading as it is.
    fn refined(&self, best: (Left, Reading), columns: &Columns, laws: Laws) -> Option<(Left, Reading)> {
        let Misreading::Delay { delay_s } = best.1.misreading else { return Some(best) };
        self.best(around(self.data, &columns.measured.concat(), delay_s), |_| laws).into_iter().next()
    }

    /// Readings with what they leave, the best one first.
    fn best(&self, readings: Vec<Reading>, laws: impl Fn(&Misreading) -> Laws + Sync) -> Vec<(Left, Reading)> {
        let left = |reading: Reading| Some((self.left(&reading, laws(&reading.misreading))?, reading));
        let tried = readings.into_par_iter().filter_map(left);
        let mut tried: Vec<(Left, Reading)> = tried.collect();
        tried.sort_by(|a, b| a.0.log.total_cmp(&b.0.log));
        tried
    }

    /// What a reading leaves with these laws; `None` where it gives no experiment.
    fn left(&self, reading: &Reading, laws: Laws) -> Option<Left> {
        let mut data = self.data.read_as(reading.columns.clone(), ROWS);
        let experiment = linearise(reading.model.as_ref().unwrap_or(self.model), &mut data).ok()?;
        let (n_axes, n_norm) = (experiment.axes.len(), experiment.n_norm);
        let measured = variation(&experiment, &Training::of(&experiment)?.measured);
        let predicted = match laws {
            Laws::None => experiment.of_rows(&experiment.residuals, false),
            Laws::All => predicted_in_turn(experiment, None),
            Laws::AllBut(law) => predicted_in_turn(experiment, Some(law)),
        };
        let of = |numbers: &[f64], axis: usize| {
            trimmed_root_mean_square(numbers.iter().skip(axis).step_by(n_axes).copied().collect())
        };
        let axes = (0..n_norm).map(|axis| [of(&predicted, axis), of(&measured, axis)]).filter(|[_, all]| *all > 0.0);
        let log: f64 = axes.clone().map(|[left, all]| (left / all).max(f64::MIN_POSITIVE).ln()).sum();
        let norm = axes.clone().map(|[left, _]| left * left).sum::<f64>().sqrt();
        let worst = axes.map(|[left, all]| left / all).fold(0.0, f64::max);
        log.is_finite().then_some(Left { log, norm, worst })
    }
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

/// Residuals of the training rows, each of a fit with every law at every place that has not seen it.
fn predicted_in_turn(experiment: Experiment, without: Option<Law>) -> Vec<f64> {
    let groups = Groups::new(&experiment.rows);
    let problem = Signals::new(experiment, groups);
    let mut laws = every_law(&problem, &[]);
    laws.retain(|&k| Some(problem.experiment.candidates[k].law) != without);
    let best = problem.fitted(laws);
    let sigma = &best.weighting().sigma;
    best.predicted.iter().enumerate().map(|(k, residual)| residual * sigma[k % sigma.len()]).collect()
}

/// What is left by a reading.
struct Left {
    /// Sum over the axes of the norm of the logarithm of the error as a share of what was measured.
    log: f64,
    /// Root mean square of these axes together.
    norm: f64,
    /// The largest error of an axis as a share of what was measured there.
    worst: f64,
}
