//! The search for what is missing: effects are added one at a time, each the one that predicts unseen words best.
//!
//! All candidates are judged by their linear fit first, cross-validated over words; the best few, if they gain anything
//! that may be more than chance, are fitted in full and judged again. The best is kept when its gain is no chance
//! ([`DISCOVERY_LEVEL`], over all that were tried) and the held-out error falls by more than its uncertainty. After each
//! addition those found before have to prove themselves again.

use darm_core::effect::Effect;
use darm_core::model::MAX_EFFECTS;

use super::candidate;
use super::fit::{Fit, cross_validated, fit, losses, losses_by_word};
use super::observation::{NoPose, Observations, Value};
use super::outcome::Rung;
use super::sensitivity::Sensitivity;
use super::significance::{CONFIRMATION_LEVEL, DISCOVERY_LEVEL, RIVAL_LEVEL, fall, quantile_975};
use crate::arm::{ArmModel, ArmScratch};

/// Candidates of each step that are fitted in full.
const REFINED: usize = 8;

/// What a search works on.
pub struct Search {
    /// Rows that fits see.
    pub training: Observations,
    /// Rows that judge; may be none.
    pub heldout: Observations,
    /// The fold of each word.
    pub folds: Vec<usize>,
    /// Room to compute in.
    pub scratch: ArmScratch,
    /// Everything tried.
    pub ladder: Vec<Rung>,
}

/// One model tried: an effect beside those that a model has.
#[derive(Clone, Debug)]
pub struct Trial {
    /// The effect.
    pub effect: Effect<f64>,
    /// The model with it.
    pub fit: Fit,
    /// Cross-validated residuals.
    pub predicted: Vec<f64>,
    /// Their loss.
    pub loss: f64,
    /// Cross-validated error as a distance d, root mean square, m.
    pub error_m: f64,
}

/// The values of all effects of a model.
pub fn values(model: &ArmModel) -> Vec<Value> {
    let effects = model.effects.iter().enumerate();
    effects.flat_map(|(k, effect)| (0..effect.law().values().len()).map(move |value| (k, value))).collect()
}

impl Search {
    /// The model with all effects that prove themselves, and for the last one what else was fitted in full.
    pub fn run(&mut self, model: &ArmModel) -> Result<(Trial, Vec<Trial>), NoPose> {
        let mut best = self.refined(model, None)?;
        let n_known = model.effects.len();
        let mut rivals = Vec::new();
        while best.fit.model.effects.len() < MAX_EFFECTS {
            let mut tried = self.step(&best, best.fit.model.effects.len() - n_known)?;
            if tried.is_empty() || !self.proves_itself(&best, &tried[0])? {
                break;
            }
            if let Some(rung) = self.ladder.iter_mut().rev().find(|rung| rung.refined && same_rung(rung, &tried[0])) {
                rung.kept = true;
            }
            best = tried.remove(0);
            rivals = tried;
            while let Some(without) = self.superfluous(&best, n_known)? {
                best = without;
                rivals.clear();
            }
        }
        Ok((best, rivals))
    }

    /// The best candidates beside the effects of `current`, fitted in full, the best first.
    pub fn step(&mut self, current: &Trial, step: usize) -> Result<Vec<Trial>, NoPose> {
        let candidates: Vec<Effect<f64>> = candidate::all(&current.fit.model)
            .into_iter()
            .filter(|effect| !current.fit.model.effects.iter().any(|known| candidate::same(known, effect)))
            .collect();
        let sensitivity = Sensitivity::new(&current.fit.model, &self.training, &mut self.scratch)?;
        let mut screened: Vec<Trial> =
            candidates.iter().filter_map(|effect| self.screened(current, effect, &sensitivity)).collect();
        screened.sort_by(|a, b| a.loss.total_cmp(&b.loss));
        let (n_tried, groups) = (screened.len(), self.training.groups());
        let p = |trial: &Trial| (fall(&current.predicted, &trial.predicted, &groups).p * n_tried as f64).min(1.0);
        let (promising, others): (Vec<_>, Vec<_>) = screened.iter().partition(|trial| p(trial) < 1.0);
        let (promising, more) = promising.split_at(REFINED.min(promising.len()));
        let mut tried = Vec::new();
        for trial in promising {
            // An effect that leaves the arm without a pose somewhere is not the one.
            tried.extend(self.refined(&trial.fit.model, Some(trial.effect)).ok());
        }
        tried.sort_by(|a, b| a.loss.total_cmp(&b.loss));
        let rung = |trial: &Trial, refined| Rung {
            step,
            law: trial.effect.law().name(),
            place: candidate::place_code(&trial.effect),
            values: trial.fit.values.len() - current.fit.values.len(),
            cross_validated_m: trial.error_m,
            without_m: current.error_m,
            p: p(trial),
            refined,
            kept: false,
        };
        self.ladder.extend(tried.iter().map(|trial| rung(trial, true)));
        self.ladder.extend(more.iter().copied().chain(others).map(|trial| rung(trial, false)));
        Ok(tried)
    }

