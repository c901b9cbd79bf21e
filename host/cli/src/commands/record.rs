//! `darm record`: plays the board's table and measures: joins events of the board and camera measurements by time.

mod join;
mod output;
mod program;
mod recording;
mod source;
mod visit_tracker;

use std::path::{Path, PathBuf};
use std::time::Duration;

use darm_arm::arm::Arm;
use darm_core::output::ActuatorWiring;
use darm_core::sequencer::Phase;
use darm_core::table::Record as TableRecord;
use darm_core::units::ShortDigest;
use darm_device::client::Client;
use darm_measure::{Finding, FindingKind, Run, Sample, check};
use serde::Serialize;

use super::play::{End, ProgramMonitor};
use crate::failure::{SafeState, Unfinished};
use crate::guests::Role;
use crate::port::{PortArgs, emulated_camera};
use crate::ui::{Answer, Ui};
use crate::{interrupt, output_file, port};
use darm_arm::table_file::{TableFile, visits_file};
use darm_measure::visits::Visits;
use output::{Earlier, Output};
use program::{LostConnection, Program};
use recording::{Recording, clock_lines};
pub(super) use source::Camera;
use visit_tracker::VisitTracker;

const EXAMPLES: &str = "\
Examples:
  darm record visits.darm -o visits.csv              # the board and camera of `darm sim`
  darm record visits.darm -o visits.mcap             # a log in MCAP; `darm diagnose` reads both
  darm record visits.darm --run 2 -o second.csv.gz   # another run, compressed
  darm record visits.darm --camera tcp:camera.local:7000 -o real.csv   # (no_run: camera)

A file of the camera that ends in .mcap is a log whose messages have the columns below as keys. Any other camera sends lines of comma-separated values. The first line is the header:
  time_s,x_m,y_m,angle_deg[,supply_bar][,temperature_c]
  time_s,x_m,y_m,z_m,rx_deg,ry_deg,rz_deg[,supply_bar][,temperature_c]     (in space)
time_s is Unix time; the pose is that of the tool in the base. A file may grow while another program writes it.

Every visit gives one row: the mean of the measurements while the arm rested there. A row is written when its visit has \
ended, so an interrupted recording is readable; --resume follows the program that is still running and appends the missing \
rows. A lost connection is reopened while the program continues. Comment lines give offset and rate of the board's clock \
with their uncertainties, first as known at the start, then as known at the end.

Ctrl-C stops the arm: exit code 6 if the board confirmed the stop, 5 if not, 4 if the stop could not be sent. Exit code 4 \
also where the camera ended within the program. Exit code 7: another program stopped the arm before the end of its program, \
or the program ended before --resume and visits are missing.

An existing measurement is replaced only with --force, a file of another kind never.";

/// Largest time that a board's clock may lose without a note.
const LOST_S: f64 = 0.02;
/// Longest wait for a lost port after the end of the program.
const RECONNECT_TIMEOUT: Duration = Duration::from_secs(60);
/// Round trips that measure the board's clock before the program starts.
const ROUND_TRIPS: u32 = 20;

/// Play the board's table and measure: one row per visit
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Record {
    /// Table on the board; its .visits.csv is read, and the digests of all three are compared
    #[arg(value_name = "TABLE.darm")]
    table: PathBuf,
    /// Source of camera measurements: unix:PATH, tcp:HOST:PORT or a file; default: the camera of `darm sim`
    #[arg(long, value_name = "CAMERA")]
    camera: Option<String>,
    /// Measurement file to write: CSV, compressed if the name ends in .gz; MCAP if it ends in .mcap
    #[arg(short, long, value_name = "RUN.csv")]
    output: PathBuf,
    /// Check the measurements against this arm
    #[arg(long, value_name = "ARM.toml")]
    arm: Option<PathBuf>,
    /// Resume an interrupted recording, in the same file
    #[arg(long)]
    resume: bool,
    /// Number of the run in the file
    #[arg(long, value_name = "N", default_value_t = 0)]
    run: u32,
    #[command(flatten)]
    port: PortArgs,
}

/// Why a recording failed.
#[derive(Debug, thiserror::Error)]
enum RecordError {
    #[error("no camera found; name one with --camera unix:PATH, tcp:HOST:PORT or a file")]
    NoCamera,
    #[error("the board's clock could not be measured, nothing was recorded; check the connection with `darm doctor`")]
    NoClock,
    #[error("{}: cannot be resumed: its comment lines do not contain the start of the program; record again without --resume", .0.display())]
    NothingToResume(PathBuf),
    #[error("{}: the recording was made with board {recorded}, this is board {connected}; connect the first, or record into another file", path.display())]
    OtherBoard { path: PathBuf, recorded: String, connected: String },
    #[error("{}: the recording was made with table {recorded}, not with {given}; give the table that it was started with", path.display())]
    OtherRecording { path: PathBuf, recorded: ShortDigest, given: ShortDigest },
    #[error("another table was uploaded during the recording; the measurements before are in the file")]
    Replaced,
    #[error("the board restarted during the program; the measurements before are in the file")]
    Restarted,
    #[error(
        "none of {pictures} camera measurements was taken while the arm rested; check that the camera's time_s is Unix time"
    )]
    NoPictures { pictures: usize },
}

