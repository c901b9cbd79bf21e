//! The corrected model: what a diagnosis adds to the model that it was made with.

use darm_core::effect::Effect;

use crate::judge::fitted_terms::WithTerms;
use crate::linearise::model_effects::ModelEffect;
use crate::model_file::ModelFile;
use crate::outcome::Diagnosis;
use crate::prepare::observations::Observations;
use darm_arm::arm::{Arm, ZERO_CELSIUS};
use darm_measure::Run;

/// A diagnosis, and what it adds to the model.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome<C> {
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// What it adds to the model.
    pub correction: C,
}

/// What of a diagnosis a corrected model keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// The effects that are named.
    Effects,
    /// Also what no law explains, as fitted terms.
    EffectsAndTerms,
}

/// What a diagnosis of tool poses adds to an arm.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmCorrection {
    /// The effects of the best model, whether they are named or not, after those that the model had.
    pub best_effects: Vec<Effect<f64>>,
    /// Whether they are named.
    pub(crate) is_named: bool,
    /// The best model with what no law explains as fitted terms; `None` where there is nothing to keep.
    pub with_terms: Option<WithTerms>,
}

impl ArmCorrection {
    /// The arm with the effects that were found, the next model number and the conditions that it had settled to at the end
    /// of `run`; `None` where there is nothing to add.
    pub fn corrected(&self, arm: &Arm, run: &Run, keep: Keep) -> Option<Arm> {
        let terms = self.with_terms.as_ref().filter(|_| keep == Keep::EffectsAndTerms).map(|terms| &terms.effects);
        let effects = terms.or(self.is_named.then_some(&self.best_effects))?;
        let observations = Observations::new(arm, run, [1.0; 6], |_| true);
        let mut corrected = arm.clone();
        corrected.model.effects = effects.iter().copied().collect();
        if let Some(end) = observations.end() {
            corrected.model.effects.iter_mut().for_each(|effect| effect.settle(&end));
        }
        corrected.model.number += 1;
        let (supply, temperature_c) = run.settled();
        corrected.model.working_supply = supply.unwrap_or(corrected.model.working_supply);
        let temperature_k = temperature_c.map(|celsius| celsius + ZERO_CELSIUS);
        corrected.model.working_temperature_k = temperature_k.unwrap_or(corrected.model.working_temperature_k);
        Some(corrected)
    }
}

/// What a diagnosis of signals adds to a model.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalCorrection {
    /// The effects of the model with those that were selected: all values, those that are not identified among them.
    pub effects: Vec<ModelEffect>,
    /// What no law explains, as fitted terms.
    pub terms: Vec<ModelEffect>,
}

impl SignalCorrection {
    /// The model of a file with what the diagnosis `found` adds to it, and the next number; `None` where there is nothing to
    /// add.
    pub fn corrected(&self, model: &ModelFile, found: &Diagnosis, keep: Keep) -> Option<ModelFile> {
        let terms = match keep {
            Keep::Effects => &[][..],
            Keep::EffectsAndTerms => &self.terms,
        };
        let nothing = found.effects.is_empty() && terms.is_empty();
        let holds = found.verdict.names_effects() || !terms.is_empty();
        (holds && !nothing).then(|| model.with_effects(self.effects.iter().chain(terms)))
    }
}
