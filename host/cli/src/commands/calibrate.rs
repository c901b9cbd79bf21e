//! `darm calibrate`: the closed loop: words are chosen, played, measured and diagnosed until the verdict is confirmed.

mod answer;
mod board;
mod folder;

use std::path::{Path, PathBuf};

use darm_arm::arm::Arm;
use darm_arm::arm::frames::{self, DesiredFrame};
use darm_arm::reach::better_words::better_words;
use darm_arm::synthesis::{self, Status, synthesize_by_few};
use darm_arm::wired_arm::WiredArm;
use darm_core::units::Word;
use darm_diagnose::calibrate::{CalibrateOptions, Look, Next, State, Station as _, Task, look};
use darm_diagnose::correction::Keep;
use darm_diagnose::measurement_plan::PlanStep;
use darm_diagnose::progress::Progress;
use darm_measure::visit_table::{MEASUREMENT_DWELL_S, default_dwell_s};

use super::adjust;
use crate::failure::Usage;
use crate::port::PortArgs;
use crate::ui::Ui;
use answer::{Adjusted, Calibrated, FrameReport, LookReport};
use board::Board;
use folder::{Folder, Settings};

const EXAMPLES: &str = "\
Examples:
  darm calibrate arm.toml planar4-frames.toml --poses sim --dwell 0.1   # `darm sim` runs
  darm --json calibrate arm.toml planar4-frames.toml --poses sim   # again, from the folder

SOURCE of the measured poses: sim, the camera of `darm sim`; tcp:HOST:PORT or unix:PATH, which send lines; a CSV file of such \
lines, or an MCAP log with their columns as keys, which another program writes meanwhile. `darm record --help` lists the \
columns.

Each look plays some visits, and diagnoses all rows so far. The next words are the most informative about what is still \
uncertain. The loop ends when the verdict is confirmed on held-out words and the pose at the frames is predicted as certainly \
as --goal wants it; at the latest after --looks. That number is fixed before the first look, and all looks together raise a \
false alarm no more often than one diagnosis does.

With --upload the frames are measured too, with their words before and with the nearest ones, and the nearest ones are uploaded.

FOLDER has all that was measured. A loop that was interrupted continues with the look that was not complete when the command \
is repeated. At the end the folder has run.csv, for `darm diagnose`, report.html with the verdict and its evidence, and, where an \
effect is named, model.toml with it, words.darm with the nearest words for the arm as it is, and adjusted.toml with the stops that \
bring its tool to the frames.";

/// Close the loop: measure, diagnose and choose the next words until the verdict is certain enough
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Calibrate {
    /// The arm
    #[arg(value_name = "ARM.toml")]
    arm: PathBuf,
    /// Frames that the tool is to reach
    #[arg(value_name = "FRAMES.toml")]
    frames: PathBuf,
    /// Source of measured poses: sim, tcp:HOST:PORT, unix:PATH, a CSV file or an MCAP log that is being written
    #[arg(long, value_name = "SOURCE")]
    poses: String,
    /// Folder of the calibration
    #[arg(long, value_name = "FOLDER", default_value = "calibration")]
    folder: PathBuf,
    /// Largest error of the predicted pose at the frames with 95 % confidence, in mm; default: a fifth of the
    /// repeatability, and half of it where nothing is found
    #[arg(long, value_name = "MM")]
    goal: Option<f64>,
    /// Number of looks at most: one of 62 visits, the others of 31
    #[arg(long, value_name = "N", default_value_t = 11, value_parser = clap::value_parser!(u16).range(1..))]
    looks: u16,
    /// Seed of the words, and of which are held out
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Rest at each visit, in seconds
    #[arg(long, value_name = "S", default_value_t = MEASUREMENT_DWELL_S)]
    dwell: f64,
    /// Profile of the board; default: the one that the arm names, else the one built into boards
    #[arg(long, value_name = "PROFILE.toml")]
    profile: Option<PathBuf>,
    /// Where an effect is named, measure the frames with the words before and with the nearest ones, and upload words.darm
    #[arg(long)]
    upload: bool,
    #[command(flatten)]
    port: PortArgs,
}