    /// A candidate by its linear fit; `None` where it changes nothing in these rows.
    fn screened(&self, current: &Trial, effect: &Effect<f64>, sensitivity: &Sensitivity) -> Option<Trial> {
        let mut model = current.fit.model.clone();
        let new = model.effects.len();
        model.effects.push(*effect).ok()?;
        let mut fit = Fit { model, ..current.fit.clone() };
        for value in 0..effect.law().values().len() {
            if let Some(column) = sensitivity.column(effect, value) {
                fit.values.push((new, value));
                fit.columns.push(column);
            }
        }
        (fit.values.len() > current.fit.values.len()).then(|| self.judged(fit, *effect))
    }

    /// A model with all its values fitted in full. `effect` is the one that is on trial.
    pub fn refined(&mut self, model: &ArmModel, effect: Option<Effect<f64>>) -> Result<Trial, NoPose> {
        let fit = fit(model, &self.training, &values(model), &mut self.scratch)?;
        let none = || fit.model.effects.last().copied();
        let effect = effect.or_else(none).unwrap_or(super::NOTHING);
        Ok(self.judged(fit, effect))
    }

    fn judged(&self, fit: Fit, effect: Effect<f64>) -> Trial {
        let predicted = cross_validated(&fit.columns, &fit.residuals, &self.training, &self.folds);
        let loss = losses(&predicted, self.training.n_axes()).iter().sum();
        let error_m = root_mean_square(&self.training.distances_m(&predicted));
        Trial { effect, fit, predicted, loss, error_m }
    }

    /// Whether an effect predicts what it was not fitted to.
    fn proves_itself(&mut self, without: &Trial, with: &Trial) -> Result<bool, NoPose> {
        let n_tried =
            self.ladder.iter().filter(|rung| rung.step == self.ladder.last().map_or(0, |last| last.step)).count();
        let p = self.fall(without, with);
        let discovered = p * (n_tried as f64) < DISCOVERY_LEVEL;
        Ok(discovered && self.confirmed(&without.fit.model, &with.fit.model)?)
    }

    /// Whether the held-out error falls by more than its uncertainty, word by word and as a whole.
    fn confirmed(&mut self, without: &ArmModel, with: &ArmModel) -> Result<bool, NoPose> {
        if self.heldout.rows.is_empty() {
            return Ok(true);
        }
        let before = self.heldout.residuals(without, &mut self.scratch)?;
        let after = self.heldout.residuals(with, &mut self.scratch)?;
        let p = fall(&before, &after, &self.heldout.groups()).p;
        let (mean_before, _) = mean_loss(&losses_by_word(&before, &self.heldout));
        let (mean_after, uncertainty) = mean_loss(&losses_by_word(&after, &self.heldout));
        Ok(p < CONFIRMATION_LEVEL && mean_before - mean_after > uncertainty)
    }

    /// Chance that one model predicts unseen words as much better than another by chance.
    pub fn fall(&self, before: &Trial, after: &Trial) -> f64 {
        fall(&before.predicted, &after.predicted, &self.training.groups()).p
    }

    /// The model without the effect that is least missed, where it is not missed at all.
    fn superfluous(&mut self, best: &Trial, n_known: usize) -> Result<Option<Trial>, NoPose> {
        let n = best.fit.model.effects.len();
        if n < n_known + 2 {
            return Ok(None);
        }
        for dropped in n_known..n - 1 {
            let without = self.without(best, dropped)?;
            if self.fall(&without, best) > RIVAL_LEVEL {
                return Ok(Some(without));
            }
        }
        Ok(None)
    }

    /// The model without one of its effects, fitted anew.
    pub fn without(&mut self, best: &Trial, dropped: usize) -> Result<Trial, NoPose> {
        let mut model = best.fit.model.clone();
        model.effects.remove(dropped);
        self.refined(&model, None)
    }
}

fn same_rung(rung: &Rung, trial: &Trial) -> bool {
    rung.law == trial.effect.law().name() && rung.place == candidate::place_code(&trial.effect)
}

/// The mean loss of a word, and how far it may be off with 95 % confidence.
fn mean_loss(losses: &[f64]) -> (f64, f64) {
    let n = losses.len() as f64;
    let mean = losses.iter().sum::<f64>() / n.max(1.0);
    let variance = losses.iter().map(|loss| (loss - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, quantile_975(losses.len().saturating_sub(1)) * (variance / n.max(1.0)).sqrt())
}

/// √(mean of squares).
pub fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
