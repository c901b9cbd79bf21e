//! Whether signals agree with their model, read as they are or in another way.

use std::f64::consts::FRAC_PI_2;

use super::column_readings::{hypotheses, quaternions, units};
use super::comparison::{AxisLeft, Comparison, Improvement, Laws};
use super::training::{Training, size, variation};
use super::{Agreement, FEW};
use crate::effect::LawName;
use crate::linearise::experiment::Experiment;
use crate::linearise::model::Model;
use crate::linearise::model_effects::ModelEffect;
use crate::linearise::{columns, measured_tool};
use crate::misreading::Misreading;
use crate::outcome::{Number, OtherReading};
use crate::prepare::signals::Prepared;
use crate::progress::{Cancelled, Progress};

/// A model whose error is below this share of what was measured, on every axis, belongs to its log.
const NEAR: f64 = 0.1;
/// Share of the variance that a model explains whose error is larger than what was measured varies, by far: rough models of a
/// robot have neither friction nor motors, and explain little.
const WORSE_THAN_NONE: f64 = -1.0;

/// A tool whose turns are off by less than this share under another order of its quaternion was written in that order.
const MUCH_LESS_TURNED: f64 = 0.25;

/// How the training rows of a table agree with its model; `experiment` is of the table as it is read.
///
/// # Errors
///
/// The diagnosis was given up.
pub(crate) fn agreement(
    model: &Model,
    data: &Prepared,
    experiment: &Experiment,
    progress: &Progress,
) -> Result<FirstLook, Cancelled> {
    if experiment.kind.is_of_tool() {
        // The frame of an instrument that measures a tool may be anywhere: only the model with what was found is compared, and
        // the turns of the tool.
        return Ok(quaternion_reading(data, experiment).map_or(Agreement::AsRead, Agreement::Otherwise).into());
    }
    let Some(training) = Training::of(experiment) else { return Ok(Agreement::AsRead.into()) };
    let is_near = (0..experiment.n_norm).all(|axis| training.share(experiment, axis) < NEAR);
    if is_near {
        return Ok(Agreement::AsRead.into());
    }
    let columns = columns(model, data);
    if let Some((factor, error)) = training.other_unit(experiment) {
        // Of a wrench the norm is the centre of pressure, which moments are in.
        let columns = columns.measured.iter().filter_map(|group| group.last().cloned()).collect();
        let misreading = Misreading::ColumnScale { columns, factor };
        return Ok(Agreement::Otherwise(other_reading(misreading, error, experiment)).into());
    }
    let (comparison, tests_the_model) = (Comparison { model, data, progress }, training.tests_the_model(experiment));
    let tried = if tests_the_model { hypotheses(model, data, &columns) } else { units(&columns) };
    let better = comparison.better(tried, &columns)?;
    let reading = |better: &Improvement| {
        other_reading(better.tried.hypothesis.misreading.clone(), better.tried.left.norm, experiment)
    };
    if let Some(better) = better.as_ref().filter(|better| better.laws != Laws::All) {
        return Ok(Agreement::Otherwise(reading(better)).into());
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
    Ok(FirstLook { agreement, contest })
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
    /// What it leaves, as [`ResidualError::log`].
    log: f64,
}

impl Contest {
    /// The reading, unless a model of these effects leaves no more of the training rows and does not say the same in other
    /// words; `unseen` are its residuals of these rows, each of a fit that has not seen the row.
    pub(crate) fn lost(self, experiment: &Experiment, unseen: &[f64], effects: &[ModelEffect]) -> Option<OtherReading> {
        let training = Training::of(experiment)?;
        let measured = variation(experiment, &training.measured);
        let axes = AxisLeft::of_norm(experiment.n_norm, experiment.axes.len(), unseen, &measured);
        let log: f64 = axes.iter().map(AxisLeft::log).sum();
        (log > self.log || effects.iter().any(|effect| self.is_said_by(effect))).then_some(self.reading)
    }

    /// Whether an effect moves a joint or the base at least half as far as the reading does.
    fn is_said_by(&self, effect: &ModelEffect) -> bool {
        let angle = match (&self.reading.misreading, effect.law) {
            (Misreading::OtherZero { zero, .. }, LawName::JointOffset) => zero.abs(),
            (Misreading::Mounting { .. }, LawName::BaseTilt) => FRAC_PI_2,
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

fn other_reading(misreading: Misreading, error: f64, experiment: &Experiment) -> OtherReading {
    OtherReading { misreading, as_read: None, error: Number::new(error, experiment.unit()) }
}

/// The order or sense of the quaternion in which the tool turns as it is predicted to, where it does not as it is read.
fn quaternion_reading(data: &Prepared, experiment: &Experiment) -> Option<OtherReading> {
    let error = |read: &Prepared| measured_tool::turn_error(data, experiment, read);
    let as_read = error(data)?;
    let read = quaternions()
        .into_iter()
        .filter_map(|(misreading, columns)| Some((misreading, error(&data.read_as(columns, 0, usize::MAX))?)));
    let (misreading, error) = read.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let rad = |error| Number::new(error, "rad");
    let reading = OtherReading { misreading, as_read: Some(rad(as_read)), error: rad(error) };
    (error < MUCH_LESS_TURNED * as_read).then_some(reading)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::linearise::experiment::{Axis, Curvature};
    use crate::measured::Measured;
    use crate::prepare::groups::SignalRow;

    const ROWS: usize = 200;

    /// What a contest says of a model that leaves this share of what was measured, with these effects; the reading leaves a
    /// hundredth.
    fn is_lost(left: f64, effects: &[ModelEffect]) -> bool {
        let measured: Vec<f64> = (0..ROWS).map(|k| (k as f64 * 0.7).sin()).collect();
        let row = |k: usize| SignalRow { line: k, time_s: k as f64, series: 0, motion: 0, key: None, held_out: false };
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
        let unseen: Vec<f64> = measured.iter().map(|measured| left * measured).collect();
        contest.lost(&experiment, &unseen, effects).is_some()
    }

    fn joint_offset(angle: f64) -> ModelEffect {
        let values = BTreeMap::from([("offset".to_string(), angle)]);
        let place = "joint 1".to_string();
        ModelEffect { law: LawName::JointOffset, place, constant: None, values, along: None, points: Vec::new() }
    }

    #[test]
    fn a_reading_wins_where_the_model_found_leaves_more_or_says_the_same() {
        assert!(is_lost(0.02, &[]), "the model leaves twice as much");
        assert!(!is_lost(0.005, &[joint_offset(0.05)]), "the model leaves half as much");
        assert!(is_lost(0.005, &[joint_offset(1.5)]), "an offset of 86 deg is a zero 90 deg away");
    }
}