/// Why a calibration cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CalibrateError {
    #[error("no simulator runs; start `darm sim` in another terminal, or name another source with --poses")]
    NoSimulator,
    #[error("{}: the calibration was begun with another {what}; repeat that command, or choose another --folder", path.display())]
    OtherCalibration { path: PathBuf, what: &'static str },
    #[error("{}: the folder has other files; choose a new one with --folder", .0.display())]
    OtherFolder(PathBuf),
}

impl Calibrate {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let wired = WiredArm::read(&self.arm, self.profile.as_deref())?;
        let frames = frames::read(&self.frames, &wired.arm)?;
        let options = self.options()?;
        self.check_source()?;
        let folder = Folder::open(&self.folder, &Settings::new(&wired.arm, &frames, &options))?;
        let task = Task { arm: &wired.arm, frames: &frames, options: &options };
        let mut board = Board {
            wired: &wired,
            source: self.source(),
            dwell_s: self.dwell,
            folder: &folder,
            port: &self.port,
            ui,
            interrupt: None,
            doing: String::new(),
        };
        let (state, looks, last) = until_the_end(&task, &mut board)?;
        let mut result = Calibrated::new(&state, looks, &last, &self.folder);
        folder.keep_run(&state.run)?;
        let diagnosis = &last.outcome.diagnosis;
        folder.keep_report(diagnosis, &diagnosis.next_step(), &self.arm)?;
        if let Some(corrected) = last.outcome.correction.corrected(&wired.arm, &state.run, Keep::Effects) {
            result.model = Some(folder.keep_arm("model.toml", &corrected)?);
            let (better, table) = words(&corrected, &frames, &board)?;
            result.frames = reports([&wired.arm, &corrected], &frames, &better)?;
            // The same words measured again would differ by noise, and be called better.
            if self.upload && !result.has_nearest_words() {
                let words: Vec<&DesiredFrame> = frames.iter().chain(better.iter().map(|(frame, _)| frame)).collect();
                result.add_measured(&measured(&words, &mut board)?);
                result.uploaded = Some(board.upload(&table)?);
            }
            result.adjusted = Some(adjusted(&corrected, &frames, &folder, self.seed)?);
            // Again, with the files that are written now.
            folder.keep_report(diagnosis, &result.next_step(), &self.arm)?;
        }
        ui.print(&result)
    }

    fn options(&self) -> Result<CalibrateOptions, Usage> {
        let is_length = |mm: &f64| mm.is_finite() && *mm > 0.0;
        if let Some(mm) = self.goal.filter(|mm| !is_length(mm)) {
            return Err(Usage(format!("--goal {mm}: give a length above 0 mm")));
        }
        let goal_m = self.goal.map(|mm| 1e-3 * mm);
        Ok(CalibrateOptions { looks: self.looks.into(), goal_m, seed: self.seed, ..CalibrateOptions::default() })
    }

    /// Refuses a source that is of no kind before a folder is made; a calibration that was begun may be complete and need none.
    fn check_source(&self) -> Result<(), Usage> {
        let poses = &self.poses;
        let is_address = poses == "sim" || ["tcp:", "unix:"].iter().any(|kind| poses.starts_with(kind));
        if is_address || Path::new(poses).exists() || Folder::is_begun(&self.folder) {
            return Ok(());
        }
        Err(Usage(format!(
            "--poses {poses}: no such file; give sim, tcp:HOST:PORT, unix:PATH, or a CSV file or MCAP log that a program writes"
        )))
    }

    /// The camera that was named. A calibration that is complete needs none: that of the simulator is looked for when the
    /// arm is to move.
    fn source(&self) -> Option<String> {
        (self.poses != "sim").then(|| self.poses.clone())
    }
}

