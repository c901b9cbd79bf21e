//! Whether signals agree with their model, read as they are or in another way.

use std::f64::consts::FRAC_PI_2;

use super::column_readings::{hypotheses, units};
use super::comparison::{AxisLeft, Better, Comparison, Laws};
use super::{Agreement, FEW, trimmed_root_mean_square};
use crate::effect::Law;
use crate::linearise::columns;
use crate::linearise::experiment::Experiment;
use crate::linearise::model::Model;
use crate::linearise::model_effects::ModelEffect;
use crate::measurement::{median, root_mean_square};
use crate::misreading::Misreading;
use crate::outcome::{Number, OtherReading};
use crate::prepare::signals::Prepared;

/// A model whose error is below this share of what was measured, on every axis, belongs to its log.
const NEAR: f64 = 0.1;
/// Share of the variance that a model explains whose error is larger than what was measured varies, by far: rough models of a
/// robot have neither friction nor motors, and explain little.
const WORSE_THAN_NONE: f64 = -1.0;
/// Least variation of what is predicted, as a share of that of the error, with which an error says that a model is wrong.
const MIN_VARIATION: f64 = 0.25;
/// Error under another reading as a share of what was measured, at the most.
pub(super) const AGREES: f64 = 0.5;
/// What remains of the variation of a log in another unit, as a share, at the most.
pub(super) const FOLLOWS: f64 = 0.9;
/// Factor between measured and predicted signals from which on they are in different units.
pub(super) const OTHER_UNIT: f64 = 20.0;

/// How the training rows of a table agree with its model; `experiment` is of the table as it is read.
pub(crate) fn agreement(model: &Model, data: &Prepared, experiment: &Experiment) -> FirstLook {
    let Some(training) = Training::of(experiment) else { return Agreement::AsRead.into() };
    let is_near = (0..experiment.n_norm).all(|axis| training.share(experiment, axis) < NEAR);
    if is_near {
        return Agreement::AsRead.into();
    }
    let columns = columns(model, data);
    if let Some((factor, error)) = training.other_unit(experiment) {
        // Of a wrench the norm is the centre of pressure, which moments are in.
        let columns = columns.measured.iter().filter_map(|group| group.last().cloned()).collect();
        let misreading = Misreading::ColumnScale { columns, factor };
        return Agreement::Otherwise(other_reading(misreading, error, experiment)).into();
    }
    let (comparison, tests_the_model) = (Comparison { model, data }, training.tests_the_model(experiment));
    let tried = if tests_the_model { hypotheses(model, data, &columns) } else { units(&columns) };
    let better = comparison.better(tried, &columns);
    let reading =
        |better: &Better| other_reading(better.tried.hypothesis.misreading.clone(), better.tried.left.norm, experiment);
    if let Some(better) = better.as_ref().filter(|better| better.laws != Laws::All) {
        return Agreement::Otherwise(reading(better)).into();
    }
    let agreement = match () {
        () if !tests_the_model => {
            // A constant error that is larger than all that was measured is no effect: the model is another robot's.
            let is_worse = size(experiment, &training.residuals) > size(experiment, &training.measured);
            if is_worse { Agreement::Hardly(0) } else { Agreement::AsRead }
        }
        () if training.explained(experiment, &training.residuals) < WORSE_THAN_NONE => Agreement::Hardly(FEW),
        () => Agreement::AsRead,
    };
    let contest = better.map(|better| Contest { reading: reading(&better), log: better.tried.left.log });
    FirstLook { agreement, contest }
}

/// How a table agrees with its model before any effect is searched.
#[derive(Clone, Debug)]
pub(crate) struct FirstLook {
    /// As it is read.
    pub(crate) agreement: Agreement,
    /// A reading that may be the right one instead.
    pub(crate) contest: Option<Contest>,
}

impl From<Agreement> for FirstLook {
    fn from(agreement: Agreement) -> Self {
        Self { agreement, contest: None }
    }
}

/// A reading that leaves far less than the table as it is read, both with every law. These are straight lines there: where joints,
/// base and bodies are off together a few effects with their true shapes may leave still less.
#[derive(Clone, Debug)]
pub(crate) struct Contest {
    reading: OtherReading,
    /// What it leaves, as [`Left::log`].
    log: f64,
}

