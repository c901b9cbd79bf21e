//! `darm record`: plays the board's table and measures: events of the board and pictures of a camera, joined by time.

mod follow;
mod join;
mod output;
mod program;
mod recording;
mod source;

use std::path::PathBuf;
use std::time::Duration;

use darm_arm::arm::Arm;
use darm_core::sequencer::Phase;
use darm_core::units::ShortDigest;
use darm_device::client::Client;
use darm_diagnose::measurement::{Finding, FindingKind, Run, check};
use serde::Serialize;

use super::play::{End, Watch};
use super::table_file::TableFile;
use super::visits::{Visits, beside};
use crate::failure::{Safe, Unfinished};
use crate::port::{PortArgs, emulated_camera};
use crate::voice::{Answer, Voice};
use crate::{interrupt, output_file, port};
use follow::Follow;
use output::{Earlier, Output};
use program::{Lost, Program};
use recording::{Recording, clock_lines};
use source::Camera;

const EXAMPLES: &str = "\
Examples:
  darm record measure.darm -o run.csv                                the board of `darm plant` and its camera
  darm record measure.darm --camera tcp:camera.local:7000 -o run.csv.gz
  darm record measure.darm --camera pictures.csv --run 2 -o run2.csv
  darm record measure.darm -o run.mcap                               the same as a log, which `darm diagnose` reads too

The camera sends lines of comma-separated text, the first of them the header:
  time_s,x_m,y_m,angle_deg[,supply_bar][,temperature_c]       in space x_m,y_m,z_m,rx_deg,ry_deg,rz_deg
time_s is Unix time, the pose that of the tool in the base. A file may grow while another program \
writes it.

Every visit gives one row: the mean of the pictures that were taken while the arm rested there. \
A row is written when its visit is over, so a recording that was killed is readable as it is; \
--resume follows the program that still runs and appends what is missing. A lost connection is \
opened again while the program runs on. Offset and rate of the board's clock with their \
uncertainties are in the comment lines, first as known at the start, then as known at the end.

Ctrl-C stops the arm: exit code 6 when the board has confirmed it, 5 when it has not, 4 when the \
stop could not be sent. Exit code 7: another program stopped the arm before the end of its program, \
or the program was over before --resume and visits are missing.

A measurement that exists is replaced only with --force; a file of another kind never is.";

/// A board that keeps its time loses less.
const LOST_S: f64 = 0.02;
/// A lost port is waited for so long after the program's end.
const PATIENCE: Duration = Duration::from_secs(60);
/// Questions that tell the board's time before the program starts.
const ROUND_TRIPS: u32 = 20;

/// Play the board's table and measure: one row for each visit
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Record {
    /// Table that the board holds; its .visits.csv is read, and the digests of all three are compared
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
    /// Go on with a recording that was killed or lost its connection, into the same file
    #[arg(long)]
    resume: bool,
    /// Replace a measurement of the same name
    #[arg(long, conflicts_with = "resume")]
    force: bool,
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
    #[error("the clock of the board is not known; nothing was recorded")]
    NoClock,
    #[error("{}: no recording that can be resumed: its comment lines do not say when the program started", .0.display())]
    NothingToResume(PathBuf),
    #[error("{}: the recording is of board {recorded}, this is {connected}", path.display())]
    OtherBoard { path: PathBuf, recorded: String, connected: String },
    #[error("{}: the recording is of table {recorded}, not of {given}; name the table that it was begun with", path.display())]
    OtherRecording { path: PathBuf, recorded: ShortDigest, given: ShortDigest },
    #[error("the board has been given another table since; what was measured before is in the file")]
    Replaced,
    #[error("the board has restarted since the program started; what was measured before is in the file")]
    Restarted,
    #[error("no picture was taken while the arm rested; {pictures} pictures came, is the camera's time_s Unix time?")]
    NoPictures { pictures: usize },
}

#[derive(Serialize)]
struct Recorded {
    output: PathBuf,
    rows: usize,
    visits: usize,
    pictures: usize,
    /// Visits that are over and have no row, numbered as in the visit file.
    not_recovered: Vec<usize>,
    clock_offset_s: f64,
    clock_uncertainty_s: f64,
    clock_rate_error_ppm: f64,
    clock_rate_uncertainty_ppm: f64,
    findings: Vec<String>,
    /// How often and how long the connection to the board was lost.
    lost_connections: Vec<Lost>,
    end: &'static str,
}

