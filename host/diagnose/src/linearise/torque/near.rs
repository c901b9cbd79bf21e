//! A model that a search found, near which the next experiment is made: the slopes of what is misplaced change with the bodies,
//! those of bodies with what is misplaced, the periods of ripples show in what the model leaves, and the distances over which
//! friction turns round are searched near the one found.

use darm_core::effect::basis::Law;

use crate::effect::{LawName, Site};
use crate::linearise::experiment::Experiment;
use crate::linearise::model_effects::ModelEffect;
use crate::measured::Measured;

/// Whether a law is a ripple's sine or cosine.
pub(crate) fn is_ripple(law: LawName) -> bool {
    matches!(law, LawName::GearPeriodicSine | LawName::GearPeriodicCosine)
}

/// Distances near one that was found, as shares of it: those tried at first are farther apart than intervals of the level allow.
const NEAR: [f64; 5] = [0.6, 0.8, 1.0, 1.25, 1.67];

/// A model that was found in an experiment, near which another one is made.
pub(crate) struct Near {
    /// Its effects.
    pub(super) effects: Vec<ModelEffect>,
    /// What it leaves, without its ripples: rows × joints.
    pub(super) residuals: Vec<f64>,
}

impl Near {
    /// The model with these values of an experiment's candidates, which are these effects; `None` where nothing of the
    /// experiment changes with it.
    pub(crate) fn model(experiment: &Experiment, values: &[f64], effects: &[ModelEffect]) -> Option<Self> {
        let changes = |effect: &ModelEffect| {
            matches!(
                effect.law,
                LawName::MassDistribution | LawName::JointOffset | LawName::BaseTilt | LawName::PreslidingFriction
            ) || is_ripple(effect.law)
        };
        if experiment.kind != Measured::JointTorque || !effects.iter().any(changes) {
            return None;
        }
        let (offsets, _) = experiment.offsets();
        let mut without_ripples = values.to_vec();
        let ripples = experiment.candidates.iter().zip(offsets).filter(|(candidate, _)| is_ripple(candidate.law));
        ripples.for_each(|(_, at)| without_ripples[at] = 0.0);
        Some(Self { effects: effects.to_vec(), residuals: experiment.at(&without_ripples) })
    }

    /// The laws of friction at a place with distances near those found.
    pub(super) fn distances(&self, site: &Site) -> Vec<Law<f64>> {
        let found =
            self.effects.iter().filter(|effect| effect.law == LawName::PreslidingFriction && effect.place == site.code);
        let near = found.flat_map(|effect| NEAR.map(|share| (effect.law, effect.constant.map(|found| share * found))));
        near.filter_map(|(law, distance)| Law::named(law, distance)).collect()
    }
}
