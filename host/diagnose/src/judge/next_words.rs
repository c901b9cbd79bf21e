//! The measurement that would distinguish several explanations.

use darm_core::units::Word;
use nalgebra::DMatrix;

use crate::effect::Place;
use crate::judge::selected::SelectedPoses;
use crate::least_squares::{condition_of, normal, pseudo_inverse, weights};
use crate::linearise::arm_candidates::{all, same};
use crate::linearise::sensitivity::Sensitivity;
use crate::measurement_plan::optimal_design::informative_first;
use crate::measurement_plan::{PlanStep, as_run, candidates};
use crate::outcome::{Alternative, NextMeasurement};
use crate::prepare::observations::{NoPose, Observations, ValueIndex};
use crate::select::poses::robust_fit::fit;
use crate::select::poses::values;
use darm_arm::arm::{Arm, ArmModel, ArmScratch, ZERO_CELSIUS};
use darm_measure::Run;

/// Explanations can be distinguished when the information about all their values together, each scaled to its own, has no
/// larger condition number than this.
const LARGEST_CONDITION: f64 = 1e4;
/// A direction without any information counts as known to this share: finite, but least of all.
const FLOOR: f64 = 1e-8;

/// How a measurement is proposed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Proposal {
    /// Of the words that compete.
    pub(crate) seed: u64,
    /// How many words are proposed.
    pub(crate) words: usize,
}

/// Where an arm is measured.
struct Conditions {
    supply: f64,
    temperature_k: f64,
    text: Option<String>,
}

/// Words that distinguish the best effects and their alternatives, by D-optimality over all their values together: under
/// the conditions of this run, or where these do not suffice, at another supply or temperature.
pub(crate) fn proposal(
    selected: &SelectedPoses,
    alternatives: &[Alternative],
    how: Proposal,
) -> Result<NextMeasurement, NoPose> {
    let SelectedPoses { arm, run, problem, best, .. } = *selected;
    let mut scratch = ArmScratch::default();
    let model = together(arm, &best.fit.model, alternatives);
    let fit = fit(&model, &problem.training, &values(&model), &mut scratch)?;
    let row_weights = weights(&fit.residuals, problem.training.n_axes());
    let (information, _) = normal(&fit.columns, &fit.residuals, &row_weights);
    let steps = candidates(arm, how.seed);
    let mut nearest: Option<(f64, NextMeasurement)> = None;
    for conditions in conditions(arm, run) {
        let run = as_run(arm, &steps, conditions.supply, conditions.temperature_k);
        let observations = Observations::new(arm, &run, problem.training.sigma, |_| true);
        let sensitivity = Sensitivity::new(&fit.model, &observations, &mut scratch)?;
        let measurements = measurements(&sensitivity, &observations, &fit.model, &fit.values);
        let floor = DMatrix::from_diagonal(&information.diagonal().map(|d| FLOOR * d.max(f64::MIN_POSITIVE)));
        let covariance = pseudo_inverse(&(&information + floor));
        let chosen = informative_first(covariance, &measurements, how.words);
        let after =
            chosen.iter().fold(information.clone(), |sum, &k| sum + measurements[k].transpose() * &measurements[k]);
        let condition = condition_of(&after);
        let visits = chosen.iter().map(|&row| &steps[observations.rows[row].sample]);
        let words = visited(visits).iter().map(Word::to_string).collect();
        if nearest.as_ref().is_none_or(|(lowest, _)| condition < *lowest) {
            nearest =
                Some((condition, NextMeasurement { words, conditions: conditions.text, ..nothing(alternatives) }));
        }
        if condition < LARGEST_CONDITION {
            break;
        }
    }
    Ok(nearest.map_or_else(|| nothing(alternatives), |(_, next)| next))
}

/// No words, for these alternatives.
fn nothing(alternatives: &[Alternative]) -> NextMeasurement {
    let names: Vec<String> = alternatives.iter().map(|a| format!("{} at {}", a.law, a.site.name)).collect();
    NextMeasurement { words: Vec::new(), conditions: None, rows: Vec::new(), distinguishes: names.join(" from ") }
}

/// The best model with all alternatives in it, as many as it holds.
pub(crate) fn together(arm: &Arm, best: &ArmModel, alternatives: &[Alternative]) -> ArmModel {
    let mut model = best.clone();
    for effect in all(&arm.model) {
        let (law, place) = (effect.name(), Place::of_arm(&effect));
        let meant = alternatives.iter().any(|a| a.law == law && a.site.place == place);
        let known = model.effects.iter().any(|known| same(known, &effect));
        if meant && !known && model.effects.push(effect).is_err() {
            break;
        }
    }
    model
}

/// The conditions of this run, then another supply, then another temperature.
fn conditions(arm: &Arm, run: &Run) -> [Conditions; 3] {
    let (supply, temperature_k) = run.settled_or_nominal(arm);
    let (less, warmer) = (0.85 * supply, temperature_k + 10.0);
    [
        Conditions { supply, temperature_k, text: None },
        Conditions { supply: less, temperature_k, text: Some(format!("at a supply of {:.2} bar", less / 1e5)) },
        Conditions { supply, temperature_k: warmer, text: Some(format!("at {:.0} °C", warmer - ZERO_CELSIUS)) },
    ]
}

/// For each row the derivatives of its residual with respect to all values.
fn measurements(
    sensitivity: &Sensitivity,
    observations: &Observations,
    model: &ArmModel,
    values: &[ValueIndex],
) -> Vec<DMatrix<f64>> {
    let column = |&(effect, value): &ValueIndex| sensitivity.column(&model.effects[effect], value);
    let columns: Vec<Option<Vec<f64>>> = values.iter().map(column).collect();
    let n_axes = observations.n_axes();
    let entry =
        |row: usize, axis: usize, column: usize| columns[column].as_ref().map_or(0.0, |c| c[row * n_axes + axis]);
    let row = |row| DMatrix::from_fn(n_axes, columns.len(), |axis, column| entry(row, axis, column));
    (0..observations.rows.len()).map(row).collect()
}

/// The words of these steps in order, each after the word that it is to follow.
fn visited<'a>(steps: impl Iterator<Item = &'a PlanStep>) -> Vec<Word> {
    let mut words: Vec<Word> = Vec::new();
    for step in steps {
        if words.last() != Some(&step.previous) {
            words.push(step.previous);
        }
        words.push(step.word);
    }
    words
}