impl Answer for Recorded {
    fn text(&self) -> String {
        let mut lines: Vec<String> = self.findings.iter().map(|finding| format!("note: {finding}")).collect();
        if !self.not_recovered.is_empty() {
            let visits: Vec<String> = self.not_recovered.iter().map(usize::to_string).collect();
            lines.push(format!("note: no picture of the arm surely at rest at visits {}", visits.join(", ")));
        }
        lines.push(format!(
            "{} of {} visits measured from {} pictures, in {}; board clock: offset ±{:.1} ms, rate {:+.0} ±{:.0} ppm",
            self.rows,
            self.visits,
            self.pictures,
            self.output.display(),
            1e3 * self.clock_uncertainty_s,
            self.clock_rate_error_ppm,
            self.clock_rate_uncertainty_ppm
        ));
        lines.join("\n")
    }
}

impl Record {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let visits = Visits::read(&beside(&self.table))?;
        let table = TableFile::read(&self.table)?;
        table.check_visits(visits.table)?;
        let arm = self.arm.as_deref().map(Arm::read).transpose()?;
        let (output, earlier) = self.open_output()?;
        let camera = self.camera.clone().or_else(emulated_camera).ok_or(RecordError::NoCamera)?;
        let port = self.port.name()?;
        let (link, handle) = port::open(&port)?;
        let mut client = Client::connect(link)?;
        table.check_loaded(client.hello().and_then(|hello| hello.table))?;
        let camera = Camera::open(&camera)?;
        let interrupt = interrupt::Watch::start(&port, handle)?;
        let over = earlier.is_some() && !is_running(&mut client)?;
        let mut recording = match earlier {
            None => self.start(&visits, client, interrupt.clone(), camera, output, voice)?,
            Some(earlier) => self.go_on(&visits, client, interrupt.clone(), camera, output, earlier, voice)?,
        };
        let bar = voice.bar("recording", visits.rests.len() as u64, "visits");
        let end = recording.until_the_end(|visit| bar.set_position(visit as u64));
        bar.finish_and_clear();
        let told = self.tell(recording, end, over, arm.as_ref(), voice);
        interrupt.interrupted().map_or(told, |interrupted| Err(interrupted.into()))
    }

    fn open_output(&self) -> anyhow::Result<(Output, Option<Earlier>)> {
        if self.resume {
            let (output, earlier) = Output::resume(&self.output)?;
            return Ok((output, Some(earlier)));
        }
        output_file::refuse_other_than_measurement(&self.output, self.force)?;
        Ok((Output::create(&self.output)?, None))
    }

    /// Starts the program.
    fn start<'a>(
        &self,
        visits: &'a Visits,
        mut client: Client,
        interrupt: interrupt::Watch,
        camera: Camera,
        output: Output,
        voice: Voice,
    ) -> anyhow::Result<Recording<'a>> {
        client.set_clock(ROUND_TRIPS)?;
        let hello = client.say_hello()?;
        if hello.table != Some(visits.table) {
            return Err(RecordError::Replaced.into());
        }
        let watch = Watch::new(hello.next_event);
        interrupt.play(&mut client)?;
        let program = Program::new(client, watch, interrupt, patience(visits), voice);
        Ok(Recording::new(visits, Follow::new(visits), program, camera, output, self.run))
    }

    /// Goes on with the program that an earlier recording has started.
    #[allow(clippy::too_many_arguments, reason = "all that a recording consists of")]
    fn go_on<'a>(
        &self,
        visits: &'a Visits,
        mut client: Client,
        interrupt: interrupt::Watch,
        camera: Camera,
        mut output: Output,
        earlier: Earlier,
        voice: Voice,
    ) -> anyhow::Result<Recording<'a>> {
        let connected = client.identity().device.to_string();
        if earlier.device != connected {
            let (path, recorded) = (self.output.clone(), earlier.device);
            return Err(RecordError::OtherBoard { path, recorded, connected }.into());
        }
        if earlier.table != visits.table {
            let (path, recorded, given) = (self.output.clone(), earlier.table.short(), visits.table.short());
            return Err(RecordError::OtherRecording { path, recorded, given }.into());
        }
        if client.hello().is_some_and(|hello| hello.boots != earlier.boots) {
            return Err(RecordError::Restarted.into());
        }
        client.set_clock(ROUND_TRIPS)?;
        let follow = Follow::resume(visits, earlier.start_s, earlier.next(self.run));
        let watch = Watch::resume(earlier.start_s);
        output.begin_after(earlier)?;
        let program = Program::new(client, watch, interrupt, patience(visits), voice);
        Ok(Recording::new(visits, follow, program, camera, output, self.run))
    }

    /// Ends the file and says how it went.
    fn tell(
        &self,
        mut recording: Recording<'_>,
        end: anyhow::Result<End>,
        over: bool,
        arm: Option<&Arm>,
        voice: Voice,
    ) -> anyhow::Result<()> {
        let not_recovered = recording.not_recovered();
        let lost_connections = std::mem::take(&mut recording.program.lost_connections);
        let Recording { visits, program, camera, .. } = &recording;
        let (rate, clock) = (program.client.clock().rate(), program.client.clock().offset());
        let (visits, pictures, lost_s) = (visits.rests.len(), camera.count(), program.client.clock().lost_s());
        let lines = clock_lines(&program.client);
        if recording.follow.start_s.is_some() {
            recording.output.note(&lines)?;
        }
        let started = recording.follow.start_s.is_some();
        let run = Run { samples: recording.output.finish()?, ..Run::default() };
        let end = end?;
        let done = run.samples.iter().filter(|sample| sample.run == self.run).count();
        let unfinished = match end {
            End::Finished | End::Stopped if over && done < visits => Some(Unfinished::Over { done, all: visits }),
            End::Stopped => Some(Unfinished::Stopped { done, all: visits, what: "visits measured" }),
            End::Finished | End::Fault(_) => None,
        };
        if let Some(unfinished) = unfinished.as_ref().filter(|_| run.samples.is_empty()).cloned() {
            return Err(unfinished.into());
        }
        let clock = clock.filter(|_| started).ok_or(RecordError::NoClock)?;
        if run.samples.is_empty() {
            return Err(RecordError::NoPictures { pictures }.into());
        }
        let mut findings = arm.map(|arm| check(arm, &run)).unwrap_or_default();
        findings.extend(uneven(lost_s));
        voice.tell(&Recorded {
            output: self.output.clone(),
            rows: run.samples.len(),
            visits,
            pictures,
            not_recovered,
            clock_offset_s: clock.at_s,
            clock_uncertainty_s: clock.uncertainty_s,
            clock_rate_error_ppm: 1e6 * rate.error,
            clock_rate_uncertainty_ppm: 1e6 * rate.uncertainty,
            findings: findings.iter().map(ToString::to_string).collect(),
            lost_connections,
            end: end.name(),
        })?;
        match end {
            End::Fault(fault) => Err(Safe(fault.to_string()).into()),
            End::Finished | End::Stopped => unfinished.map_or(Ok(()), |unfinished| Err(unfinished.into())),
        }
    }
}

/// Whether the board runs its program.
fn is_running(client: &mut Client) -> anyhow::Result<bool> {
    Ok(matches!(client.status()?.phase, Phase::Playing { .. } | Phase::Approaching { .. }))
}

/// A lost port is waited for so long: to the program's end and a while.
fn patience(visits: &Visits) -> Duration {
    let program_s = visits.rests.last().map_or(0.0, |rest| rest.to_s);
    PATIENCE + Duration::try_from_secs_f64(program_s).unwrap_or(Duration::ZERO)
}

/// What the owner should know of a board's clock that did not keep time.
fn uneven(lost_s: f64) -> Option<Finding> {
    let text = format!(
        "the board's clock lost {lost_s:.3} s while the program ran, as an emulator's does on a busy computer; visits \
         that it makes doubtful are left out"
    );
    (lost_s > LOST_S).then(|| Finding::note(FindingKind::UnevenClock, text))
}
