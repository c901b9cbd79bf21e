//! One course of the loop: synthesis, table, board, measurement, diagnosis, and both ways to close it.

use anyhow::{Context, Result};
use darm_arm::arm::{Arm, frames::DesiredFrame};
use darm_arm::plan::Visit;
use darm_arm::reach::better_words::better_words;
use darm_arm::stops::{self, Setting};
use darm_core::units::Word;
use darm_diagnose::correction::{self, Outcome};
use darm_diagnose::diagnosis;
use darm_diagnose::diagnosis::diagnose;
use darm_diagnose::measurement_plan::{self, PlanStep, plan};
use darm_diagnose::outcome::Diagnosis;
use darm_diagnose::outcome::Verdict;
use darm_diagnose::truth::{Sealed, Truth, scatter_m};
use darm_measure::Run;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;

use crate::conditions::Trend;
use crate::measure::{Measured, Station, Stop, measure};
use crate::report::PlanFigures;
use crate::rig::Rig;
use crate::task::{Design, Task};
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
    /// With other stops; `None` where words alone are to close it.
    pub(crate) by_stops: Option<ByStops>,
    /// The desired frames with the words that model n+1 chose for the metal as it was.
    pub(crate) words: Vec<DesiredFrame>,
    /// Errors with these words.
    pub(crate) table_only: FrameErrors,
}

/// The loop closed by stops that were set again.
pub(crate) struct ByStops {
    /// The arm as it was to be set.
    pub(crate) arm: Arm,
    /// What a person turned.
    pub(crate) settings: Vec<Setting>,
    /// Errors with the stops set again.
    pub(crate) errors: FrameErrors,
}

impl Closed {
    /// Errors of the closure that counts: the stops, where they were set again.
    pub(crate) fn errors(&self) -> &FrameErrors {
        self.by_stops.as_ref().map_or(&self.table_only, |by_stops| &by_stops.errors)
    }
}

/// What one course found.
pub(crate) struct Course {
    /// What the metal was made by.
    pub(crate) design: Design,
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
    /// What a measurement at the frames scatters by, as they count errors, m.
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
        (SHARE_LEFT * self.before.rms_m()).max(REPEATS_LEFT * self.scatter_m)
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
    design: Design,
    rig: &mut Rig,
    progress: &Progress,
    keep: &mut dyn FnMut(&str, Keep) -> Result<()>,
) -> Result<Course> {
    let Design { arm, wanted, .. } = &design;
    let judged = Arm { length_scale_m: task.length_scale_m(), ..arm.clone() };
    let truth = Truth::draw(&judged, wanted, task.seed, task.effect)?;
    let rng = ChaCha8Rng::seed_from_u64(task.seed ^ 0xca3e_7a00);
    let mut station = Station { rig, rng, progress };

    let steps =
        plan(arm, &measurement_plan::PlanOptions { seed: task.seed, ..measurement_plan::PlanOptions::default() });
    progress.say(format!("table: {} visits measured, {FRAME_VISITS} × {} frames", steps.len(), wanted.len()));
    let mut stops = frame_visits(wanted);
    let n_frame_stops = stops.len();
    stops.extend(
        steps.iter().map(|step| Stop { visit: visit(step.word, &step.servos_rad, "plan"), held_out: step.held_out }),
    );
    let measured = measure(&mut station, arm, &truth, &stops)?;
    let (plan, start_s) = (figures(&steps, &measured), measured.start_s);
    let (at_frames, run) = split(measured.run, n_frame_stops as u32);
    let before = errors(arm, wanted, &at_frames);
    keep("run.csv", Keep::Run(&run))?;

    progress.say("diagnosis");
    let Outcome { diagnosis, correction } =
        diagnose(arm, &run, &diagnosis::PoseOptions { seed: task.seed, ..diagnosis::PoseOptions::default() })?;
    keep("diagnosis.json", Keep::Diagnosis(&diagnosis))?;
    let closed = match diagnosis.verdict {
        verdict if verdict.names_effects() => {
            let corrected = correction.corrected(arm, &run, correction::Keep::Effects);
            let corrected = corrected.context("a named effect corrects the model")?;
            keep("arm-corrected.toml", Keep::Arm(&corrected))?;
            let next_s = at_frames.samples.last().map_or(0.0, |sample| sample.time_s);
            let trend = Trend { arm: &corrected, run: &run, start_s, next_s };
            let closed = close(task, &trend, wanted, &truth, &mut station)?;
            if let Some(by_stops) = &closed.by_stops {
                keep("arm-stops.toml", Keep::Arm(&by_stops.arm))?;
            }
            Some(closed)
        }
        _ => None,
    };
    let sealed = truth.unseal().clone();
    let scatter_m = repeatability_m(task, &diagnosis).unwrap_or_else(|| scatter_m(&judged));
    Ok(Course { design, plan, before, diagnosis, sealed, closed, scatter_m })
}

