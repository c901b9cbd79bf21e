//! `darm table`: timed rows for a board, checked against the limits that the board itself checks.

mod show;

use std::path::{Path, PathBuf};

use darm_arm::arm::{Arm, frames};
use darm_arm::board_profile::{BoardProfile, longest_on_s};
use darm_arm::plan::{Plan, Visit, plan};
use darm_arm::reach::board;
use darm_arm::wired_arm::WiredArm;
use darm_core::output::Drive;
use darm_core::units::{DeviceId, Word};
use darm_diagnose::measurement_plan;
use serde::Serialize;

use super::table_file;
use super::visits::{Rest, Visits, beside};
use crate::failure::Usage;
use crate::output_file;
use crate::port::PortArgs;
use crate::voice::{Answer, Voice, columns};

const EXAMPLES: &str = "\
Examples:
  darm table arm.toml frames.toml -o visits.darm              to the frames, one after the other
  darm table arm.toml --words 000,000,000,000 111,000,000,000 -o two.darm
  darm table arm.toml --programme -o measure.darm             96 words three times, to be measured
  darm table arm.toml --programme --bind -o measure.darm      for the connected board only
  darm table arm.toml frames.toml --nearest -o visits.darm    the board answers `nearest` by itself, too
  darm table --show visits.darm                               what a table holds

Beside TABLE.darm a file TABLE.visits.csv says from when to when the arm rests at each visit, and \
which visits are held out of every fit; `darm record` reads it. Both carry the table's digest.";

/// Rows that are shown without --all.
const SHOWN: usize = 12;
/// How long the arm rests at a frame or word, where it is not said and the limits allow it.
const DWELL_S: f64 = 1.0;
/// Where they do not: share of the longest time on, the rest of which is for travel and the next visit.
const DWELL_SHARE: f64 = 0.5;
/// Angles are compared as numbers of single precision.
const ROUNDING_RAD: f32 = 1e-5;
/// The same at a word of the measurement programme: long enough for eight pictures.
const PROGRAMME_DWELL_S: f64 = 0.2;

/// Make timed rows from frames, words or a measurement programme, checked against the limits
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
#[command(group = clap::ArgGroup::new("what").required(true).args(["frames", "words", "programme", "show"]))]
pub(crate) struct Table {
    /// The arm
    #[arg(value_name = "ARM.toml", required_unless_present = "show")]
    arm: Option<PathBuf>,
    /// Frames to visit
    #[arg(value_name = "FRAMES.toml")]
    frames: Option<PathBuf>,
    /// Words to visit: a digit for each actuator, commas are for the eye
    #[arg(long, value_name = "DIGITS", num_args = 1..)]
    words: Vec<String>,
    /// Servo angles at every one of the words, in degrees
    #[arg(long, value_name = "DEG", num_args = 1.., allow_negative_numbers = true, requires = "words")]
    servos: Vec<f64>,
    /// The words that tell most about what the model may lack, in a good order
    #[arg(long)]
    programme: bool,
    /// Different words of the programme
    #[arg(long, value_name = "N", default_value_t = 96, requires = "programme")]
    size: usize,
    /// Seed of the programme and of the words held out
    #[arg(long, value_name = "N", default_value_t = 1, requires = "programme")]
    seed: u64,
    /// How long the arm rests at each visit, in seconds; 1, or half of the shortest time on that the profile allows
    /// where that is less; in a programme 0.2
    #[arg(long, value_name = "S")]
    dwell: Option<f64>,
    /// Profile of the board; where it is left out, the one that the arm names, else the one built into boards
    #[arg(long, value_name = "PROFILE.toml")]
    profile: Option<PathBuf>,
    /// Bind the table to the connected board: others refuse it
    #[arg(long)]
    bind: bool,
    /// Bring the frames of the modules along, so that the board answers by itself which word is nearest to a pose
    #[arg(long)]
    nearest: bool,
    /// The table
    #[arg(short, long, value_name = "TABLE.darm", required_unless_present = "show")]
    output: Option<PathBuf>,
    /// Show what a table file holds, in place of making one
    #[arg(long, value_name = "TABLE.darm", conflicts_with_all = ["arm", "output", "bind", "nearest", "profile", "dwell"])]
    show: Option<PathBuf>,
    /// Show every row
    #[arg(long)]
    all: bool,
    #[command(flatten)]
    port: PortArgs,
}

/// A visit and whether no fit may see it.
struct Stop {
    visit: Visit,
    held_out: bool,
}

/// A row would take a servo out of the range of the board's profile.
#[derive(Debug, thiserror::Error)]
#[error(
    "row {row}, word {word}: servo {servo} ({name}) would go to {angle_deg:.1} deg, without a zero offset the profile's \
     range is {min_deg:.1} to {max_deg:.1} deg; choose an angle within it, or correct the range in the profile"
)]
struct ServoError {
    row: usize,
    word: Word,
    servo: u8,
    name: String,
    angle_deg: f32,
    min_deg: f32,
    max_deg: f32,
}

