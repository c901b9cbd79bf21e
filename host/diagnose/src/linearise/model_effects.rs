//! Effects that a model of signals has: written after a diagnosis, in the prediction of the next.
//!
//! ```toml
//! [[effect]]
//! law = "coulomb-friction"
//! where = "joint 3 (joint_3)"
//! constant = 0.16          # of a law that has one, in SI units
//! values = { level = 1.93 }
//!
//! [[effect]]
//! law = "fitted-term"      # no law: what remained of an axis along a signal, straight between points
//! where = "joint 6"
//! along = "position of joint 4"
//! points = [[-0.7, 0.0], [0.1, 0.02], [0.9, 0.31]]
//! ```

use std::collections::BTreeMap;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

use crate::effect::{LawName, as_str};
use crate::error::{DiagnoseError, UnknownValue};
use crate::linearise::experiment::{Candidate, Experiment};

/// The place of what the tool carries is this word and its number in the log.
pub(crate) const PAYLOAD: &str = "payload";

/// One effect with all its values, in SI units and radians.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelEffect {
    /// The law.
    #[serde(serialize_with = "as_str", deserialize_with = "named")]
    pub law: LawName,
    /// Where it acts.
    #[serde(rename = "where")]
    pub place: String,
    /// The number in its shape.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub constant: Option<f64>,
    /// Its values by their names.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, f64>,
    /// Of a fitted term: the signal that it depends on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along: Option<String>,
    /// Of a fitted term: the signal, and what it adds to the prediction there; constant beyond the ends.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<[f64; 2]>,
}

fn named<'de, D: Deserializer<'de>>(deserializer: D) -> Result<LawName, D::Error> {
    let name = String::deserialize(deserializer)?;
    // The names of these two before they were parted from the laws of arms.
    let law = match &name[..] {
        "drift" => Some(LawName::OffsetDrift),
        "wear" => Some(LawName::FrictionWear),
        _ => LawName::named(&name),
    };
    law.ok_or_else(|| D::Error::custom(format!("no law is called {name:?}")))
}

impl ModelEffect {
    /// Its values with these names, zero where the file gives none.
    pub(crate) fn numbers<const N: usize>(&self, names: [&str; N]) -> Result<[f64; N], UnknownValue> {
        self.check(&names)?;
        Ok(names.map(|name| self.values.get(name).copied().unwrap_or(0.0)))
    }

    /// Refuses values with other names.
    fn check(&self, names: &[&str]) -> Result<(), UnknownValue> {
        let unknown = self.values.keys().find(|name| !names.contains(&name.as_str()));
        unknown.map_or(Ok(()), |name| {
            Err(UnknownValue { law: self.law, place: self.place.clone(), name: name.clone(), known: names.join(", ") })
        })
    }

    /// The effect that a candidate becomes with these values.
    pub(crate) fn of(candidate: &Candidate, values: &[f64]) -> Self {
        Self {
            law: candidate.law,
            place: candidate.site.code.clone(),
            constant: candidate.shape.as_ref().map(|(_, constant, _)| *constant),
            values: candidate.values.iter().zip(values).map(|(value, size)| (value.name.clone(), *size)).collect(),
            along: None,
            points: Vec::new(),
        }
    }

    /// A fitted term of an axis along a signal: what takes this curve of the residual out of it.
    pub(crate) fn fitted_term(axis: &str, signal: &str, curve: &[[f64; 2]]) -> Self {
        Self {
            law: LawName::FittedTerm,
            place: axis.into(),
            constant: None,
            values: BTreeMap::new(),
            along: Some(signal.into()),
            points: curve.iter().map(|[at, remains]| [*at, -remains]).collect(),
        }
    }

    /// What a fitted term adds at this value of its channel.
    pub(crate) fn at(&self, channel: f64) -> f64 {
        let above = self.points.partition_point(|[at, _]| *at < channel);
        match (above.checked_sub(1).map(|below| self.points[below]), self.points.get(above)) {
            (Some([low, a]), Some(&[high, b])) => a + (b - a) * (channel - low) / (high - low),
            (Some([_, end]), None) | (None, Some(&[_, end])) => end,
            (None, None) => 0.0,
        }
    }

    /// The number of the payload that it is of; `None` of what the robot itself has.
    pub(crate) fn payload(&self) -> Option<u32> {
        self.place.strip_prefix(PAYLOAD)?.trim().parse().ok()
    }

    /// Whether it is of what the tool carries in some rows, not of the robot itself.
    pub fn is_carried(&self) -> bool {
        self.payload().is_some()
    }