/// What a diagnosis found repeated conditions to scatter by, as the frames count errors, m.
fn repeatability_m(task: &Task, diagnosis: &Diagnosis) -> Option<f64> {
    let repeats = diagnosis.repeatability.as_ref()?;
    let positions = repeats.axes.iter().filter(|axis| axis.unit == "m");
    Some(match task.is_for_positions() {
        true => positions.map(|axis| axis.value.powi(2)).sum::<f64>().sqrt(),
        false => repeats.norm.value,
    })
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

/// Closes the loop with model n+1: by other stops, unless the frames are positions, and by better words for the metal as it is,
/// at the conditions in which they will be played.
fn close(
    task: &Task,
    trend: &Trend,
    wanted: &[DesiredFrame],
    truth: &Truth,
    station: &mut Station<'_>,
) -> Result<Closed> {
    let by_stops = match task.is_for_positions() {
        true => None,
        false => Some(close_by_stops(task, trend.arm, wanted, truth, station)?),
    };
    station.progress.say("closing by the table: better words for the metal as it is");
    let corrected = &trend.continued(station.rig.client.now_s());
    let words: Vec<DesiredFrame> = better_words(corrected, wanted)?.into_iter().map(|(frame, _)| frame).collect();
    let measured = measure(station, corrected, truth, &frame_visits(&words))?;
    let table_only = errors(corrected, &words, &measured.run);
    Ok(Closed { by_stops, words, table_only })
}

fn close_by_stops(
    task: &Task,
    corrected: &Arm,
    wanted: &[DesiredFrame],
    truth: &Truth,
    station: &mut Station<'_>,
) -> Result<ByStops> {
    station.progress.say("closing by the stops: synthesis with the corrected model");
    let again = task.synthesis(corrected, wanted)?;
    let settings = stops::differences(corrected, &again.arm)?;
    let metal = stops::apply(corrected, &settings, SETTING_ERROR_M, task.seed)?;
    let reached: Vec<DesiredFrame> = again.frames.iter().map(|reached| reached.frame.clone()).collect();
    let there = truth.with_geometry(&metal);
    let measured = measure(station, &again.arm, &there, &frame_visits(&reached))?;
    Ok(ByStops { errors: errors(corrected, &reached, &measured.run), arm: again.arm, settings })
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
fn figures(steps: &[PlanStep], measured: &Measured) -> PlanFigures {
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
    let each_m = frames.iter().enumerate().map(|(index, frame)| {
        let there = run
            .samples
            .iter()
            .filter(|sample| sample.visit.checked_sub(1).is_some_and(|visit| visit as usize % frames.len() == index));
        rms(there.map(|sample| frame.distance_m(arm, &sample.pose)))
    });
    FrameErrors { each_m: each_m.collect() }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value * value, count + 1.0));
    if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use darm_arm::arm::ArmScratch;
    use darm_diagnose::truth::Kind;
    use darm_figures::progress::Progress;

    use crate::ArmKind;
    use crate::rig::Rig;

    #[test]
    fn words_alone_bring_an_arm_of_64_6_words_to_its_positions_again() {
        let task = ArmKind::Spatial6.task(3, Some(Kind::StrokeLoss)).unwrap();
        let design = task.design().unwrap();
        for frame in &design.wanted {
            let drawn = design.arm.model.chain.pose_base_tool(&frame.word, &[], &mut ArmScratch::default()).unwrap();
            assert!(frame.distance_m(&design.arm, &drawn) < 0.2e-3, "frame {} of the file", frame.name);
        }
        let mut rig = Rig::in_process(&design.arm).unwrap();
        let course = super::run(&task, design, &mut rig, &Progress::silent(), &mut |_, _| Ok(())).unwrap();
        assert!(course.placed_rightly(), "{:?} of {:?}", course.diagnosis.effects, course.sealed);
        let closed = course.closed.as_ref().unwrap();
        assert!(closed.by_stops.is_none(), "the metal stays as it is");
        let (before_m, after_m) = (course.before.rms_m(), closed.table_only.rms_m());
        assert!(before_m > 4e-3 && after_m < course.goal_m(), "{before_m} m before, {after_m} m after");
    }
}
