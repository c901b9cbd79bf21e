//! The closed loop: words are chosen, measured and diagnosed, look by look, until the verdict is confirmed and certain enough.
//!
//! ```text
//!            ┌──────────── visits of the next look ◄───────────┐
//!            ▼                                                 │
//!  first ─► station ─► rows ─► look: diagnose, predict ─► next ┤
//!                                                              └─► why it ends
//! ```
//!
//! [`look`] is a function from what was measured to a verdict and either more visits or the reason to end; it keeps
//! nothing. Whoever plays the visits is a [`Station`].
//!
//! # Levels
//!
//! The number of looks is fixed before the first one, and each may spend its share of the level of one diagnosis (see
//! [`spending`]): all looks together raise a false alarm no more often than one diagnosis does. Which words are held out is
//! drawn before anything is measured. Training rows alone choose effects and further words, held-out rows alone confirm.

pub mod spending;

mod design;
mod found;
mod rows;

use darm_arm::arm::Arm;
use darm_arm::arm::frames::DesiredFrame;
use darm_core::real::Vec3;
use serde::{Deserialize, Serialize};

use crate::correction::{ArmCorrection, Outcome};
use crate::diagnosis::{self, diagnose};
use crate::error::DiagnoseError;
use crate::measurement_plan::{NOISE, PlanStep};
use crate::outcome::{Diagnosis, Verdict};
use crate::prepare::observations::NoPose;
use crate::prepare::repeatability::repeated;
use crate::progress::Progress;
use crate::select::significance::Levels;
use darm_measure::{Run, Sample};
use design::Design;
use found::Found;

/// How an arm is calibrated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CalibrateOptions {
    /// How many looks there are at most; fixed before the first.
    pub looks: usize,
    /// Visits of the first, which has to measure the repeatability and to confirm by itself.
    pub first_visits: usize,
    /// Visits of each look after it.
    pub visits: usize,
    /// How far the pose at the frames may be from the predicted one, with 95 % confidence, m; `None`: a fifth of the
    /// repeatability, and where nothing was found half of it.
    pub goal_m: Option<f64>,
    /// Of all that is drawn.
    pub seed: u64,
}

impl CalibrateOptions {
    /// How far the pose at the frames may be from the predicted one, in units of the repeatability, where no goal is given:
    /// a fifth adds 2 % to what is measured there.
    const DEFAULT_GOAL: f64 = 0.2;
    /// The goal in units of the repeatability where nothing was found: that of the candidate effect that is determined worst.
    const DEFAULT_GOAL_OF_NOTHING: f64 = 0.5;

    /// How far the pose at the frames may be from the predicted one after this diagnosis, m.
    pub fn goal_after(&self, found: &Diagnosis) -> f64 {
        let repeats_m = found.repeatability.as_ref().map_or(0.0, |repeats| repeats.norm.value);
        let share_of_repeats = match found.verdict {
            Verdict::NoEffect => Self::DEFAULT_GOAL_OF_NOTHING,
            _ => Self::DEFAULT_GOAL,
        };
        self.goal_m.unwrap_or(share_of_repeats * repeats_m)
    }

    /// The visits of each look.
    pub fn visits_of_looks(&self) -> Vec<usize> {
        (0..self.looks).map(|look| if look == 0 { self.first_visits } else { self.visits }).collect()
    }
}

impl Default for CalibrateOptions {
    fn default() -> Self {
        Self { looks: 11, first_visits: 62, visits: 31, goal_m: None, seed: 1 }
    }
}

/// What is calibrated.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The arm, model n.
    pub arm: &'a Arm,
    /// Where its tool is to go.
    pub frames: &'a [DesiredFrame],
    /// How.
    pub options: &'a CalibrateOptions,
}

/// Who plays visits and measures.
pub trait Station {
    /// Why there are no measurements.
    type Error;

    /// Visits these words, beginning from the word at rest; the samples in the order of the visits. Some may be missing.
    ///
    /// # Errors
    ///
    /// The arm could not be moved, or not be measured.
    fn measure(&mut self, visits: &[PlanStep]) -> Result<Vec<Sample>, Self::Error>;
}

/// What was measured so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// All samples.
    pub run: Run,
    /// Looks that they are of.
    pub looks: usize,
}

/// What one look says.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Its share of the chance of a false alarm.
    pub share: f64,
    /// The diagnosis of all rows so far, at that share of its levels.
    pub outcome: Outcome<ArmCorrection>,
    /// How far the pose at the frames may be from the predicted one, with 95 % confidence, m; `None` where the verdict predicts
    /// nothing.
    pub uncertainty_m: Option<f64>,
    /// How far it may be.
    pub goal_m: f64,
    /// What is next.
    pub next: Next,
}

/// What comes after a look.
#[derive(Clone, Debug, PartialEq)]
pub enum Next {
    /// These visits.
    Measure(Vec<PlanStep>),
    /// Nothing more.
    Stop(Reason),
}

/// Why a calibration ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// The verdict is confirmed, and the pose at the frames is predicted as certainly as it is to be.
    Reached,
    /// Model and log do not belong together: more of the same says nothing.
    WrongModelOrLog,
    /// More than half of what the measured positions vary by is left: the model is that of another arm, or far from this one.
    OtherArm,
    /// There is no look left.
    NoLookLeft,
}

