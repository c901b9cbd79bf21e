//! Candidate effects that the user rejects, each with a reason: `joint-compliance, joint 3: checked with a dial gauge`.
//!
//! The form is that of a verdict: law and place as they are printed, then a colon and the reason. Without a place the law is
//! rejected everywhere. A rejected candidate is no candidate at all: it is not fitted, listed as an alternative or part of a
//! group, and no fitted term replaces it.

use std::collections::BTreeMap;
use std::str::FromStr;

use darm_arm::arm::{Arm, ArmModel};
use darm_core::effect::{self, Detail, Effect};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::effect::{LawName, Site};
use crate::error::DiagnoseError;
use crate::least_squares::pseudo_inverse;
use crate::linearise::arm_candidates;
use crate::linearise::experiment::{Candidate, Experiment};
use crate::linearise::model_effects::ModelEffect;

/// The share of a change from which on a law explains it.
const SAME_SHARE: f64 = 0.5;

/// A law at a place that is no candidate, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Rejection {
    /// The law's name.
    pub law: String,
    /// The place as reports print it; `None`: everywhere.
    #[serde(rename = "where", skip_serializing_if = "Option::is_none")]
    pub place: Option<String>,
    /// Why.
    pub reason: String,
}

/// A text that is no rejection.
#[derive(Debug, thiserror::Error)]
#[error("give LAW, PLACE: REASON, such as \"joint-compliance, joint 3: checked with a dial gauge\"")]
pub struct NoRejection;

impl FromStr for Rejection {
    type Err = NoRejection;

    fn from_str(text: &str) -> Result<Self, NoRejection> {
        let (what, reason) = text.split_once(": ").ok_or(NoRejection)?;
        // The reason becomes a comment of one line.
        let one_line = reason.replace(char::is_control, " ");
        let reason = one_line.split_whitespace().collect::<Vec<_>>().join(" ");
        let parts = what.split_once(", ").or_else(|| what.split_once(" at "));
        let (law, place) = parts.map_or((what, None), |(law, place)| (law, Some(place.trim().to_string())));
        let is_empty = law.trim().is_empty() || place.as_deref() == Some("") || reason.is_empty();
        if is_empty { Err(NoRejection) } else { Ok(Self { law: law.trim().into(), place, reason }) }
    }
}

impl std::fmt::Display for Rejection {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let place = self.place.as_ref().map_or(String::new(), |place| format!(", {place}"));
        write!(f, "{}{place}: {}", self.law, self.reason)
    }
}

impl Rejection {
    /// Whether it is of this law at this place: by the place's code, the beginning of the code, or its name.
    fn is_of(&self, law: LawName, site: &Site) -> bool {
        let is_at = |place: &str| {
            let begins = |rest: &str| rest.is_empty() || rest.starts_with(" (") || rest.starts_with(", ");
            site.name == place || site.code.strip_prefix(place).is_some_and(begins)
        };
        self.law == law.as_str() && self.place.as_deref().is_none_or(is_at)
    }
}

/// The candidates of an arm that these rejections exclude; with a part also the same law of all actuators of a group that it
/// is in.
pub(crate) fn of_arm(arm: &Arm, rejected: &[Rejection]) -> Result<Vec<Effect<f64>>, DiagnoseError> {
    let site = |effect: &Effect<f64>| (effect.name(), arm_candidates::site(arm, effect));
    let all = arm_candidates::all(&arm.model);
    let known: Vec<(LawName, Site)> = arm.model.effects.iter().map(site).collect();
    let flags = flags(rejected, &all.iter().map(site).collect::<Vec<_>>(), &known)?;
    let named: Vec<&Effect<f64>> = all.iter().zip(&flags).filter(|(_, is_named)| **is_named).map(|(e, _)| e).collect();
    let is_out = |effect: &&Effect<f64>| named.iter().any(|own| includes(&arm.model, effect, own));
    Ok(all.iter().filter(is_out).copied().collect())
}

/// Whether an effect is there only if `part` is: the same law at the same place, or of a group with it.
fn includes(model: &ArmModel, effect: &Effect<f64>, part: &Effect<f64>) -> bool {
    use effect::Place::{Actuator, Arm, Module};
    let ([outer, inner], detail) = ([effect, part].map(|effect| effect.place()), effect.detail());
    let stage = |actuator: u8| model.chain.actuators().nth(actuator.into()).map(|(stage, _)| stage);
    let has_place = match (outer, inner) {
        (Arm, Actuator(_) | Module(_)) => true,
        (Module(module), Actuator(actuator)) => stage(actuator) == Some(module.into()),
        _ => outer == inner,
    };
    let has_detail = detail == part.detail() || outer != inner && detail == Detail::All;
    effect.name() == part.name() && has_place && has_detail
}

