//! `darm record`: plays the board's table and measures: events of the board and pictures of a camera, joined by time.

mod follow;
mod join;
mod source;

use std::path::PathBuf;

use anyhow::Context as _;
use darm::arm::Arm;
use darm::client::Client;
use darm::clock::HostTime;
use darm::measurement::{Finding, Run, check, write};
use darm_core::sequencer::Command;
use darm_core::units::ModelHash;
use serde::Serialize;

use super::play::{End, Watch};
use super::visits::{Visits, beside};
use crate::failure::Safe;
use crate::port::{PortArgs, emulated_camera};
use crate::voice::{Answer, Voice};
use follow::Follow;
use join::Span;
use source::Camera;

const EXAMPLES: &str = "\
Examples:
  darm record measure.darm -o run.csv                                the board of `darm plant` and its camera
  darm record measure.darm --camera tcp:camera.local:7000 -o run.csv.gz
  darm record measure.darm --camera pictures.csv --run 2 -o run2.csv
  darm record measure.darm -o run.mcap                               the same as a log, which `darm diagnose` reads too

The camera sends lines of comma-separated text, the first of them the header:
  time_s,x_m,y_m,angle_deg[,supply_bar][,temperature_c]       in space x_m,y_m,z_m,rx_deg,ry_deg,rz_deg
time_s is Unix time, the pose that of the tool in the base. A file is read when the program has \
ended; another program may write it meanwhile.

Every visit gives one row: the mean of the pictures that were taken while the arm rested there. \
The offset of the board's clock and its uncertainty stand in the comment lines of the file.";

/// Time between two questions to the board.
const POLL: std::time::Duration = std::time::Duration::from_millis(50);
/// A quartz clock departs by less in any program.
const DEPARTURE_S: f64 = 0.02;
/// Questions that tell the board's time before the program starts.
const ROUND_TRIPS: u32 = 20;

/// Play the board's table and measure: one row for each visit
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Record {
    /// Table that the board holds; its .visits.csv is read
    #[arg(value_name = "TABLE.darm")]
    table: PathBuf,
    /// Where pictures come from: unix:PATH, tcp:HOST:PORT or a file; the camera of `darm plant` where it is left out
    #[arg(long, value_name = "CAMERA")]
    camera: Option<String>,
    /// The measurements; compressed when the name ends in .gz, a log of MCAP when it ends in .mcap
    #[arg(short, long, value_name = "RUN.csv")]
    output: PathBuf,
    /// Look over the measurements as those of this arm
    #[arg(long, value_name = "ARM.toml")]
    arm: Option<PathBuf>,
    /// Number of the run in the file
    #[arg(long, value_name = "N", default_value_t = 0)]
    run: u32,
    #[command(flatten)]
    port: PortArgs,
}

/// Why nothing was recorded.
#[derive(Debug, thiserror::Error)]
enum RecordError {
    #[error("no camera; name one with --camera unix:PATH, tcp:HOST:PORT or a file")]
    NoCamera,
    #[error("the board holds no table; `darm upload {}` brings it", .0.display())]
    NoTable(PathBuf),
    #[error("the board's table was made for model {board}, these visits for {visits}; `darm upload {}` brings the right one", .table.display())]
    OtherTable { board: ModelHash, visits: ModelHash, table: PathBuf },
    #[error("the program was stopped before its first visit; is somebody else using the board?")]
    NothingPlayed,
    #[error("no picture was taken while the arm rested; {pictures} pictures came, is the camera's time_s Unix time?")]
    NoPictures { pictures: usize },
}

#[derive(Serialize)]
struct Recorded {
    output: PathBuf,
    rows: usize,
    visits: usize,
    pictures: usize,
    clock_offset_s: f64,
    clock_uncertainty_s: f64,
    findings: Vec<String>,
    end: &'static str,
}

impl Answer for Recorded {
    fn text(&self) -> String {
        let mut lines: Vec<String> = self.findings.iter().map(|finding| format!("note: {finding}")).collect();
        lines.push(format!(
            "{} of {} visits measured from {} pictures, in {}; board time known to {:.1} ms",
            self.rows,
            self.visits,
            self.pictures,
            self.output.display(),
            1e3 * self.clock_uncertainty_s
        ));
        lines.join("\n")
    }
}

