//! Effects that a model of channels has: written after a diagnosis, in the prediction of the next.
//!
//! ```toml
//! [[effect]]
//! law = "coulomb-friction"
//! where = "joint 3 (joint_3)"
//! constant = 0.16          # of a law that has one, in SI units
//! values = { level = 1.93 }
//!
//! [[effect]]
//! law = "fitted-term"      # no law: what remained of an axis along a channel, straight between points
//! where = "joint 6: position of joint 4"
//! points = [[-0.7, 0.0], [0.1, 0.02], [0.9, 0.31]]
//! ```

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::linearise::experiment::{Candidate, Experiment};
use crate::linearise::model::ModelError;
use crate::outcome_signals::{Diagnosis, Term};
use crate::signals::ChannelError;

/// One effect with all its values, in SI units and radians.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Known {
    /// The law.
    pub law: String,
    /// Where it acts.
    #[serde(rename = "where")]
    pub place: String,
    /// The number in its shape.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub constant: Option<f64>,
    /// Its values by their names.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, f64>,
    /// Of a fitted term: the channel, and what it adds to the prediction there; held beyond the ends.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<[f64; 2]>,
}

/// The law of what has none.
const FITTED_TERM: &str = "fitted-term";

impl Known {
    /// The effect that a candidate becomes with these values.
    pub(crate) fn of(candidate: &Candidate, values: &[f64]) -> Self {
        Self {
            law: candidate.law.into(),
            place: candidate.place.clone(),
            constant: candidate.shape.as_ref().map(|(_, constant, _)| *constant),
            values: candidate.values.iter().zip(values).map(|(value, size)| (value.name.clone(), *size)).collect(),
            points: Vec::new(),
        }
    }

    /// What takes a term out of the residual.
    pub(crate) fn fitted(term: &Term) -> Self {
        Self {
            law: FITTED_TERM.into(),
            place: format!("{}: {}", term.axis, term.channel),
            constant: None,
            values: BTreeMap::new(),
            points: term.curve.iter().map(|[at, remains]| [*at, -remains]).collect(),
        }
    }

    /// What a fitted term adds at this value of its channel.
    fn at(&self, channel: f64) -> f64 {
        let above = self.points.partition_point(|[at, _]| *at < channel);
        match (above.checked_sub(1).map(|below| self.points[below]), self.points.get(above)) {
            (Some([low, a]), Some(&[high, b])) => a + (b - a) * (channel - low) / (high - low),
            (Some([_, end]), None) | (None, Some(&[_, end])) => end,
            (None, None) => 0.0,
        }
    }

    fn is(&self, candidate: &Candidate) -> bool {
        let near = |(_, constant, _): &(_, f64, _)| {
            self.constant.is_some_and(|own| (own - constant).abs() <= 1e-9 * own.abs())
        };
        let same_shape = candidate.shape.as_ref().map_or(self.constant.is_none(), near);
        candidate.law == self.law && candidate.place == self.place && same_shape
    }
}

/// Puts effects into the prediction of an experiment; what is found then is what it lacks beside them.
pub(crate) fn apply(experiment: &mut Experiment, known: &[Known]) -> Result<(), ChannelError> {
    let (offsets, n_values) = experiment.offsets();
    let mut base = vec![0.0; n_values];
    for effect in known {
        let none = || ChannelError::NotHere { law: effect.law.clone(), place: effect.place.clone() };
        if effect.law == FITTED_TERM {
            add_fitted(experiment, effect).ok_or_else(none)?;
            continue;
        }
        let candidate = experiment.candidates.iter().position(|candidate| effect.is(candidate)).ok_or_else(none)?;
        for (k, value) in experiment.candidates[candidate].values.iter().enumerate() {
            base[offsets[candidate] + k] += effect.values.get(&value.name).copied().unwrap_or(0.0);
        }
    }
    if known.is_empty() {
        return Ok(());
    }
    experiment.residuals = experiment.at(&base);
    for mass in &mut experiment.masses {
        let first = offsets[mass.candidate];
        mass.ten.iter_mut().zip(&base[first..first + 10]).for_each(|(own, change)| *own += change);
    }
    if let Some(inner) = experiment.relinearise.take() {
        experiment.relinearise = Some(Box::new(move |values| {
            inner(&values.iter().zip(&base).map(|(value, base)| value + base).collect::<Vec<f64>>())
        }));
    }
    Ok(())
}

