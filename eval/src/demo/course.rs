//! One course of the loop: synthesis, table, board, measurement, diagnosis, and both ways to close it.

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Context, Result};
use darm::report::PlanFigures;
use darm_arm::arm::{Arm, frames, frames::DesiredFrame};
use darm_arm::plan::Visit;
use darm_arm::reach::better_words::better_words;
use darm_arm::stops::{self, Setting};
use darm_arm::synthesis::{self, Synthesis, synthesize};
use darm_core::se::Pose;
use darm_core::units::Word;
use darm_diagnose::correction::{self, Outcome};
use darm_diagnose::diagnosis;
use darm_diagnose::diagnosis::diagnose;
use darm_diagnose::measurement::Run;
use darm_diagnose::measurement_plan::{self, Step, plan};
use darm_diagnose::outcome::Diagnosis;
use darm_diagnose::outcome::Verdict;
use darm_diagnose::truth::{Kind, Sealed, Truth, scatter_m};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::measure::{Measured, Station, Stop, measure};
use super::rig::Rig;
use darm_figures::progress::Progress;

/// How long the arm rests in each visit once it has settled: two pictures of the camera and some time to spare.
const DWELL_S: f64 = 0.045;
/// Each desired frame is visited so often.
const FRAME_VISITS: usize = 3;
/// What may be left of the error at the desired frames, as a share of what it was.
const SHARE_LEFT: f64 = 0.2;
/// The same in units of the repeatability: what a measurement cannot distinguish from nothing.
const REPEATS_LEFT: f64 = 1.3;
/// A person turns a stop or an anchor to within this, one standard deviation.
const SETTING_ERROR_M: f64 = 20e-6;

/// What one course starts from.
pub(crate) struct Task {
    /// The initial arm.
    pub(crate) base_line: Arm,
    /// Where its tool is to go.
    pub(crate) desired: Vec<DesiredFrame>,
    /// Of everything that is drawn.
    pub(crate) seed: u64,
    /// The effect that the true arm is given; drawn where `None`.
    pub(crate) effect: Option<Kind>,
}

impl Task {
    /// Reads an arm file and its desired frames.
    pub(crate) fn read(arm: &Path, desired: &Path, seed: u64, effect: Option<Kind>) -> Result<Self> {
        let base_line = Arm::read(arm)?;
        let desired = in_turn(frames::read(desired, &base_line)?);
        Ok(Self { base_line, desired, seed, effect })
    }

    /// Finds the geometry that meets the desired frames.
    pub(crate) fn synthesis(&self) -> Result<Synthesis> {
        let options = synthesis::Options { seed: self.seed, ..synthesis::Options::default() };
        Ok(synthesize(&self.base_line, &self.desired, &options)?)
    }
}

/// Measured errors at the desired frames.
#[derive(Clone, Debug)]
pub(crate) struct FrameErrors {
    /// Of each frame, root mean square over its visits, as a distance d, m.
    pub(crate) each_m: Vec<f64>,
}

impl FrameErrors {
    /// Root mean square over the frames, m.
    pub(crate) fn rms_m(&self) -> f64 {
        rms(self.each_m.iter().copied())
    }
}

/// How the loop was closed, and what came of it.
pub(crate) struct Closed {
    /// The arm as it was to be set.
    pub(crate) arm: Arm,
    /// What a person turned.
    pub(crate) settings: Vec<Setting>,
    /// Errors with the stops set again.
    pub(crate) restopped: FrameErrors,
    /// The desired frames with the words that model n+1 chose for the metal as it was.
    pub(crate) words: Vec<DesiredFrame>,
    /// Errors with these words.
    pub(crate) table_only: FrameErrors,
}

/// What one course found.
pub(crate) struct Course {
    /// The synthesis that the metal was made by.
    pub(crate) synthesis: Synthesis,
    /// The desired frames, with the servo angles that it found.
    pub(crate) wanted: Vec<DesiredFrame>,
    /// The measurement plan in numbers.
    pub(crate) plan: PlanFigures,
    /// Errors at the desired frames before anything is known.
    pub(crate) before: FrameErrors,
    /// What the diagnosis says; it was made without a look at the truth.
    pub(crate) diagnosis: Diagnosis,
    /// What was true.
    pub(crate) sealed: Sealed,
    /// Nothing where no effect was found.
    pub(crate) closed: Option<Closed>,
    /// The camera's own scatter as a distance d, m.
    pub(crate) scatter_m: f64,
}