impl Record {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let visits = Visits::read(&beside(&self.table))?;
        let arm = self.arm.as_deref().map(Arm::read).transpose()?;
        let camera = self.camera.clone().or_else(emulated_camera).ok_or(RecordError::NoCamera)?;
        let mut client = self.port.connect()?;
        self.check_table(&mut client, &visits)?;
        let camera = Camera::open(&camera)?;

        let played = play(&mut client, &visits, voice)?;
        let pictures = camera.stop()?;
        let clock = client.clock().offset().ok_or(RecordError::NothingPlayed)?;
        let mut samples = join::join(&visits, &played.spans, &pictures);
        for sample in &mut samples {
            sample.run = self.run;
            sample.time_s += played.start_s;
        }
        if samples.is_empty() {
            return Err(RecordError::NoPictures { pictures: pictures.len() }.into());
        }
        let run = Run { samples, ..Run::default() };
        let about = about(&visits, clock, client.identity().device.to_string().as_str());
        write(&self.output, &about, &run).with_context(|| format!("cannot write {}", self.output.display()))?;
        let mut findings = arm.map(|arm| check(&arm, &run)).unwrap_or_default();
        findings.extend(uneven(played.departure_s));
        voice.tell(&Recorded {
            output: self.output.clone(),
            rows: run.samples.len(),
            visits: visits.rests.len(),
            pictures: pictures.len(),
            clock_offset_s: clock.at_s,
            clock_uncertainty_s: clock.uncertainty_s,
            findings: findings.iter().map(ToString::to_string).collect(),
            end: played.end.name(),
        })?;
        match played.end {
            End::Fault(fault) => Err(Safe(fault.to_string()).into()),
            End::Finished | End::Stopped => Ok(()),
        }
    }

    fn check_table(&self, client: &mut Client, visits: &Visits) -> anyhow::Result<()> {
        match client.status()?.model {
            None => Err(RecordError::NoTable(self.table.clone()).into()),
            Some(board) if board != visits.model => {
                Err(RecordError::OtherTable { board, visits: visits.model, table: self.table.clone() }.into())
            }
            Some(_) => Ok(()),
        }
    }
}

/// What the owner should know of a board's clock that did not keep time.
fn uneven(departure_s: f64) -> Option<Finding> {
    let what = format!(
        "the board's clock departed by {departure_s:.3} s while the program ran, as an emulator's does on a busy \
         computer; visits that it makes doubtful are left out"
    );
    (departure_s > DEPARTURE_S).then_some(Finding { line: None, what })
}

/// What the board did.
struct Played {
    /// When row 0 went out, on the board's clock.
    start_s: f64,
    /// When the arm rested at each visit that was completed, on the camera's clock.
    spans: Vec<Span>,
    /// How far the board's clock and the host's departed from each other.
    departure_s: f64,
    end: End,
}

/// Plays to the end, whatever end that is.
fn play(client: &mut Client, visits: &Visits, voice: Voice) -> anyhow::Result<Played> {
    client.set_clock(ROUND_TRIPS)?;
    let mut watch = Watch::new(client.say_hello()?.next_event);
    client.command(Command::Play)?;
    let bar = voice.bar("recording", visits.rests.len() as u64, "visits");
    let mut follow = Follow::new(visits);
    let end = loop {
        std::thread::sleep(POLL);
        let happenings = watch.look(client)?;
        follow.look(&happenings, watch.end, client.clock(), client.now_s());
        bar.set_position(follow.spans.len() as u64);
        if let Some(end) = watch.end {
            break end;
        }
    };
    bar.finish_and_clear();
    let start_s = follow.start_s.ok_or(RecordError::NothingPlayed)?;
    Ok(Played { start_s, departure_s: follow.departure_s(), spans: follow.spans, end })
}

/// Comment lines before the table.
fn about(visits: &Visits, clock: HostTime, device: &str) -> String {
    format!(
        "# model {}\n# board {device}\n# clock_offset_s {:.6}\n# clock_uncertainty_s {:.6}\n",
        visits.model, clock.at_s, clock.uncertainty_s
    )
}