    fn is(&self, candidate: &Candidate) -> bool {
        let near = |(_, constant, _): &(_, f64, _)| {
            self.constant.is_some_and(|own| (own - constant).abs() <= 1e-9 * own.abs())
        };
        let same_shape = candidate.shape.as_ref().map_or(self.constant.is_none(), near);
        candidate.law == self.law && candidate.site.code == self.place && same_shape
    }
}

/// Puts effects into the prediction of an experiment; what is found then is missing beside them.
pub(crate) fn apply(experiment: &mut Experiment, known: &[ModelEffect]) -> Result<(), DiagnoseError> {
    let (offsets, n_values) = experiment.offsets();
    let mut base = vec![0.0; n_values];
    for effect in known {
        let none = || DiagnoseError::NoSuchPlace { law: effect.law, place: effect.place.clone() };
        if effect.law == LawName::FittedTerm {
            add_fitted(experiment, effect).ok_or_else(none)?;
            continue;
        }
        let candidate = experiment.candidates.iter().position(|candidate| effect.is(candidate)).ok_or_else(none)?;
        let values = &experiment.candidates[candidate].values;
        effect.check(&values.iter().map(|value| value.name.as_str()).collect::<Vec<_>>())?;
        for (k, value) in values.iter().enumerate() {
            base[offsets[candidate] + k] += effect.values.get(&value.name).copied().unwrap_or(0.0);
        }
    }
    if known.is_empty() {
        return Ok(());
    }
    // What is least of the law at its place, is less what the model has of it, in whatever shape.
    let sums: Vec<f64> =
        experiment.candidates.iter().map(|candidate| known_size(experiment, &base, candidate)).collect();
    for (candidate, sum) in experiment.candidates.iter_mut().zip(sums) {
        candidate.values.iter_mut().for_each(|value| value.min -= sum);
    }
    experiment.residuals = experiment.at(&base);
    for body in &mut experiment.bodies {
        let first = offsets[body.candidate];
        body.nominal.iter_mut().zip(&base[first..first + 10]).for_each(|(own, change)| *own += change);
    }
    experiment.curvature = std::mem::take(&mut experiment.curvature).around(base);
    Ok(())
}

/// The first values of a law at its place, in all its shapes, together.
fn known_size(experiment: &Experiment, values: &[f64], of: &Candidate) -> f64 {
    let (offsets, _) = experiment.offsets();
    let all = experiment.candidates.iter().zip(offsets).filter(|(candidate, _)| candidate.is_same(of));
    all.filter_map(|(_, offset)| values.get(offset)).sum()
}

/// Adds a fitted term to the prediction; `None` where there is no such axis or channel.
fn add_fitted(experiment: &mut Experiment, term: &ModelEffect) -> Option<()> {
    let axis = experiment.axes.iter().position(|of| of.name == term.place)?;
    let (_, channel) = experiment.channels.iter().find(|(name, _)| Some(name) == term.along.as_ref())?;
    let own = experiment.residuals.iter_mut().skip(axis).step_by(experiment.axes.len());
    own.zip(channel).for_each(|(residual, channel)| *residual += term.at(*channel));
    Some(())
}

/// The effects of a model and those that were found beside them, one for each law, place and constant. Fitted terms stay
/// as they are: each adds its own curve.
pub(crate) fn merge(known: &[ModelEffect], found: Vec<ModelEffect>) -> Vec<ModelEffect> {
    let mut all = known.to_vec();
    for effect in found {
        let same = |own: &&mut ModelEffect| {
            let key = (own.law, &own.place, own.constant);
            own.law != LawName::FittedTerm && key == (effect.law, &effect.place, effect.constant)
        };
        match all.iter_mut().find(same) {
            Some(own) => {
                effect.values.into_iter().for_each(|(name, size)| *own.values.entry(name).or_default() += size)
            }
            None => all.push(effect),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn merged_effects_add_their_values_and_keep_all_fitted_terms() {
        let friction = |level: f64| ModelEffect {
            law: LawName::CoulombFriction,
            place: "joint 3 (elbow)".into(),
            constant: None,
            values: BTreeMap::from([("level".into(), level)]),
            along: None,
            points: Vec::new(),
        };
        let term = |height: f64| ModelEffect::fitted_term("joint 6", "temperature", &[[0.0, 0.0], [1.0, height]]);
        let all = merge(&[friction(1.0), term(0.1)], vec![friction(0.5), term(0.2)]);
        assert_eq!(all, [friction(1.5), term(0.1), term(0.2)]);
    }
}