/// An experiment without the candidates that are rejected, and these; `known` are the effects of its model.
pub(crate) fn of_signals(
    mut experiment: Experiment,
    known: &[ModelEffect],
    rejected: &[Rejection],
) -> Result<(Experiment, Vec<Candidate>), DiagnoseError> {
    let sites: Vec<(LawName, Site)> = experiment.candidates.iter().map(|one| (one.law, one.site.clone())).collect();
    let of_model =
        |effect: &ModelEffect| sites.iter().find(|(law, site)| *law == effect.law && site.code == effect.place);
    let known: Vec<(LawName, Site)> = known.iter().filter_map(of_model).cloned().collect();
    let flags = flags(rejected, &sites, &known)?;
    let (offsets, n_values) = experiment.offsets();
    let values = |k: usize| offsets[k]..offsets[k] + experiment.candidates[k].values.len();
    let kept: Vec<usize> = (0..flags.len()).filter(|&k| !flags[k]).flat_map(values).collect();
    experiment.bodies.retain(|body| !flags[body.candidate]);
    for body in &mut experiment.bodies {
        body.candidate -= flags[..body.candidate].iter().filter(|is_out| **is_out).count();
    }
    experiment.curvature = experiment.curvature.of(kept, n_values);
    let mut flags = flags.into_iter();
    let (out, kept) = experiment.candidates.into_iter().partition(|_| flags.next().unwrap_or_default());
    experiment.candidates = kept;
    Ok((experiment, out))
}

/// Which candidates are rejected; each rejection must be of one, and of none that the model has.
fn flags(
    rejected: &[Rejection],
    candidates: &[(LawName, Site)],
    known: &[(LawName, Site)],
) -> Result<Vec<bool>, DiagnoseError> {
    for rejection in rejected {
        let of = |(law, site): &&(LawName, Site)| rejection.is_of(*law, site);
        if let Some((law, site)) = known.iter().find(of) {
            return Err(DiagnoseError::RejectedIsKnown { law: *law, place: site.code.clone() });
        }
        if candidates.iter().any(|candidate| of(&candidate)) {
            continue;
        }
        let places = candidates.iter().filter(|(law, _)| law.as_str() == rejection.law).map(|(_, site)| &site.code[..]);
        let (law, known) = (rejection.law.clone(), sorted(places, "; "));
        return Err(match &rejection.place {
            Some(place) if !known.is_empty() => DiagnoseError::UnknownPlace { law, place: place.clone(), known },
            _ => DiagnoseError::UnknownLaw { law, known: sorted(candidates.iter().map(|(law, _)| law.as_str()), ", ") },
        });
    }
    Ok(candidates.iter().map(|(law, site)| rejected.iter().any(|rejection| rejection.is_of(*law, site))).collect())
}

/// Names in order, once each.
pub(crate) fn sorted<'a>(names: impl Iterator<Item = &'a str>, separator: &str) -> String {
    let mut names: Vec<&str> = names.collect();
    names.sort_unstable();
    names.dedup();
    names.join(separator)
}

/// Whether the columns of one of these laws add up to most of a change of residuals; they are those of rejected candidates.
pub(crate) fn is_of_one_law(change: &[f64], columns: Vec<(LawName, Vec<f64>)>) -> bool {
    let mut laws: BTreeMap<LawName, Vec<DVector<f64>>> = BTreeMap::new();
    for (law, column) in columns {
        let column = DVector::from_vec(column).try_normalize(0.0);
        laws.entry(law).or_default().extend(column);
    }
    let change = DVector::from_column_slice(change);
    laws.values().filter(|columns| !columns.is_empty()).any(|columns| {
        let columns = DMatrix::from_columns(columns);
        let along = columns.tr_mul(&change);
        let explained = along.dot(&(pseudo_inverse(&columns.tr_mul(&columns)) * &along));
        explained > SAME_SHARE * change.norm_squared()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Place;

    #[test]
    fn a_rejection_is_read_as_a_verdict_prints_it() {
        let read = |text: &str| text.parse::<Rejection>().ok().map(|read| (read.law, read.place, read.reason));
        let of = |place: &str| Some(("gain".into(), Some(place.to_string()), "checked: twice".to_string()));
        assert_eq!(read("gain, module 2, left leg: checked: twice"), of("module 2, left leg"));
        assert_eq!(read("gain at joint 3 (elbow): checked:\n twice"), of("joint 3 (elbow)"));
        assert_eq!(read("gain: why"), Some(("gain".into(), None, "why".into())));
        for wrong in ["", "gain", "gain, joint 3", "gain, joint 3: ", ": why", "gain, : why"] {
            assert_eq!(read(wrong), None, "{wrong:?}");
        }
    }

    #[test]
    fn the_beginning_of_a_place_is_all_of_it_or_ends_before_a_detail() {
        let site = Site { place: Place::Joint(2), code: "joint 3 (elbow)".into(), name: "the elbow".into() };
        let is_of = |place: &str| {
            format!("gain, {place}: why").parse::<Rejection>().is_ok_and(|r| r.is_of(LawName::Gain, &site))
        };
        assert!(["joint 3", "joint 3 (elbow)", "the elbow"].into_iter().all(is_of));
        assert!(!["joint", "joint 3 (", "joint 30", "elbow"].into_iter().any(is_of));
    }
}
