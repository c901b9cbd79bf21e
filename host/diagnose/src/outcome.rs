//! What a diagnosis says: plain data in the shape of the JSON report.
//!
//! Numbers are in SI units and radians; every number stands beside its unit or carries it in its name.

use darm_core::effect::Effect;
use darm_core::effect::drift::Drift;
use darm_core::effect::wear::Wear;
use serde::Serialize;

use crate::judge::fitted_terms::WithTerms;
use crate::judge::structure::Structure;
use crate::measurement::Run;
use crate::prepare::observations::Observations;
use crate::prepare::repeatability::Repeatability;
use darm_arm::arm::{Arm, ZERO_CELSIUS};

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Diagnosis {
    /// What was observed: `tool-pose`.
    pub kind: &'static str,
    /// Number of the model that was diagnosed.
    pub model: u32,
    /// How many rows there were.
    pub rows: Rows,
    /// How the rows were chosen that the fit did not see.
    pub held_out: String,
    /// Scatter of repeated conditions; `None` where nothing was repeated.
    pub repeatability: Option<Repeatability>,
    /// Predicted minus measured, of the model as it was and with the effects found.
    pub error: BeforeAfter,
    /// The verdict.
    pub verdict: Verdict,
    /// The effects that are named.
    pub effects: Vec<Found>,
    /// What explains the measurements as well as an effect found does.
    pub alternatives: Vec<Alternative>,
    /// Values that no row of these measurements tells anything of.
    pub unobservable: Vec<String>,
    /// Rows that fit nothing.
    pub outliers: Vec<Outlier>,
    /// On what the residual depends before any effect is added.
    pub structure: Structure,
    /// On what it depends with the effects found.
    pub remaining: Structure,
    /// Everything that was tried.
    pub ladder: Vec<Rung>,
    /// Condition number of the information about all values found, each scaled to its own.
    pub condition: f64,
    /// What to measure to tell alternatives apart; `None` where there is nothing to tell apart.
    pub next_measurement: Option<NextMeasurement>,
    /// The same for a person, a sentence each.
    pub plain: Vec<String>,
    /// Of the shuffling of words into folds.
    pub seed: u64,
    /// Of this program.
    pub version: &'static str,
    /// Residual of each row before and after, for plots.
    pub points: Vec<Point>,
    /// The effects found, as the model holds them, after those that it had.
    #[serde(skip)]
    pub(crate) model_effects: Vec<Effect<f64>>,
    /// The same with what no law explains as fitted terms; `None` where there is nothing to keep.
    #[serde(skip)]
    pub(crate) with_terms: Option<WithTerms>,
    /// Whether the terms are to be kept.
    #[serde(skip)]
    pub(crate) keeps_terms: bool,
}

/// The answer in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The effects named explain what was beyond the noise.
    EffectFound,
    /// There is nothing beyond the noise.
    NoEffect,
    /// There is something beyond the noise that no law explains.
    UnexplainedStructure,
    /// Several explanations are as good as each other: none of them is named.
    NotIdentifiable,
}

/// Numbers of rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Rows {
    /// That the fit saw.
    pub train: usize,
    /// That it did not.
    pub heldout: usize,
}

/// Errors of two models.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BeforeAfter<F = ErrorFigure> {
    /// Of the model as it was.
    pub before: Errors<F>,
    /// With the effects found.
    pub after: Errors<F>,
}

/// Errors of one model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Errors<F = ErrorFigure> {
    /// On the rows that the fit saw.
    pub train: F,
    /// On the rows that it did not see; `None` where none were held out.
    pub heldout: Option<F>,
}

impl<F> Errors<F> {
    /// On rows that no fit saw; on those that it saw where none were held out.
    pub fn unseen(&self) -> &F {
        self.heldout.as_ref().unwrap_or(&self.train)
    }
}

/// Root mean squares of an error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErrorFigure {
    /// Of each axis of the tool frame.
    pub axes: Vec<AxisFigure>,
    /// As a distance d between poses, m.
    pub distance_m: f64,
    /// The largest distance, m.
    pub largest_m: f64,
}

/// One number of one axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisFigure {
    /// Its name: of a tool pose `x`, `y`, `z` or a turn about one of them.
    pub axis: String,
    /// The number.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
}

/// An effect that is named.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Found {
    /// The law.
    pub law: &'static str,
    /// Where it acts: `actuator 4, state 1`.
    #[serde(rename = "where")]
    pub place: String,
    /// The same as a person would call it.
    pub place_name: String,
    /// Its values.
    pub parameters: Vec<Parameter>,
    /// By how much the held-out error would be larger without it, as a distance d, m.
    pub heldout_gain_m: Option<f64>,
}

/// One value of an effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Its name.
    pub name: &'static str,
    /// The value.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
    /// With 95 % confidence it lies in here.
    pub ci95: [f64; 2],
}

