//! What a verdict is worth, by the rules of [`rules`](super::rules).

use anyhow::Result;
use darm_arm::arm::{Arm, ArmModel, ArmScratch};
use darm_core::effect::Effect;
use darm_diagnose::correction::{ArmCorrection, Outcome};
use darm_diagnose::effect::{LawName, Place};
use darm_diagnose::linearise::arm_candidates::{all, place_code};
use darm_diagnose::measurement_plan::candidates;
use darm_diagnose::outcome::{Effect as Found, Regressor, Verdict};
use darm_diagnose::prepare::observations::Observations;
use darm_diagnose::select::poses::robust_fit::fit;
use darm_diagnose::select::poses::values;
use darm_diagnose::truth::{Blind, Sealed};
use darm_measure::Run;
use darm_measure::root_mean_square;
use serde::{Deserialize, Serialize};

use super::case::Class;

/// Members of a set predict the same when they lie no farther apart than this share of the repeatability.
const SAME: f64 = 0.5;

/// How one answer did.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Mark {
    /// The laws are right; of a clean arm: it is left alone; outside the list: no false name.
    pub(super) named: bool,
    /// Their places too.
    pub(super) placed: bool,
    /// Held-out error over the repeatability.
    #[serde(with = "darm_figures::number")]
    pub(super) ratio: f64,
    /// Of intervals: how many hold the true value, of how many.
    pub(super) covered: [usize; 2],
    /// Outside the list: the variable reported first is the right one.
    pub(super) variable: bool,
    /// What was answered, in a line.
    pub(super) answer: String,
}

/// A law at a place.
pub(super) type Named = (LawName, Place);

/// What an answer is worth where refusing is allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Answer {
    /// The right names, or none of an arm without effects.
    Right,
    /// No wrong name, and each right one that is missing is in a set of effects that no row distinguishes from it.
    Indistinct,
    /// No wrong name, and not all of the right ones: the verdict says that something is open.
    Refused,
    /// `no-effect` where there is one, or not all of them, and nothing else was said to be open.
    Missed,
    /// A verdict against an arm without effects.
    FalseAlarm,
    /// A name that is wrong.
    FalseName,
}

impl Answer {
    /// An answer that is not right by itself, by what it names.
    pub(super) fn of(is_clean: bool, verdict: Verdict, truth: &[Named], named: &[Named]) -> Self {
        match verdict {
            Verdict::NoEffect if is_clean => Self::Right,
            Verdict::TooLittleData => Self::Refused,
            _ if is_clean => Self::FalseAlarm,
            _ if !named.iter().all(|name| truth.contains(name)) => Self::FalseName,
            Verdict::NoEffect | Verdict::EffectFound => Self::Missed,
            Verdict::PartlyExplained
            | Verdict::UnexplainedStructure
            | Verdict::NotIdentifiable
            | Verdict::WrongModelOrLog => Self::Refused,
        }
    }

    /// Whether it says what is not so.
    pub(super) fn is_wrong(&self) -> bool {
        matches!(self, Self::FalseAlarm | Self::FalseName)
    }
}

/// Law and part of an effect that is named.
pub(super) fn law_and_part(found: &Found) -> Named {
    (found.law, found.site.place.part())
}

/// Marks the outcome of a diagnosis.
pub(super) fn mark(arm: &Arm, class: Class, blind: &Blind, outcome: &Outcome<ArmCorrection>) -> Result<Mark> {
    let repeats_m = outcome.diagnosis.repeatability.as_ref().map_or(blind.scatter_m(), |repeats| repeats.norm.value);
    let mut mark = Mark { ratio: held_out_m(blind, outcome) / repeats_m, answer: answer(outcome), ..Mark::default() };
    match class {
        Class::Clean => mark.named = outcome.diagnosis.verdict == Verdict::NoEffect,
        Class::Outside => {
            mark.named =
                outcome.diagnosis.verdict == Verdict::UnexplainedStructure && outcome.diagnosis.effects.is_empty();
            mark.variable = mark.named && right_variable(blind, outcome);
        }
        Class::One | Class::Two => {
            (mark.named, mark.placed) = match outcome.diagnosis.verdict {
                verdict if verdict.names_effects() => named(blind.unseal(), &outcome.diagnosis.effects),
                Verdict::NotIdentifiable => in_sets(arm, blind, outcome, SAME * repeats_m),
                _ => (false, false),
            };
            if mark.placed && outcome.diagnosis.verdict.names_effects() {
                mark.covered = covered(arm, blind, outcome)?;
            }
        }
    }
    Ok(mark)
}