/// Looks until the loop ends: what was measured, every look in short, and the last one.
fn until_the_end(task: &Task, board: &mut Board) -> anyhow::Result<(State, Vec<LookReport>, Look)> {
    let (folder, ui) = (board.folder, board.ui);
    let (mut looks, mut visits, mut state) = (Vec::new(), task.first()?, State::default());
    loop {
        // Rows come from the file always, so that an interrupted loop continues as it would have.
        let samples = match folder.look(state.looks)? {
            Some(samples) => samples,
            None => {
                board.begin(state.looks, task.options.looks);
                folder.keep_look(state.looks, board.measure(&visits)?)?
            }
        };
        state = state.with(samples);
        let spinner = ui.spinner("diagnosing");
        let found = look(task, &state, &Progress::default())?;
        spinner.finish_and_clear();
        let report = LookReport::of(&found, state.run.samples.len());
        ui.note(&report.line(looks.len() + 1, task.options.looks));
        looks.push(report);
        match &found.next {
            Next::Measure(next) => visits.clone_from(next),
            Next::Stop(_) => return Ok((state, looks, found)),
        }
    }
}

/// A frame with its nearest word, and how far that is from it by the model, m.
type Better = (DesiredFrame, f64);

/// The frames with their nearest words by the corrected model, and the file of their table.
fn words(corrected: &Arm, frames: &[DesiredFrame], board: &Board) -> anyhow::Result<(Vec<Better>, PathBuf)> {
    let better = better_words(corrected, frames)?;
    let dwell_s = default_dwell_s(corrected, board.profile());
    let words: Vec<DesiredFrame> = better.iter().map(|(frame, _)| frame.clone()).collect();
    let table = board.folder.keep_words(corrected, board.profile(), &words, dwell_s)?;
    Ok((better, table))
}

/// What the model as drawn and the corrected one predict at the frames.
fn reports(models: [&Arm; 2], frames: &[DesiredFrame], better: &[Better]) -> anyhow::Result<Vec<FrameReport>> {
    let pairs = frames.iter().zip(better);
    pairs.map(|(old, (new, after_m))| FrameReport::new(models, old, new, *after_m)).collect()
}

/// Measures frames, each from the word before it; how far each is from its target, m. What was measured before is read from
/// the folder.
fn measured(frames: &[&DesiredFrame], board: &mut Board) -> anyhow::Result<Vec<Option<f64>>> {
    let (mut steps, mut visits) = (Vec::<PlanStep>::new(), Vec::new());
    for frame in frames {
        if steps.last().is_none_or(|last| last.word != frame.previous) {
            steps.push(step(frame, frame.previous));
        }
        visits.push(steps.len());
        steps.push(step(frame, frame.word));
    }
    let samples = match board.folder.frames()? {
        Some(samples) => samples,
        None => {
            board.doing = "frames with the words before and the nearest ones".into();
            let samples = board.measure(&steps)?;
            board.folder.keep_frames(samples)?
        }
    };
    let arm = &board.wired.arm;
    let distance = |(frame, visit): (&&DesiredFrame, usize)| {
        let sample = samples.iter().find(|sample| sample.visit as usize == visit)?;
        Some(frame.distance_m(arm, &sample.pose))
    };
    Ok(frames.iter().zip(visits).map(distance).collect())
}

/// A visit of a word with the servos of a frame.
fn step(frame: &DesiredFrame, word: Word) -> PlanStep {
    let (previous, servos_rad) = (frame.previous, frame.servos_rad.clone());
    PlanStep { word, previous, servos_rad, load_kg: None, held_out: false, repeat: false }
}

/// The stops that bring the tool of the corrected model to the frames, of few actuators where those suffice.
fn adjusted(corrected: &Arm, frames: &[DesiredFrame], folder: &Folder, seed: u64) -> anyhow::Result<Adjusted> {
    let found = synthesize_by_few(corrected, frames, &synthesis::Options { seed, ..Default::default() })?;
    let file = folder.keep_arm("adjusted.toml", &found.arm)?;
    let reached = found.status == Status::Reached;
    Ok(Adjusted { file, reached, report: adjust::report(corrected, &found.arm, adjust::RESOLUTION_MM)? })
}