#[derive(Serialize)]
struct Made {
    table: PathBuf,
    visits_file: PathBuf,
    digest: String,
    model: String,
    device: Option<String>,
    bytes: usize,
    end_s: f64,
    visits: usize,
    held_out: usize,
    rows: Vec<RowReport>,
    #[serde(skip)]
    shown: usize,
}

#[derive(Serialize)]
struct RowReport {
    at_s: f64,
    word: String,
    servos_deg: Vec<f32>,
    visit: Option<String>,
}

impl Table {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        match (&self.show, &self.arm, &self.output) {
            (Some(path), ..) => voice.tell(&show::shown(path, self.all)?),
            (None, Some(arm), Some(output)) => self.make(arm, output, voice),
            (None, ..) => unreachable!("the command line asks for an arm and an output"),
        }
    }

    fn make(&self, arm: &Path, output: &Path, voice: Voice) -> anyhow::Result<()> {
        output_file::refuse_other_than_table(output)?;
        output_file::refuse_other_than_visits(&beside(output))?;
        let WiredArm { arm, profile, .. } = WiredArm::read(arm, self.profile.as_deref())?;
        let stops = self.stops(&arm, &profile, voice)?;
        let device = if self.bind { Some(self.port.connect()?.identity().device) } else { None };
        let visits: Vec<Visit> = stops.iter().map(|stop| stop.visit.clone()).collect();
        let modules = if self.nearest { board::records(&arm)? } else { Vec::new() };
        let plan = plan(&arm, &visits, &profile.board(device), &modules)?;
        let file = visits_of(&arm, &stops, &plan);
        check_servos(&arm, &profile, &plan)?;
        let (image, text) = (table_file::bytes(&plan.image), file.to_text());
        output_file::write_all(&[(output, &image), (&beside(output), text.as_bytes())])?;
        voice.tell(&self.report(output, &file, &plan, device))
    }

    /// Where the program goes.
    fn stops(&self, arm: &Arm, profile: &BoardProfile, voice: Voice) -> anyhow::Result<Vec<Stop>> {
        let dwell_s = self.dwell.unwrap_or_else(|| default_dwell_s(arm, profile));
        if let Some(path) = &self.frames {
            return Ok(frames_stops(arm, path, dwell_s)?);
        }
        if self.programme {
            return Ok(self.programme_stops(arm, voice));
        }
        let stops = self.words.iter().map(|word| self.word_stop(arm, word, dwell_s));
        Ok(stops.collect::<Result<_, Usage>>()?)
    }

    fn programme_stops(&self, arm: &Arm, voice: Voice) -> Vec<Stop> {
        let wheel = voice.wheel("choosing words");
        let options =
            measurement_plan::Options { words: self.size, seed: self.seed, ..measurement_plan::Options::default() };
        let steps = measurement_plan::plan(arm, &options);
        wheel.finish_and_clear();
        let stop = |(number, step): (usize, measurement_plan::Step)| Stop {
            held_out: step.held_out,
            visit: Visit {
                word: step.word,
                servos_rad: step.servos_rad,
                dwell_s: self.dwell.unwrap_or(PROGRAMME_DWELL_S),
                label: format!("visit {number}"),
            },
        };
        steps.into_iter().enumerate().map(stop).collect()
    }

    fn word_stop(&self, arm: &Arm, text: &str, dwell_s: f64) -> Result<Stop, Usage> {
        let word: Word = text.parse().map_err(|error| Usage(format!("--words {text}: {error}")))?;
        frames::check_word(&word, arm).map_err(|fault| Usage(format!("--words {text}: {fault}")))?;
        let (given, wanted) = (self.servos.len(), arm.n_servos());
        if given != wanted {
            return Err(Usage(format!("the arm has {wanted} servo joints, --servos gives {given} angles")));
        }
        let servos_rad = self.servos.iter().map(|angle| angle.to_radians()).collect();
        Ok(Stop { visit: Visit { word, servos_rad, dwell_s, label: word.to_string() }, held_out: false })
    }

    fn report(&self, output: &Path, file: &Visits, plan: &Plan, device: Option<DeviceId>) -> Made {
        let rows = plan.rows.iter().enumerate().map(|(index, row)| RowReport {
            at_s: row.at.0 as f64 * 1e-6,
            word: row.word.to_string(),
            servos_deg: row.servos.iter().map(|angle| angle.to_degrees()).collect(),
            visit: file.rests.iter().find(|rest| usize::from(rest.row) == index).map(|rest| rest.label.clone()),
        });
        Made {
            table: output.to_owned(),
            visits_file: beside(output),
            digest: file.table.to_string(),
            model: file.model.to_string(),
            device: device.map(|device| device.to_string()),
            bytes: plan.image.bytes().len(),
            end_s: plan.end.0 as f64 * 1e-6,
            visits: file.rests.len(),
            held_out: file.rests.iter().filter(|rest| rest.held_out).count(),
            rows: rows.collect(),
            shown: if self.all { usize::MAX } else { SHOWN },
        }
    }
}