#[derive(Serialize)]
struct Recorded {
    output: PathBuf,
    rows: usize,
    visits: usize,
    pictures: usize,
    /// Visits that have ended without a row, numbered as in the visit file.
    not_recovered: Vec<usize>,
    clock_offset_s: f64,
    clock_offset_uncertainty_s: f64,
    clock_rate_error_ppm: f64,
    clock_rate_uncertainty_ppm: f64,
    findings: Vec<String>,
    /// Interruptions of the connection to the board.
    lost_connections: Vec<LostConnection>,
    end: &'static str,
}

impl Answer for Recorded {
    fn text(&self) -> String {
        let mut lines: Vec<String> = self.findings.iter().map(|finding| format!("note: {finding}")).collect();
        if !self.not_recovered.is_empty() {
            let visits = ranges(&self.not_recovered);
            lines.push(format!("note: no camera measurement of the arm certainly at rest at visits {visits}"));
        }
        lines.push(format!(
            "{} of {} visits measured from {} camera measurements, in {}; board clock: offset ±{:.1} ms, rate {:+.0} ±{:.0} ppm",
            self.rows,
            self.visits,
            self.pictures,
            self.output.display(),
            1e3 * self.clock_offset_uncertainty_s,
            self.clock_rate_error_ppm,
            self.clock_rate_uncertainty_ppm
        ));
        lines.join("\n")
    }
}

impl Record {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let visits = Visits::read(&visits_file(&self.table))?;
        let table = TableFile::read(&self.table)?;
        table.check_visits(visits.table)?;
        let arm = self.arm.as_deref().map(Arm::read).transpose()?;
        let (mut output, earlier) = self.open_output(ui)?;
        let camera = self.camera.clone().or_else(emulated_camera).ok_or(RecordError::NoCamera)?;
        let port = self.port.name()?;
        let (mut client, handle) = port::connect(&port, Role::Controls)?;
        table.check_loaded(client.hello().and_then(|hello| hello.table))?;
        let camera = Camera::open(&camera)?;
        let interrupt = interrupt::InterruptHandler::start(&port, handle)?;
        let over = earlier.is_some() && !is_running(&mut client)?;
        let (tracker, monitor) = match earlier {
            None => start(&visits, &mut client, &interrupt)?,
            Some(earlier) => self.resume_program(&visits, &mut client, &mut output, earlier)?,
        };
        let program = Program::new(client, monitor, interrupt.clone(), reconnect_timeout(&visits), ui);
        let actuators = actuators(&table);
        let mut recording = Recording::new(tracker, program, camera, output, self.run).with_strokes(&actuators);
        let bar = ui.progress_bar("recording", visits.rests.len() as u64, "visits");
        let end = recording.until_the_end(|visit| bar.set_position(visit as u64));
        bar.finish_and_clear();
        let reported = self.report(recording, end, over, arm.as_ref(), ui);
        interrupt.interrupted().map_or(reported, |interrupted| Err(interrupted.into()))
    }

    fn open_output(&self, ui: Ui) -> anyhow::Result<(Output, Option<Earlier>)> {
        if self.resume {
            let (output, earlier) = Output::resume(&self.output)?;
            return Ok((output, Some(earlier)));
        }
        output_file::refuse_other_than_measurement(&self.output)?;
        ui.overwrite.check(&[&self.output])?;
        Ok((Output::create(&self.output)?, None))
    }

    /// Follows the program that an earlier recording started, and appends to its file.
    fn resume_program<'a>(
        &self,
        visits: &'a Visits,
        client: &mut Client,
        output: &mut Output,
        earlier: Earlier,
    ) -> anyhow::Result<(VisitTracker<'a>, ProgramMonitor)> {
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
        let tracker = VisitTracker::resume(visits, earlier.start_s, earlier.next(self.run));
        let monitor = ProgramMonitor::resume(earlier.start_s);
        output.begin_after(earlier)?;
        Ok((tracker, monitor))
    }

    /// Finishes the file and prints the result.
    fn report(
        &self,
        mut recording: Recording<'_>,
        end: anyhow::Result<End>,
        over: bool,
        arm: Option<&Arm>,
        ui: Ui,
    ) -> anyhow::Result<()> {
        let not_recovered = recording.not_recovered();
        let lost_camera = recording.lost_camera.take().filter(|_| !not_recovered.is_empty());
        let lost_connections = std::mem::take(&mut recording.program.lost_connections);
        let Recording { tracker, program, camera, .. } = &recording;
        let (rate, clock) = (program.client.clock().rate(), program.client.clock().offset());
        let (visits, pictures, lost_s) = (tracker.visits.rests.len(), camera.count(), program.client.clock().lost_s());
        let lines = clock_lines(&program.client);
        if recording.tracker.start_s.is_some() {
            recording.output.note(&lines)?;
        }
        let started = recording.tracker.start_s.is_some();
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
        findings.extend(lost_time(lost_s));
        ui.print(&Recorded {
            output: self.output.clone(),
            rows: run.samples.len(),
            visits,
            pictures,
            not_recovered,
            clock_offset_s: clock.at_s,
            clock_offset_uncertainty_s: clock.uncertainty_s,
            clock_rate_error_ppm: 1e6 * rate.error,
            clock_rate_uncertainty_ppm: 1e6 * rate.uncertainty,
            findings: findings.iter().map(ToString::to_string).collect(),
            lost_connections,
            end: end.name(),
        })?;
        match end {
            End::Fault(fault) => Err(SafeState(fault.to_string()).into()),
            End::Finished | End::Stopped => {
                lost_camera.map_or(Ok(()), Err)?;
                unfinished.map_or(Ok(()), |unfinished| Err(unfinished.into()))
            }
        }
    }
}