impl Course {
    /// Whether the law that is right for the effect was named, or silence was kept where there is none.
    pub(crate) fn named_rightly(&self) -> bool {
        match self.diagnosis.verdict {
            verdict if verdict.names_effects() => {
                self.diagnosis.effects.iter().all(|found| self.sealed.cause.is_some_and(|(law, _)| law == found.law))
            }
            Verdict::NoEffect => self.sealed.is_nothing(),
            _ => false,
        }
    }

    /// What may be left of the error at the desired frames, root mean square, m.
    pub(crate) fn goal_m(&self) -> f64 {
        let repeats_m = self.diagnosis.repeatability.as_ref().map_or(self.scatter_m, |repeats| repeats.norm.value);
        (SHARE_LEFT * self.before.rms_m()).max(REPEATS_LEFT * repeats_m)
    }

    /// Whether the place was named rightly as well.
    pub(crate) fn placed_rightly(&self) -> bool {
        self.named_rightly()
            && self.diagnosis.effects.iter().all(|found| self.sealed.cause == Some((found.law, found.site.place)))
    }
}

/// Runs the loop once. `keep` is given each result as it comes, before the next step can look at it.
pub(crate) fn run(
    task: &Task,
    synthesis: Synthesis,
    rig: &mut Rig,
    progress: &Progress,
    keep: &mut dyn FnMut(&str, Keep) -> Result<()>,
) -> Result<Course> {
    let arm = synthesis.arm.clone();
    let wanted: Vec<DesiredFrame> = synthesis.frames.iter().map(|reached| reached.frame.clone()).collect();
    let truth = Truth::draw(&arm, &wanted, task.seed, task.effect)?;
    let rng = ChaCha8Rng::seed_from_u64(task.seed ^ 0xca3e_7a00);
    let mut station = Station { rig, rng, progress };

    let steps = plan(&arm, &measurement_plan::Options { seed: task.seed, ..measurement_plan::Options::default() });
    progress.say(format!("table: {} visits measured, {FRAME_VISITS} × {} frames", steps.len(), wanted.len()));
    let mut stops = frame_visits(&wanted);
    let n_frame_stops = stops.len();
    stops.extend(
        steps.iter().map(|step| Stop { visit: visit(step.word, &step.servos_rad, "plan"), held_out: step.held_out }),
    );
    let measured = measure(&mut station, &arm, &truth, &stops)?;
    let plan = figures(&steps, &measured);
    let (at_frames, run) = split(measured.run, n_frame_stops as u32);
    let before = errors(&arm, &wanted, &at_frames);
    keep("run.csv", Keep::Run(&run))?;

    progress.say("diagnosis");
    let Outcome { diagnosis, correction } =
        diagnose(&arm, &run, &diagnosis::Options { seed: task.seed, ..diagnosis::Options::default() })?;
    keep("diagnosis.json", Keep::Diagnosis(&diagnosis))?;
    let closed = match diagnosis.verdict {
        verdict if verdict.names_effects() => {
            let corrected = correction.corrected(&arm, &run, correction::Keep::Effects);
            let corrected = corrected.context("a named effect corrects the model")?;
            keep("arm-corrected.toml", Keep::Arm(&corrected))?;
            let closed = close(task, &corrected, &wanted, &truth, &mut station)?;
            keep("arm-stops.toml", Keep::Arm(&closed.arm))?;
            Some(closed)
        }
        _ => None,
    };
    let sealed = truth.unseal().clone();
    Ok(Course { synthesis, wanted, plan, before, diagnosis, sealed, closed, scatter_m: scatter_m(&arm) })
}