fn frames_stops(arm: &Arm, path: &Path, dwell_s: f64) -> Result<Vec<Stop>, frames::FramesError> {
    let stop = |frame: frames::DesiredFrame| {
        let (word, servos_rad) = (frame.word, frame.servos_rad);
        Stop { visit: Visit { word, servos_rad, dwell_s, label: frame.name }, held_out: false }
    };
    Ok(frames::read(path, arm)?.into_iter().map(stop).collect())
}

/// The default dwell, shorter where an output of the arm may not be on for so long.
fn default_dwell_s(arm: &Arm, profile: &BoardProfile) -> f64 {
    let outputs = arm.connections.iter().flat_map(|connection| &connection.outputs);
    let limits = outputs.filter_map(|&number| profile.profile.output(number));
    let holds = limits.filter(|output| !matches!(output.drive, Drive::Latch { .. }));
    let longest_s = holds.map(|output| longest_on_s(&output.limit));
    longest_s.map(|longest_s| DWELL_SHARE * longest_s).fold(DWELL_S, f64::min)
}

fn visits_of(arm: &Arm, stops: &[Stop], plan: &Plan) -> Visits {
    let mut previous = arm.rest();
    let rests = stops.iter().zip(&plan.windows).map(|(stop, &(from, to))| {
        let row = plan.rows.iter().rposition(|row| row.at < from).unwrap_or_default();
        let rest = Rest {
            label: stop.visit.label.clone(),
            from_s: from.0 as f64 * 1e-6,
            to_s: to.0 as f64 * 1e-6,
            row: row as u16,
            word: stop.visit.word,
            previous,
            servos_rad: stop.visit.servos_rad.clone(),
            held_out: stop.held_out,
        };
        previous = rest.word;
        rest
    });
    let table = plan.image.image().digest;
    Visits { model: arm.hash(), geometry: arm.geometry_hash(), table, rests: rests.collect() }
}

/// Refuses rows that take a servo out of the profile's range, which the board checks when it plays them. The range is
/// that of the shaft; without a zero offset in the servo it is that of the joint, too.
fn check_servos(arm: &Arm, profile: &BoardProfile, plan: &Plan) -> Result<(), ServoError> {
    for (index, row) in plan.rows.iter().enumerate() {
        for (number, (&angle_rad, servo)) in row.servos.iter().zip(&profile.profile.servos).enumerate() {
            let (min_rad, max_rad) = (servo.limit.min_rad, servo.limit.max_rad);
            if angle_rad < min_rad - ROUNDING_RAD || angle_rad > max_rad + ROUNDING_RAD {
                let [angle_deg, min_deg, max_deg] = [angle_rad, min_rad, max_rad].map(f32::to_degrees);
                let (word, servo, name) = (row.word, servo.limit.id, arm.servo_name(number));
                return Err(ServoError { row: index, word, servo, name, angle_deg, min_deg, max_deg });
            }
        }
    }
    Ok(())
}

impl Answer for Made {
    fn text(&self) -> String {
        let head = if self.rows.iter().all(|row| row.servos_deg.is_empty()) { "" } else { "servos" };
        let mut rows = vec![["row", "time", "word", head, "visit"].map(str::to_owned).to_vec()];
        rows.extend(self.rows.iter().take(self.shown).enumerate().map(|(index, row)| {
            let servos: Vec<_> = row.servos_deg.iter().map(|angle| format!("{angle:.2} deg")).collect();
            let visit = row.visit.clone().unwrap_or_default();
            vec![index.to_string(), format!("{:.3} s", row.at_s), row.word.clone(), servos.join(" "), visit]
        }));
        let mut text = columns(&rows);
        if self.rows.len() > self.shown {
            text += &format!("\n… {} more rows; --all shows them", self.rows.len() - self.shown);
        }
        let held_out = if self.held_out == 0 { String::new() } else { format!(", {} of them held out", self.held_out) };
        let whom = self.device.as_ref().map_or("any board".to_owned(), |device| format!("board {device} only"));
        text + &format!(
            "\n\nwithin the limits: table {} with {} rows in {:.1} s for model {} and {whom}, {} bytes in {}\n{} visits{held_out}, in {}",
            self.digest.get(..16).unwrap_or(&self.digest),
            self.rows.len(),
            self.end_s,
            self.model,
            self.bytes,
            self.table.display(),
            self.visits,
            self.visits_file.display()
        )
    }
}
