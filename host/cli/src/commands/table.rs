//! `darm table`: timed rows for a board, checked against the limits that the board itself checks.

mod show;

use std::path::{Path, PathBuf};

use darm_arm::arm::{Arm, frames};
use darm_arm::board_profile::BoardProfile;
use darm_arm::plan::{Plan, Visit};
use darm_arm::reach::board;
use darm_arm::wired_arm::WiredArm;
use darm_core::units::{DeviceId, Word};
use darm_diagnose::measurement_plan::{self, TooFewToPlan, measurement_visits};
use darm_measure::visit_table::{MEASUREMENT_DWELL_S, PlannedVisit, VisitTable, default_dwell_s};
use darm_measure::visits::Visits;
use serde::Serialize;

use super::servos::ServoArgs;
use crate::failure::Usage;
use crate::output_file;
use crate::overwrite::OutputFile;
use crate::port::PortArgs;
use crate::ui::{Answer, Ui, columns};
use darm_arm::table_file::{self, visits_file};

const EXAMPLES: &str = "\
Examples:
  darm table arm.toml planar4-frames.toml --dwell 0.3 -o visits.darm   # one frame after the other
  darm table arm.toml --words 000,000,000,000 111,000,000,000 -o two.darm
  darm table arm.toml --measurement-plan -o plan96.darm   # 96 words, three visits each
  darm table arm.toml --measurement-plan --bind -o bound.darm   # for the connected board only
  darm table arm.toml planar4-frames.toml --nearest -o nearest.darm   # `darm nearest --on-board`
  darm table --show visits.darm   # contents of a table

The file TABLE.visits.csv, written with TABLE.darm, lists when the arm rests at each visit and which visits are held \
out; `darm record` reads it. Both files carry the digest of the table.";

/// Rows that are shown without --all.
const SHOWN: usize = 12;

/// Make a table of timed rows from frames, words or a measurement plan, checked against the limits
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
#[command(group = clap::ArgGroup::new("what").required(true).args(["frames", "words", "measurement_plan", "show"]))]
pub(crate) struct Table {
    /// The arm
    #[arg(value_name = "ARM.toml", required_unless_present = "show")]
    arm: Option<PathBuf>,
    /// Frames to visit
    #[arg(value_name = "FRAMES.toml")]
    frames: Option<PathBuf>,
    /// Words to visit: one digit per actuator, base first; commas are ignored
    #[arg(long, value_name = "DIGITS", num_args = 1..)]
    words: Vec<String>,
    #[command(flatten)]
    servos: ServoArgs,
    /// Visit the words that are most informative about missing effects
    #[arg(long)]
    measurement_plan: bool,
    /// Number of different words in the measurement plan; a diagnosis needs 27 or more
    #[arg(long, value_name = "N", default_value_t = 96, requires = "measurement_plan")]
    plan_words: usize,
    /// Seed of the measurement plan and of its held-out words
    #[arg(long, value_name = "N", default_value_t = 1, requires = "measurement_plan")]
    seed: u64,
    /// Rest at each visit, in seconds; default: 1, or half of the shortest on-time that the profile allows where that is
    /// less; 0.2 in a measurement plan
    #[arg(long, value_name = "S")]
    dwell: Option<f64>,
    /// Profile of the board; default: the one that the arm names, else the one built into boards
    #[arg(long, value_name = "PROFILE.toml")]
    profile: Option<PathBuf>,
    /// Bind the table to the connected board: other boards refuse it
    #[arg(long)]
    bind: bool,
    /// Include the frames of the modules, so that the board can find the word nearest to a pose
    #[arg(long)]
    nearest: bool,
    /// Table file to write
    #[arg(short, long, value_name = "TABLE.darm", required_unless_present = "show")]
    output: Option<OutputFile>,
    /// Show the contents of a table file instead of making one
    #[arg(long, value_name = "TABLE.darm", conflicts_with_all = ["arm", "output", "bind", "nearest", "profile", "dwell"])]
    show: Option<PathBuf>,
    /// Show every row
    #[arg(long)]
    all: bool,
    #[command(flatten)]
    port: PortArgs,
}

#[derive(Serialize)]
struct Made {
    file: PathBuf,
    visits_file: PathBuf,
    digest: String,
    model: String,
    device: Option<String>,
    bytes: usize,
    end_s: f64,
    visits: usize,
    held_out: usize,
    /// Rests that keep the limits of outputs, and the time they take.
    rests: usize,
    rests_s: f64,
    rows: Vec<RowReport>,
    #[serde(skip)]
    shown: usize,
}

#[derive(Serialize)]
struct RowReport {
    at_s: f64,
    word: String,
    servos_rad: Vec<f32>,
    visit: Option<String>,
}