impl Task<'_> {
    /// The visits of the first look.
    ///
    /// # Errors
    ///
    /// The model of the arm has no pose for a word.
    pub fn first(&self) -> Result<Vec<PlanStep>, DiagnoseError> {
        let run = Run::default();
        Design::new(self.arm, self.options.seed).next(self, &run, None, 0).map_err(|none| no_pose(&run, none))
    }

    /// The noise of each component of a twist by repeats; where these are few, that of a usual camera.
    fn sigma(&self, run: &Run) -> [f64; 6] {
        repeated(self.arm, run).filter(|noise| noise.is_known()).map_or(NOISE, |noise| noise.sigma)
    }
}

impl State {
    /// With the samples of one more look.
    #[must_use]
    pub fn with(mut self, samples: Vec<Sample>) -> Self {
        let last_s = self.run.samples.last().map_or(f64::NEG_INFINITY, |sample| sample.time_s);
        let first_s = samples.first().map_or(f64::INFINITY, |sample| sample.time_s);
        // A board that was started again counts from zero.
        let later_s = if first_s > last_s { 0.0 } else { last_s - first_s + RESTART_S };
        let run = self.looks as u32;
        let later = samples.into_iter().map(|sample| Sample { time_s: sample.time_s + later_s, run, ..sample });
        self.run.samples.extend(later);
        self.looks += 1;
        self
    }
}

/// Time between the rows before and after a restart of the board, s.
const RESTART_S: f64 = 1.0;

impl Look {
    /// Why a calibration with this goal, m, ends here, however many looks are left.
    pub fn end_at(&self, goal_m: f64) -> Option<Reason> {
        end(self.outcome.diagnosis.verdict, self.uncertainty_m, goal_m)
    }

    /// About how many more visits the goal takes after `made`: the uncertainty falls with the root of their number. `None`
    /// where the verdict predicts nothing yet.
    pub fn visits_left(&self, made: usize) -> Option<usize> {
        let ratio = self.uncertainty_m? / self.goal_m;
        let left = made as f64 * (ratio * ratio - 1.0);
        left.is_finite().then(|| left.max(0.0).ceil() as usize)
    }
}

/// Looks at what was measured so far: the verdict, and what is next.
///
/// # Errors
///
/// The measurements do not fit the arm, or have too few words.
pub fn look(task: &Task, state: &State, progress: &Progress) -> Result<Look, DiagnoseError> {
    let (options, run) = (task.options, &state.run);
    let shares = spending::shares(&options.visits_of_looks());
    let share = shares.get(state.looks.saturating_sub(1)).copied().unwrap_or(0.0);
    let levels = Levels::share(share);
    let how = diagnosis::PoseOptions { seed: options.seed, levels, progress: progress.clone(), ..Default::default() };
    let outcome = diagnose(task.arm, run, &how)?;
    let none = |none| no_pose(run, none);
    let uncertainty_m = uncertainty_m(task, run, &outcome).map_err(none)?;
    let goal_m = options.goal_after(&outcome.diagnosis);
    let next = match end(outcome.diagnosis.verdict, uncertainty_m, goal_m) {
        Some(reason) => Next::Stop(reason),
        None if predicts_nothing(run, &outcome.diagnosis) => Next::Stop(Reason::OtherArm),
        None if state.looks >= options.looks => Next::Stop(Reason::NoLookLeft),
        None => {
            let found = Found::of(task, run, &outcome).map_err(none)?;
            let design = Design::new(task.arm, options.seed);
            Next::Measure(design.next(task, run, found.as_ref(), state.looks).map_err(none)?)
        }
    };
    Ok(Look { share, outcome, uncertainty_m, goal_m, next })
}

fn end(verdict: Verdict, uncertainty_m: Option<f64>, goal_m: f64) -> Option<Reason> {
    match verdict {
        Verdict::WrongModelOrLog => Some(Reason::WrongModelOrLog),
        Verdict::EffectFound | Verdict::NoEffect if uncertainty_m.is_some_and(|m| m <= goal_m) => Some(Reason::Reached),
        _ => None,
    }
}

/// More of the spread of the measured positions than this is left by no model of the arm: effects are a few percent of it.
const MAX_LEFT: f64 = 0.5;

/// Whether the model, with the effects that were found, does not predict where the tool is.
fn predicts_nothing(run: &Run, diagnosis: &Diagnosis) -> bool {
    let axes = diagnosis.error.after.train.axes.iter().filter(|figure| figure.unit == "m");
    let error_m = axes.map(|figure| figure.value * figure.value).sum::<f64>().sqrt();
    let is_open = matches!(diagnosis.verdict, Verdict::UnexplainedStructure | Verdict::PartlyExplained);
    is_open && error_m > MAX_LEFT * spread_m(run)
}

/// How far the measured positions of the tool are from their mean, root mean square, m.
fn spread_m(run: &Run) -> f64 {
    let positions = || run.samples.iter().map(|sample| sample.pose.position);
    let n = positions().len().max(1) as f64;
    let mean = positions().sum::<Vec3<f64>>() / n;
    (positions().map(|position| (position - mean).norm_squared()).sum::<f64>() / n).sqrt()
}

/// How far the pose at the frames may be from the predicted one.
fn uncertainty_m(task: &Task, run: &Run, outcome: &Outcome<ArmCorrection>) -> Result<Option<f64>, NoPose> {
    match outcome.diagnosis.verdict {
        verdict if verdict.names_effects() => found::of_named(task, run, &outcome.correction.best_effects).map(Some),
        Verdict::NoEffect => {
            let steps = Design::new(task.arm, task.options.seed).steps();
            found::of_any(task, run, &steps).map(Some)
        }
        _ => Ok(None),
    }
}

fn no_pose(run: &Run, NoPose { sample, error }: NoPose) -> DiagnoseError {
    DiagnoseError::NoPose { line: run.line(sample), error }
}

#[cfg(test)]
mod tests;