impl Contest {
    /// The reading, unless a model of these effects leaves no more of the training rows, `predicted` by fits that have not seen
    /// them, and does not say the same in other words.
    pub(crate) fn lost(
        self,
        experiment: &Experiment,
        predicted: &[f64],
        effects: &[ModelEffect],
    ) -> Option<OtherReading> {
        let training = Training::of(experiment)?;
        let measured = variation(experiment, &training.measured);
        let n_axes = experiment.axes.len();
        let axis = |axis: usize| {
            let [left, measured] = [predicted, &measured].map(|rows| trimmed_of_axis(rows, axis, n_axes));
            (measured > 0.0).then(|| AxisLeft { axis, left, measured }.log())
        };
        let log: f64 = (0..experiment.n_norm).filter_map(axis).sum();
        (log > self.log || effects.iter().any(|effect| self.is_said_by(effect))).then_some(self.reading)
    }

    /// Whether an effect moves a joint or the base at least half as far as the reading does.
    fn is_said_by(&self, effect: &ModelEffect) -> bool {
        let angle = match (&self.reading.misreading, effect.law) {
            (Misreading::OtherZero { zero, .. }, Law::JointOffset) => zero.abs(),
            (Misreading::Mounting { .. }, Law::BaseTilt) => FRAC_PI_2,
            _ => return false,
        };
        effect.values.values().map(|value| value * value).sum::<f64>().sqrt() > 0.5 * angle
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
pub(super) struct Training {
    residuals: Vec<f64>,
    pub(super) measured: Vec<f64>,
}

impl Training {
    /// Those of an experiment; `None` where nothing but differences is measured.
    pub(super) fn of(experiment: &Experiment) -> Option<Self> {
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
pub(super) fn variation(experiment: &Experiment, rows: &[f64]) -> Vec<f64> {
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
pub(super) fn trimmed_of_axis(rows: &[f64], axis: usize, n_axes: usize) -> f64 {
    trimmed_root_mean_square(rows.iter().skip(axis).step_by(n_axes).copied().collect())
}

fn other_reading(misreading: Misreading, error: f64, experiment: &Experiment) -> OtherReading {
    OtherReading { misreading, error: Number::new(error, experiment.unit()) }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::linearise::experiment::{Axis, Curvature};
    use crate::measured::Measured;
    use crate::prepare::groups::Row;

    const ROWS: usize = 200;

    /// What a contest says of a model that leaves this share of what was measured, with these effects; the reading leaves a
    /// hundredth.
    fn is_lost(left: f64, effects: &[ModelEffect]) -> bool {
        let measured: Vec<f64> = (0..ROWS).map(|k| (k as f64 * 0.7).sin()).collect();
        let row = |k: usize| Row { line: k, time_s: k as f64, series: 0, motion: 0, key: None, held_out: false };
        let experiment = Experiment {
            kind: Measured::JointTorque,
            axes: vec![Axis::new("joint 1", "N·m")],
            n_norm: 1,
            rows: (0..ROWS).map(row).collect(),
            residuals: measured.clone(),
            measured: Some(measured.clone()),
            candidates: Vec::new(),
            channels: Vec::new(),
            bodies: Vec::new(),
            findings: Vec::new(),
            curvature: Curvature::None,
        };
        let misreading = Misreading::OtherZero { column: "q1".into(), zero: FRAC_PI_2 };
        let contest = Contest { reading: other_reading(misreading, 0.007, &experiment), log: 0.01f64.ln() };
        let predicted: Vec<f64> = measured.iter().map(|measured| left * measured).collect();
        contest.lost(&experiment, &predicted, effects).is_some()
    }

    fn joint_offset(angle: f64) -> ModelEffect {
        let values = BTreeMap::from([("offset".to_string(), angle)]);
        let place = "joint 1".to_string();
        ModelEffect { law: Law::JointOffset, place, constant: None, values, along: None, points: Vec::new() }
    }

    #[test]
    fn a_reading_wins_where_the_model_found_leaves_more_or_says_the_same() {
        assert!(is_lost(0.02, &[]), "the model leaves twice as much");
        assert!(!is_lost(0.005, &[joint_offset(0.05)]), "the model leaves half as much");
        assert!(is_lost(0.005, &[joint_offset(1.5)]), "an offset of 86 deg is a zero 90 deg away");
    }
}