impl Table {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        if self.servos.are_given() && self.words.is_empty() {
            return Err(Usage("--q needs --words: frames and measurement plans have their own positions".into()).into());
        }
        match (&self.show, &self.arm, &self.output) {
            (Some(path), ..) => ui.print(&show::shown(path, self.all)?),
            (None, Some(arm), Some(output)) => self.make(arm, output, ui),
            (None, ..) => unreachable!("clap requires an arm and an output"),
        }
    }

    fn make(&self, arm: &Path, output: &Path, ui: Ui) -> anyhow::Result<()> {
        output_file::refuse_other_than_table(output)?;
        output_file::refuse_other_than_visits(&visits_file(output))?;
        let WiredArm { arm, profile, .. } = WiredArm::read(arm, self.profile.as_deref())?;
        let planned = self.planned_visits(&arm, &profile, ui)?;
        let device = if self.bind { Some(self.port.connect()?.identity().device) } else { None };
        let modules = if self.nearest { board::records(&arm)? } else { Vec::new() };
        // A program of frames or words goes from one to the next; a measurement plan may rest between.
        let may_rest = self.measurement_plan;
        let table = VisitTable { arm: &arm, profile: &profile, device, modules: &modules, may_rest };
        let (plan, file) = table.of(&planned)?;
        let (image, text) = (table_file::bytes(&plan.image), file.to_text());
        output_file::write_all(&[(output, &image), (&visits_file(output), text.as_bytes())])?;
        ui.print(&self.report(output, &file, &plan, device))
    }

    /// The visits of the program.
    fn planned_visits(&self, arm: &Arm, profile: &BoardProfile, ui: Ui) -> anyhow::Result<Vec<PlannedVisit>> {
        let dwell_s = self.dwell.unwrap_or_else(|| default_dwell_s(arm, profile));
        if let Some(path) = &self.frames {
            return Ok(frame_visits(arm, path, dwell_s)?);
        }
        if self.measurement_plan {
            return Ok(self.measurement_plan(arm, ui)?);
        }
        let visits = self.words.iter().map(|word| self.word_visit(arm, word, dwell_s));
        Ok(visits.collect::<Result<_, Usage>>()?)
    }

    fn measurement_plan(&self, arm: &Arm, ui: Ui) -> Result<Vec<PlannedVisit>, TooFewToPlan> {
        let spinner = ui.spinner("choosing informative words");
        let options = measurement_plan::PlanOptions {
            words: self.plan_words,
            seed: self.seed,
            ..measurement_plan::PlanOptions::default()
        };
        let visits = measurement_visits(arm, &options, self.dwell.unwrap_or(MEASUREMENT_DWELL_S));
        spinner.finish_and_clear();
        visits
    }

    fn word_visit(&self, arm: &Arm, text: &str, dwell_s: f64) -> Result<PlannedVisit, Usage> {
        let word: Word = text.parse().map_err(|error| Usage(format!("--words {text}: {error}")))?;
        frames::check_word(&word, arm).map_err(|fault| Usage(format!("--words {text}: {fault}")))?;
        let servos_rad = self.servos.given_rad(arm)?.unwrap_or_default();
        if servos_rad.len() != arm.n_servos() {
            return Err(Usage(format!(
                "--q is missing; give one position for each of {} servo joints",
                arm.n_servos()
            )));
        }
        Ok(PlannedVisit { visit: Visit { word, servos_rad, dwell_s, label: word.to_string() }, held_out: false })
    }

    fn report(&self, output: &Path, file: &Visits, plan: &Plan, device: Option<DeviceId>) -> Made {
        let rows = plan.rows.iter().enumerate().map(|(index, row)| RowReport {
            at_s: row.at.0 as f64 * 1e-6,
            word: row.word.to_string(),
            servos_rad: row.servos.to_vec(),
            visit: file.rests.iter().find(|rest| usize::from(rest.row) == index).map(|rest| rest.label.clone()),
        });
        Made {
            file: output.to_owned(),
            visits_file: visits_file(output),
            digest: file.table.to_string(),
            model: file.model.to_string(),
            device: device.map(|device| device.to_string()),
            bytes: plan.image.bytes().len(),
            end_s: plan.end.0 as f64 * 1e-6,
            visits: file.rests.len(),
            held_out: file.rests.iter().filter(|rest| rest.held_out).count(),
            rests: plan.rested.iter().filter(|rested| **rested).count(),
            rests_s: plan.rests.0 as f64 * 1e-6,
            rows: rows.collect(),
            shown: if self.all { usize::MAX } else { SHOWN },
        }
    }
}

fn frame_visits(arm: &Arm, path: &Path, dwell_s: f64) -> Result<Vec<PlannedVisit>, frames::FramesError> {
    let visit = |frame: frames::DesiredFrame| {
        let (word, servos_rad) = (frame.word, frame.servos_rad);
        PlannedVisit { visit: Visit { word, servos_rad, dwell_s, label: frame.name }, held_out: false }
    };
    Ok(frames::read(path, arm)?.into_iter().map(visit).collect())
}

impl Answer for Made {
    fn text(&self) -> String {
        let head = if self.rows.iter().all(|row| row.servos_rad.is_empty()) { "" } else { "servos" };
        let mut rows = vec![["row", "time", "word", head, "visit"].map(str::to_owned).to_vec()];
        rows.extend(self.rows.iter().take(self.shown).enumerate().map(|(index, row)| {
            let servos: Vec<_> = row.servos_rad.iter().map(|angle| format!("{:.2} deg", angle.to_degrees())).collect();
            let visit = row.visit.clone().unwrap_or_default();
            vec![index.to_string(), format!("{:.3} s", row.at_s), row.word.clone(), servos.join(" "), visit]
        }));
        let mut text = columns(&rows);
        if self.rows.len() > self.shown {
            text += &format!("\n… {} more rows; --all shows them", self.rows.len() - self.shown);
        }
        let held_out = if self.held_out == 0 { String::new() } else { format!(", {} held out", self.held_out) };
        let boards = self.device.as_ref().map_or("any board".to_owned(), |device| format!("board {device} only"));
        let rests = match self.rests {
            0 => String::new(),
            n => format!("\n{n} rests of {:.1} s in all keep the on-times and duties of the profile", self.rests_s),
        };
        text + &format!(
            "\n\nwithin the limits: table {} with {} rows in {:.1} s for model {} and {boards}, {} bytes in {}\n{} visits{held_out}, in {}{rests}",
            self.digest.get(..16).unwrap_or(&self.digest),
            self.rows.len(),
            self.end_s,
            self.model,
            self.bytes,
            self.file.display(),
            self.visits,
            self.visits_file.display()
        )
    }
}