/// Root mean square of the held-out rows that the generator did not spoil, m.
fn held_out_m(blind: &Blind, outcome: &Outcome<ArmCorrection>) -> f64 {
    let spoiled: Vec<f64> = blind.spoiled().iter().map(|&sample| blind.measured().samples[sample].time_s).collect();
    let good = outcome.diagnosis.points.iter().filter(|point| point.held_out && !spoiled.contains(&point.time_s));
    root_mean_square(&good.filter_map(|point| point.visit.as_ref()).map(|visit| visit.after_m).collect::<Vec<_>>())
}

/// Whether the laws, and whether the places too, are those of the truth, each once.
fn named(truth: &[Sealed], effects: &[Found]) -> (bool, bool) {
    let named: Vec<Named> = effects.iter().map(law_and_part).collect();
    right(&pairs(truth), &named)
}

/// Law and part of each secret that a law is right for.
pub(super) fn pairs(truth: &[Sealed]) -> Vec<Named> {
    truth.iter().filter_map(|sealed| sealed.cause).map(|(law, place)| (law, place.part())).collect()
}

/// Whether the laws, and whether the laws with their places, are the same on both sides, in any order.
pub(super) fn right(truth: &[Named], named: &[Named]) -> (bool, bool) {
    let [mut truth, mut named] = [truth.to_vec(), named.to_vec()];
    truth.sort_unstable();
    named.sort_unstable();
    let laws = |pairs: &[Named]| pairs.iter().map(|(law, _)| *law).collect::<Vec<_>>();
    (laws(&truth) == laws(&named), truth == named)
}

/// Whether each true effect is in the set of a different effect, and all members of the sets predict the same.
fn in_sets(arm: &Arm, blind: &Blind, outcome: &Outcome<ArmCorrection>, same_m: f64) -> (bool, bool) {
    let truth = blind.unseal();
    let n = outcome.correction.best_effects.len() - arm.model.effects.len();
    if n != truth.len() {
        return (false, false);
    }
    let holds = |set: usize, sealed: &Sealed, place: bool| {
        let members = outcome.diagnosis.alternatives.iter().filter(|other| other.instead_of == set);
        members.into_iter().any(|other| match place {
            true => sealed.is_at_part(other.law, &other.site.place),
            false => sealed.cause.is_some_and(|(law, _)| law == other.law),
        })
    };
    let fits = |place: bool| {
        let straight = (0..n).all(|k| holds(k, &truth[k], place));
        straight || n == 2 && (0..n).all(|k| holds(k, &truth[1 - k], place))
    };
    let named = fits(false) && predict_the_same(arm, blind, outcome, same_m);
    (named, named && fits(true))
}

fn predict_the_same(arm: &Arm, blind: &Blind, outcome: &Outcome<ArmCorrection>, same_m: f64) -> bool {
    let run = blind.measured();
    let sigma = sigma(outcome);
    let training = Observations::new(arm, run, sigma, |sample| !sample.held_out);
    let best = with_effects(arm, &outcome.correction.best_effects);
    let mut scratch = ArmScratch::default();
    let anywhere = anywhere(arm, run, &best, &mut scratch);
    let observations = Observations::new(arm, &anywhere, sigma, |_| true);
    for other in &outcome.diagnosis.alternatives {
        let mut effects = outcome.correction.best_effects.to_vec();
        let Some(effect) = candidate(arm, &effects, (other.law, other.site.place)) else { continue };
        effects[arm.model.effects.len() + other.instead_of] = effect;
        let model = with_effects(arm, &effects);
        // A member that has no pose at a word predicts none.
        let Ok(fitted) = fit(&model, &training, &values(&model), &mut scratch) else { return false };
        let Ok(apart) = observations.residuals(&fitted.model, &mut scratch) else { return false };
        if root_mean_square(&observations.distances_m(&apart)) > same_m {
            return false;
        }
    }
    true
}