/// A result to keep.
pub(crate) enum Keep<'a> {
    /// A measurement.
    Run(&'a Run),
    /// A diagnosis.
    Diagnosis(&'a Diagnosis),
    /// An arm.
    Arm(&'a Arm),
}

/// Both ways to close the loop with model n+1: stops set again, and better words for the metal as it is.
fn close(
    task: &Task,
    corrected: &Arm,
    wanted: &[DesiredFrame],
    truth: &Truth,
    station: &mut Station<'_>,
) -> Result<Closed> {
    station.progress.say("closing by the stops: synthesis with the corrected model");
    let options = synthesis::Options { seed: task.seed, ..synthesis::Options::default() };
    let again = synthesize(corrected, wanted, &options)?;
    let settings = stops::differences(corrected, &again.arm)?;
    let metal = stops::apply(corrected, &settings, SETTING_ERROR_M, task.seed)?;
    let reached: Vec<DesiredFrame> = again.frames.iter().map(|reached| reached.frame.clone()).collect();
    let there = truth.with_geometry(&metal);
    let measured = measure(station, &again.arm, &there, &frame_visits(&reached))?;
    let restopped = errors(corrected, &reached, &measured.run);

    station.progress.say("closing by the table: better words for the metal as it is");
    let words: Vec<DesiredFrame> = better_words(corrected, wanted)?.into_iter().map(|(frame, _)| frame).collect();
    let measured = measure(station, corrected, truth, &frame_visits(&words))?;
    let table_only = errors(corrected, &words, &measured.run);
    Ok(Closed { arm: again.arm, settings, restopped, words, table_only })
}

/// The frames as a program that goes round and round visits them: each is reached from the one before it.
fn in_turn(mut frames: Vec<DesiredFrame>) -> Vec<DesiredFrame> {
    let words: Vec<Word> = frames.iter().map(|frame| frame.word).collect();
    for (frame, &before) in frames.iter_mut().zip(words.iter().cycle().skip(words.len().saturating_sub(1))) {
        frame.previous = before;
    }
    frames
}

fn visit(word: Word, servos_rad: &[f64], label: &str) -> Visit {
    Visit { word, servos_rad: servos_rad.to_vec(), dwell_s: DWELL_S, label: label.to_owned() }
}

/// Every frame in turn, round and round; first of all the last one, from which the first is reached.
fn frame_visits(frames: &[DesiredFrame]) -> Vec<Stop> {
    let rounds = frames.iter().last().into_iter().chain((0..FRAME_VISITS).flat_map(|_| frames));
    rounds.map(|frame| Stop { visit: visit(frame.word, &frame.servos_rad, &frame.name), held_out: false }).collect()
}

/// What was measured, in numbers.
fn figures(steps: &[Step], measured: &Measured) -> PlanFigures {
    let words: BTreeSet<Word> = steps.iter().map(|step| step.word).collect();
    let held_out: BTreeSet<Word> = steps.iter().filter(|step| step.held_out).map(|step| step.word).collect();
    let repeats = steps.iter().filter(|step| step.repeat).count();
    PlanFigures {
        words: words.len(),
        held_out: held_out.len(),
        visits: (steps.len() - repeats) / words.len().max(1),
        repeats,
        rows: measured.run.samples.len(),
        table_rows: measured.table_rows,
        time_s: measured.time_s,
    }
}

/// The samples at the desired frames, and those of the measurement plan.
fn split(run: Run, n_frame_stops: u32) -> (Run, Run) {
    let (frames, plan) = run.samples.into_iter().partition(|sample| sample.visit < n_frame_stops);
    (Run { samples: frames, ..Run::default() }, Run { samples: plan, ..Run::default() })
}

/// Distances of the measured poses from the desired ones; `run` holds the visits of [`frame_visits`].
fn errors(arm: &Arm, frames: &[DesiredFrame], run: &Run) -> FrameErrors {
    let distance_m = |pose: &Pose<f64>, frame: &DesiredFrame| pose.distance(&frame.pose_base_tool, arm.length_scale_m);
    let each_m = frames.iter().enumerate().map(|(index, frame)| {
        let there = run
            .samples
            .iter()
            .filter(|sample| sample.visit.checked_sub(1).is_some_and(|visit| visit as usize % frames.len() == index));
        rms(there.map(|sample| distance_m(&sample.pose, frame)))
    });
    FrameErrors { each_m: each_m.collect() }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value * value, count + 1.0));
    if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 }
}