/// Another explanation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alternative {
    /// Number of the effect, among those that explain the measurements best, whose place it could take.
    pub instead_of: usize,
    /// The law.
    pub law: &'static str,
    /// Where it acts.
    #[serde(rename = "where")]
    pub place: String,
    /// The same as a person would call it.
    pub place_name: String,
    /// Cross-validated error, in the unit of the observation's norm.
    pub cross_validated: f64,
    /// Confidence that it is worse than the best one.
    pub worse_with: f64,
}

/// A row that fits nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Outlier {
    /// Its line in the file, the header being 1.
    pub line: usize,
    /// How far it is off, as a distance d, m.
    pub distance_m: f64,
    /// The same in units of the noise.
    pub sigmas: f64,
}

/// One model that was tried.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rung {
    /// How many effects had been found before.
    pub step: usize,
    /// The law that was added.
    pub law: &'static str,
    /// Where.
    #[serde(rename = "where")]
    pub place: String,
    /// How many values it has that these measurements tell something of.
    pub values: usize,
    /// Cross-validated error with it, in the unit of the observation's norm.
    pub cross_validated: f64,
    /// The same without it.
    pub without: f64,
    /// Chance of such a gain where there is none, times the number of effects tried.
    pub p: f64,
    /// Whether it was fitted in full; the others were judged by their linear fit.
    pub refined: bool,
    /// Whether it was kept.
    pub kept: bool,
}

/// A measurement that would tell more.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextMeasurement {
    /// Words to visit in this order.
    pub words: Vec<String>,
    /// Under which conditions, where those of this measurement would not do.
    pub conditions: Option<String>,
    /// What they tell apart.
    pub tells: String,
}

/// One row in the plots.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// When.
    pub time_s: f64,
    /// The word.
    pub word: String,
    /// Positions of the servo joints, rad or m.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub servos_rad: Vec<f64>,
    /// Supply, Pa.
    pub supply: Option<f64>,
    /// Temperature.
    pub temperature_c: Option<f64>,
    /// Whether the fit did not see it.
    pub held_out: bool,
    /// Error of the model as it was, m.
    pub before_m: f64,
    /// Error with the effects found, m.
    pub after_m: f64,
    /// The residual's components before: turn (rad) and shift (m), in the order of the error's axes.
    pub before: Vec<f64>,
    /// The same after.
    pub after: Vec<f64>,
}

impl Diagnosis {
    /// The effects of the best model, whether they are named or not, after those that the model had.
    pub fn best_effects(&self) -> &[Effect<f64>] {
        &self.model_effects
    }

    /// Keeps what no law explains in the corrected arm, as what it is, beside the effects of the best model; whether there
    /// is anything to keep.
    pub fn keep_terms(&mut self) -> bool {
        self.keeps_terms = self.with_terms.is_some();
        self.keeps_terms
    }

    /// The arm with the effects that were found, with the fitted terms if these are to be kept, the next model number and
    /// the conditions that it had settled to at the end of `run`; the same arm where there is neither.
    pub fn corrected(&self, arm: &Arm, run: &Run) -> Arm {
        let mut corrected = arm.clone();
        let kept = match &self.with_terms {
            Some(with_terms) if self.keeps_terms => Some(&with_terms.effects),
            _ => (self.verdict == Verdict::EffectFound).then_some(&self.model_effects),
        };
        if let Some(effects) = kept {
            let last = Observations::new(arm, run, [1.0; 6], |_| true).last();
            corrected.model.effects = effects.iter().map(|effect| lasting(effect, &last)).collect();
            corrected.model.number += 1;
            let (supply, temperature_c) = run.settled();
            corrected.model.working_supply = supply.unwrap_or(corrected.model.working_supply);
            let temperature_k = temperature_c.map(|celsius| celsius + ZERO_CELSIUS);
            corrected.model.working_temperature_k = temperature_k.unwrap_or(corrected.model.working_temperature_k);
        }
        corrected
    }
}

/// The effect as it stands after a measurement that ended at this time, s, with so many switches of each actuator.
fn lasting(effect: &Effect<f64>, (end_s, switches): &(f64, Vec<f64>)) -> Effect<f64> {
    match *effect {
        Effect::Drift(law) => Drift { until_s: *end_s, ..law }.into(),
        Effect::Wear(law) => {
            let counted = switches.get(usize::from(law.actuator)).copied();
            Wear { until_switches: counted.unwrap_or_default(), ..law }.into()
        }
        other => other,
    }
}

/// Name and unit of a component of a twist, ω first.
pub(crate) fn axis_name(axis: usize) -> (&'static str, &'static str) {
    [("about x", "rad"), ("about y", "rad"), ("about z", "rad"), ("x", "m"), ("y", "m"), ("z", "m")][axis]
}