/// Random words where the model predicts the tool, under the conditions of the run.
fn anywhere(arm: &Arm, run: &Run, model: &ArmModel, scratch: &mut ArmScratch) -> Run {
    let steps = candidates(arm, 0xface);
    let mut samples = Vec::new();
    for (step, under) in steps.iter().zip(run.samples.iter().cycle()) {
        let mut sample = under.clone();
        (sample.word, sample.previous) = (step.word, Some(step.previous));
        let at = Run { samples: vec![sample.clone()], ..Run::default() };
        let row = Observations::new(arm, &at, [1.0; 6], |_| true);
        if let Ok(pose) = model.predict(&row.condition(&row.rows[0]), scratch) {
            sample.pose = pose;
            samples.push(sample);
        }
    }
    Run { samples, ..Run::default() }
}

fn with_effects(arm: &Arm, effects: &[Effect<f64>]) -> ArmModel {
    let mut model = arm.model.clone();
    model.effects = effects.iter().copied().collect();
    model
}

/// The law at the place: the one that is known, or a new one.
fn candidate(arm: &Arm, known: &[Effect<f64>], wanted: Named) -> Option<Effect<f64>> {
    let all = known.iter().copied().chain(all(&arm.model));
    all.into_iter().find(|effect| (effect.name(), Place::of_arm(effect)) == wanted)
}

fn sigma(outcome: &Outcome<ArmCorrection>) -> [f64; 6] {
    let mut sigma = [1e-12; 6];
    if let Some(repeats) = &outcome.diagnosis.repeatability {
        let axes: &[usize] = if repeats.axes.len() == 3 { &[2, 3, 4] } else { &[0, 1, 2, 3, 4, 5] };
        axes.iter().zip(&repeats.axes).for_each(|(&axis, figure)| sigma[axis] = figure.value.max(1e-12));
    }
    sigma
}

/// How many intervals hold the value that the right laws take on the clean run, of how many.
fn covered(arm: &Arm, blind: &Blind, outcome: &Outcome<ArmCorrection>) -> Result<[usize; 2]> {
    let effects = &outcome.diagnosis.effects;
    let model = with_effects(arm, &outcome.correction.best_effects);
    let clean = Observations::new(arm, blind.clean(), sigma(outcome), |_| true);
    let truth = fit(&model, &clean, &values(&model), &mut ArmScratch::default()).map_err(|no_pose| no_pose.error)?;
    let mut counts = [0, 0];
    for (found, effect) in effects.iter().zip(truth.model.effects.iter()) {
        let at_its_place = blind.unseal().iter().any(|sealed| sealed.cause == Some((found.law, found.site.place)));
        for parameter in found.values.iter().filter(|_| at_its_place) {
            let of_name = effect.quantities().iter().position(|quantity| quantity.name == parameter.name);
            let Some(value) = of_name.map(|k| effect.values()[k]) else { continue };
            let Some([low, high]) = parameter.ci95 else { continue };
            counts[0] += usize::from(low <= value && value <= high);
            counts[1] += 1;
        }
    }
    Ok(counts)
}

/// Whether the variable reported first is the one that the mechanism follows.
fn right_variable(blind: &Blind, outcome: &Outcome<ArmCorrection>) -> bool {
    let Some(first) = outcome.diagnosis.remaining.depends_on.first() else { return false };
    blind.unseal().iter().filter_map(|sealed| sealed.regressor.as_ref()).any(|truth| match truth {
        Regressor::Digits(both) => both.iter().any(|&actuator| first.regressor.is_of_actuator(actuator)),
        truth => first.regressor == *truth,
    })
}

fn answer(outcome: &Outcome<ArmCorrection>) -> String {
    let effects = outcome.diagnosis.effects.iter().map(|found| format!("{} {}", found.law, found.site));
    let others = outcome
        .diagnosis
        .alternatives
        .iter()
        .filter(|_| outcome.diagnosis.verdict == Verdict::NotIdentifiable)
        .map(|other| format!("({}) {} {}", other.instead_of, other.law, other.site));
    let first = outcome.diagnosis.remaining.depends_on.first();
    let variable = first.filter(|_| outcome.diagnosis.verdict == Verdict::UnexplainedStructure).map(|d| {
        let best = outcome.correction.best_effects.iter().map(|e| format!("[{} {}]", e.name(), place_code(e)));
        format!("{} {}", d.variable, best.collect::<String>())
    });
    let all: Vec<String> = effects.chain(others).chain(variable).collect();
    format!("{}: {}", outcome.diagnosis.verdict, all.join(" + "))
}