/// Numbers in increasing order, those that follow each other as a range: `3, 40 to 167`.
fn ranges(numbers: &[usize]) -> String {
    let of = |run: &[usize]| match run {
        [first, .., last] if run.len() > 2 => format!("{first} to {last}"),
        _ => run.iter().map(usize::to_string).collect::<Vec<_>>().join(", "),
    };
    numbers.chunk_by(|a, b| a + 1 == *b).map(of).collect::<Vec<_>>().join(", ")
}

/// A program that the board holds, to be played and measured for another command.
pub(super) struct Measurement<'a> {
    pub(super) visits: &'a Visits,
    /// As the user named it.
    pub(super) camera: &'a str,
    /// Written row by row.
    pub(super) output: &'a Path,
    pub(super) ui: Ui,
}

impl Measurement<'_> {
    /// Plays it; the rows, where it came to its end.
    pub(super) fn run(
        &self,
        mut client: Client,
        interrupt: &interrupt::InterruptHandler,
        on_visit: impl FnMut(usize),
    ) -> anyhow::Result<Vec<Sample>> {
        let mut camera = Camera::open(self.camera)?;
        camera.wait_for_new()?;
        let output = Output::create(self.output)?;
        let (tracker, monitor) = start(self.visits, &mut client, interrupt)?;
        let program = Program::new(client, monitor, interrupt.clone(), reconnect_timeout(self.visits), self.ui);
        let mut recording = Recording::new(tracker, program, camera, output, 0).stopping_without_camera();
        let end = recording.until_the_end(on_visit);
        let (pictures, not_measured) = (recording.camera.count(), recording.not_recovered());
        let samples = recording.output.finish()?;
        if let Some(interrupted) = interrupt.interrupted() {
            return Err(interrupted.into());
        }
        let (done, all) = (samples.len(), self.visits.rests.len());
        match end? {
            End::Fault(fault) => Err(SafeState(fault.to_string()).into()),
            End::Stopped => Err(Unfinished::Stopped { done, all, what: "visits measured" }.into()),
            End::Finished if samples.is_empty() => Err(RecordError::NoPictures { pictures }.into()),
            End::Finished => {
                self.note(&not_measured);
                Ok(samples)
            }
        }
    }

    /// Reports the visits that have no row although the program came to its end.
    fn note(&self, not_measured: &[usize]) {
        if !not_measured.is_empty() {
            let (n, all, visits) = (not_measured.len(), self.visits.rests.len(), ranges(not_measured));
            self.ui.note(&format!("{n} of {all} visits not measured, no camera measurement at rest: visits {visits}"));
        }
    }
}

/// Starts the program.
fn start<'a>(
    visits: &'a Visits,
    client: &mut Client,
    interrupt: &interrupt::InterruptHandler,
) -> anyhow::Result<(VisitTracker<'a>, ProgramMonitor)> {
    client.set_clock(ROUND_TRIPS)?;
    let hello = client.say_hello()?;
    if hello.table != Some(visits.table) {
        return Err(RecordError::Replaced.into());
    }
    let monitor = ProgramMonitor::new(hello.next_event);
    interrupt.play(client)?;
    Ok((VisitTracker::new(visits), monitor))
}

/// The actuators of a table, with their limit switches.
fn actuators(table: &TableFile) -> Vec<ActuatorWiring> {
    let of_record = |record: &TableRecord| match record {
        TableRecord::Actuator(actuator) => Some(*actuator),
        _ => None,
    };
    table.records.iter().filter_map(of_record).collect()
}

/// Whether the board is running its program.
fn is_running(client: &mut Client) -> anyhow::Result<bool> {
    Ok(matches!(client.status()?.phase, Phase::Playing { .. } | Phase::Approaching { .. }))
}

/// Longest wait for a lost port: until the program's end and some time more.
fn reconnect_timeout(visits: &Visits) -> Duration {
    let program_s = visits.rests.last().map_or(0.0, |rest| rest.to_s);
    RECONNECT_TIMEOUT + Duration::try_from_secs_f64(program_s).unwrap_or(Duration::ZERO)
}

/// A note about a board's clock that lost time.
fn lost_time(lost_s: f64) -> Option<Finding> {
    let text = format!(
        "the board's clock lost {lost_s:.3} s during the program, as an emulator's does on a busy computer; doubtful visits \
         are left out"
    );
    (lost_s > LOST_S).then(|| Finding::note(FindingKind::UnevenClock, text))
}
