//! `darm record`: plays the board's table and measures: events of the board and pictures of a camera, joined by time.

mod join;
mod source;

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use darm::arm::Arm;
use darm::client::{Client, Happening};
use darm::clock::Offset;
use darm::measurement::{Finding, Run, check, write_text};
use darm_core::sequencer::{Command, Event};
use darm_core::units::ModelHash;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde::Serialize;

use super::camera::unix_less_host_s;
use super::play::{End, Watch};
use super::status::seconds;
use super::visits::{Visits, beside};
use crate::failure::Safe;
use crate::port::{PortArgs, emulated_camera};
use crate::voice::{Answer, Voice};
use join::Mark;
use source::Camera;

const EXAMPLES: &str = "\
Examples:
  darm record measure.darm -o run.csv                                the board of `darm plant` and its camera
  darm record measure.darm --camera tcp:camera.local:7000 -o run.csv.gz
  darm record measure.darm --camera pictures.csv --run 2 -o run2.csv

The camera sends lines of comma-separated text, the first of them the header:
  time_s,x_m,y_m,angle_deg[,supply_bar][,temperature_c]       in space x_m,y_m,z_m,rx_deg,ry_deg,rz_deg
time_s is Unix time, the pose that of the tool in the base. A file is read when the program has
ended; another program may write it meanwhile.

Every visit gives one row: the mean of the pictures that were taken while the arm rested there.
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
    /// The measurements; compressed when the name ends in .gz
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
        let mut samples = join::join(&visits, &played.marks, &pictures);
        for sample in &mut samples {
            sample.run = self.run;
            sample.time_s += played.start_s;
        }
        if samples.is_empty() {
            return Err(RecordError::NoPictures { pictures: pictures.len() }.into());
        }
        let run = Run { samples, lines: Vec::new() };
        write(&self.output, &header(&visits, clock, client.identity().device.to_string().as_str()), &run)?;
        let mut findings = arm.map(|arm| check(&arm, &run)).unwrap_or_default();
        findings.extend(uneven(join::departure_s(&played.marks)));
        voice.tell(&Recorded {
            output: self.output.clone(),
            rows: run.samples.len(),
            visits: visits.rests.len(),
            pictures: pictures.len(),
            clock_offset_s: clock.offset_s,
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
    /// Every event of the program on the camera's clock, with the relation of the clocks as it was then.
    marks: Vec<Mark>,
    end: End,
}

/// Plays to the end, whatever end that is.
fn play(client: &mut Client, visits: &Visits, voice: Voice) -> anyhow::Result<Played> {
    client.set_clock(ROUND_TRIPS)?;
    let mut watch = Watch::new(client.say_hello()?.next_event);
    client.command(Command::Play)?;
    let bar = voice.bar("recording", visits.rests.len() as u64, "visits");
    let (mut start_s, mut marks) = (None, Vec::new());
    let end = loop {
        std::thread::sleep(POLL);
        let happenings = watch.look(client)?;
        if start_s.is_none() {
            let first = happenings.iter().find(|happening| row_of(happening) == Some(0));
            start_s = first.map(|happening| seconds(happening.at));
        }
        if let (Some(start_s), Some(clock)) = (start_s, client.clock().offset()) {
            marks.extend(happenings.iter().map(|happening| mark(happening, start_s, clock)));
        }
        let done = |row: u16| visits.rests.iter().take_while(|rest| rest.row <= row).count();
        if let Some(row) = happenings.iter().rev().find_map(row_of) {
            bar.set_position(done(row) as u64);
        }
        if let Some(end) = watch.end {
            break end;
        }
    };
    bar.finish_and_clear();
    let start_s = start_s.ok_or(RecordError::NothingPlayed)?;
    marks.retain(|mark| mark.program_s >= 0.0);
    Ok(Played { start_s, marks, end })
}

fn mark(happening: &Happening, start_s: f64, clock: Offset) -> Mark {
    let board_s = seconds(happening.at);
    Mark {
        program_s: board_s - start_s,
        offset_s: start_s + clock.offset_s + unix_less_host_s(),
        uncertainty_s: clock.uncertainty_s,
    }
}

fn row_of(happening: &Happening) -> Option<u16> {
    match happening.event {
        Event::Row { row, .. } => Some(row),
        _ => None,
    }
}

/// Comment lines before the table.
fn header(visits: &Visits, clock: Offset, device: &str) -> String {
    format!(
        "# model {}\n# board {device}\n# clock_offset_s {:.6}\n# clock_uncertainty_s {:.6}\n",
        visits.model, clock.offset_s, clock.uncertainty_s
    )
}

fn write(path: &Path, header: &str, run: &Run) -> anyhow::Result<()> {
    let text = header.to_owned() + &write_text(run);
    let bytes = if path.extension().is_some_and(|end| end == "gz") { gz(&text)? } else { text.into_bytes() };
    std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

fn gz(text: &str) -> std::io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    std::io::Write::write_all(&mut encoder, text.as_bytes())?;
    encoder.finish()
}