/// Adds a fitted term to the prediction; `None` where there is no such axis or channel.
fn add_fitted(experiment: &mut Experiment, term: &Known) -> Option<()> {
    let (axis, channel) = term.place.split_once(": ")?;
    let axis = experiment.axes.iter().position(|of| of.name == axis)?;
    let (_, channel) = experiment.channels.iter().find(|(name, _)| name == channel)?;
    let own = experiment.residuals.iter_mut().skip(axis).step_by(experiment.axes.len());
    own.zip(channel).for_each(|(residual, channel)| *residual += term.at(*channel));
    Some(())
}

/// Writes the model of a file with the effects of a diagnosis in it, and the next number; what a robot's file names stays
/// where it is.
pub fn write(model: &Path, output: &Path, diagnosis: &Diagnosis) -> Result<(), ModelError> {
    let io = |path: &Path| {
        let name = path.display().to_string();
        move |error| ModelError::Io(name, error)
    };
    let mut table = if model.extension().is_some_and(|end| end == "urdf") {
        let observed = if diagnosis.kind == "contact-wrench" { "wrench" } else { "torque" };
        let own = model.file_name().unwrap_or_default().to_string_lossy().into_owned();
        toml::Table::from_iter(
            [("kind", "robot".to_string()), ("urdf", own), ("observed", observed.into())]
                .map(|(key, value)| (key.to_string(), toml::Value::String(value))),
        )
    } else {
        let text = std::fs::read_to_string(model).map_err(io(model))?;
        text.parse().map_err(|error| ModelError::Toml(model.display().to_string(), error))?
    };
    let folder = |path: &Path| path.parent().map_or(PathBuf::new(), Path::to_path_buf).canonicalize().ok();
    if let Some(toml::Value::String(urdf)) = table.get_mut("urdf")
        && folder(model) != folder(output)
    {
        let whole = model.parent().unwrap_or(Path::new("")).join(&*urdf);
        *urdf = whole.canonicalize().map_err(io(&whole))?.display().to_string();
    }
    let number = table.get("number").and_then(toml::Value::as_integer).unwrap_or(0);
    table.insert("number".into(), toml::Value::Integer(number + 1));
    let effects = diagnosis.model_effects.iter().filter_map(|effect| toml::Value::try_from(effect).ok());
    table.insert("effect".into(), toml::Value::Array(effects.collect()));
    let text =
        toml::to_string(&table).map_err(|error| ModelError::Value(output.display().to_string(), error.to_string()))?;
    std::fs::write(output, text).map_err(io(output))
}

/// The effects that a model's table holds, taken out of it with its number.
pub(crate) fn taken(name: &str, table: &mut toml::Table) -> Result<Vec<Known>, ModelError> {
    table.remove("number");
    match table.remove("effect") {
        Some(effects) => effects.try_into().map_err(|error| ModelError::Toml(name.into(), error)),
        None => Ok(Vec::new()),
    }
}

/// The effects of a model and those that were found beside them, one for each law, place and constant.
pub(crate) fn together(known: &[Known], found: Vec<Known>) -> Vec<Known> {
    let mut all = known.to_vec();
    for effect in found {
        let same =
            |own: &&mut Known| (&own.law, &own.place, own.constant) == (&effect.law, &effect.place, effect.constant);
        match all.iter_mut().find(same) {
            Some(own) => {
                effect.values.into_iter().for_each(|(name, size)| *own.values.entry(name).or_default() += size)
            }
            None => all.push(effect),
        }
    }
    all
}
