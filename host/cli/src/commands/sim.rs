//! `darm plant`: a board to play with. The firmware runs in the emulator or in this process; an arm hangs on its pins.

mod board;
mod bridge;
mod film;
mod hidden;

use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use anyhow::Context as _;
use darm_arm::arm::Arm;
use darm_arm::board_profile::BoardProfile;
use darm_arm::stops::differences;
use darm_arm::wired_arm::WiredArm;
use darm_core::units::Digest;
use darm_device::plant::Broken;
use darm_device::qemu::{self, Console};
use darm_diagnose::truth::{Sealed, Truth};
use serde::Serialize;

use crate::failure::Usage;
use crate::voice::{Answer, Voice};
use crate::{firmware_image, state_folder};
use board::{Board, Emulator};
use film::Projector;
use hidden::Effect;

const EXAMPLES: &str = "\
Examples:
  darm plant arm.toml                     a board with this arm; in another terminal: darm console
  darm plant arm.toml --pty               its port as a pseudo terminal, for any terminal program
  darm plant arm.toml --in-process        the firmware's library instead of its image in the emulator
  darm plant arm.toml --effect any --seed 7
                                          something is wrong with this arm: measure, diagnose, then
                                          Ctrl-C tells what it was
  darm plant arm2.toml --before arm.toml --effect any --seed 7
                                          the same arm after its stops were turned
  darm plant arm.toml --line-low 4        output line 4 is broken: the board notices by the limit switch

While it runs every command finds the board without --port, unless a real one is plugged in. \
The camera's lines (CSV, 50 a second) are served on a socket for `darm record --camera`. \
The board's flash is a file in --folder: its table is there again the next time.";

/// How often the board is looked after.
const LOOK: Duration = Duration::from_millis(200);

/// Start a board without hardware, with an arm on its pins and a camera
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Plant {
    /// The arm on the board's pins
    #[arg(value_name = "ARM.toml")]
    arm: PathBuf,
    /// ELF of the firmware; that of this workspace where it is left out
    #[arg(long, value_name = "ELF", env = firmware_image::VARIABLE)]
    firmware: Option<PathBuf>,
    /// Folder of the board's flash, port and camera socket
    #[arg(long, value_name = "FOLDER")]
    folder: Option<PathBuf>,
    /// Profile that is written to the board, with its button held; the one that the arm names where it is left out
    #[arg(long, value_name = "PROFILE.toml")]
    profile: Option<PathBuf>,
    /// Leave the board with the profile that it has
    #[arg(long, conflicts_with = "profile")]
    no_profile: bool,
    /// Make the port a pseudo terminal, for any terminal program. The emulator looks for a new reader of it once a second:
    /// a `darm stop` directly after another command may end with code 5 although the arm is idle
    #[arg(long)]
    pty: bool,
    /// Run the firmware's library in this process; so it is done where the emulator is not installed
    #[arg(long, conflicts_with = "pty")]
    in_process: bool,
    /// Effect in the arm that its file does not declare: none, any, stroke-loss, anchor-offset, gravity-sag, play,
    /// supply-stroke or thermal-growth
    #[arg(long, value_name = "KIND", default_value = "none")]
    effect: Effect,
    /// Seed of the effect's place and size, and of the camera's noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Arm that the effect is drawn for, where its stops have been turned since
    #[arg(long, value_name = "OLD.toml")]
    before: Option<PathBuf>,
    /// Output line that is stuck low; may be given several times
    #[arg(long, value_name = "LINE")]
    line_low: Vec<u8>,
    /// Output line that is stuck high
    #[arg(long, value_name = "LINE")]
    line_high: Vec<u8>,
    /// Limit switch that never closes; the input of an emergency stop with `opens = true`: it is pressed
    #[arg(long, value_name = "INPUT")]
    switch_open: Vec<u8>,
    /// Limit switch that never opens; the input of an emergency stop with `opens = false`: it is pressed
    #[arg(long, value_name = "INPUT")]
    switch_closed: Vec<u8>,
}

/// Where everything is.
#[derive(Serialize)]
struct Running {
    board: String,
    flash: String,
    arm: String,
    actuators: usize,
    servos: usize,
    port: String,
    camera: String,
    /// Commands find the board without being told its port.
    #[serde(skip)]
    found: bool,
}

impl Answer for Running {
    fn text(&self) -> String {
        let servos = match self.servos {
            0 => String::new(),
            1 => ", 1 servo joint".to_owned(),
            count => format!(", {count} servo joints"),
        };
        let port = if self.found { String::new() } else { format!(" -p {}", self.port) };
        format!(
            "board    {}\nflash    {}\narm      {}, {} actuators{servos}\nport     {}\ncamera   {}\n\n\
             In another terminal: `darm console{port}`, `darm status{port}`, `darm upload TABLE.darm{port}`; Ctrl-C ends the \
             board",
            self.board, self.flash, self.arm, self.actuators, self.port, self.camera,
        )
    }
}

/// What was hidden in the arm.
#[derive(Serialize)]
struct Ended {
    effect: Sealed,
}

impl Answer for Ended {
    fn text(&self) -> String {
        let Sealed { effect, place, size, unit, .. } = &self.effect;
        if place.is_empty() {
            return "\nthe arm was as its file says".to_owned();
        }
        let unit = if *unit == "1" { String::new() } else { format!(" {unit}") };
        format!("\nhidden in the arm was: {effect} at {place}, {size:.6}{unit}")
    }
}

/// Why the board ended or did not start.
#[derive(Debug, thiserror::Error)]
enum PlantError {
    #[error("another board already runs in {0}; end it, or choose another --folder")]
    Taken(PathBuf),
    #[error("the board ended: {0}")]
    Ended(String),
}

impl Plant {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let wired = WiredArm::read(&self.arm, self.profile.as_deref())?;
        let arm = &wired.arm;
        let broken = self.broken(&wired)?;
        let truth = self.truth(arm)?;
        let profile = self.profile_to_write(&wired);
        let folder = self.folder.clone().map_or_else(state_folder::board, Ok)?;
        let listener = claim(&folder)?;
        let (mut board, frames) = match self.emulator(voice)? {
            Some(emulator) => Board::emulated(emulator, &folder, &wired.wiring, broken, profile)?,
            None => Board::in_process(&folder, &wired.wiring, broken, profile)?,
        };
        let planar = arm.model.chain.is_planar();
        let projector = Projector::start(listener, truth.clone(), planar, frames)?;
        voice.tell(&Running {
            board: board.what.clone(),
            flash: board.flash.clone(),
            arm: arm.name.clone(),
            actuators: arm.n_actuators(),
            servos: arm.n_servos(),
            camera: format!("unix:{}", state_folder::camera(&folder).display()),
            port: board.port.clone(),
            found: self.folder.is_none(),
        })?;
        let end = wait(&mut board);
        projector.stop();
        board.stop();
        voice.tell(&Ended { effect: truth.unseal().clone() })?;
        end
    }

    /// How to start the emulator; `None` where the library is to run in this process.
    fn emulator(&self, voice: Voice) -> anyhow::Result<Option<Emulator>> {
        if self.in_process {
            return Ok(None);
        }
        if let Err(error @ qemu::VersionError::Missing) = qemu::find() {
            voice.note(&format!("{error}; the firmware's library runs in this process meanwhile"));
            return Ok(None);
        }
        let elf = firmware_image::find(self.firmware.as_deref())?;
        Ok(Some(Emulator { elf, console: if self.pty { Console::Pty } else { Console::Socket } }))
    }

    /// The true arm: with the effect of the arm before, if there is one.
    fn truth(&self, arm: &Arm) -> anyhow::Result<Truth> {
        let Some(before) = &self.before else { return Ok(self.effect.draw(arm, self.seed)?) };
        let before = Arm::read(before)?;
        differences(&before, arm)?;
        Ok(self.effect.draw(&before, self.seed)?.with_geometry(arm))
    }

    /// The profile to write while the button is held; none where the board keeps its own or the one built in.
    fn profile_to_write<'a>(&self, wired: &'a WiredArm) -> Option<&'a BoardProfile> {
        let is_built_in = wired.profile.profile.digest == Digest::default();
        (!self.no_profile && !is_built_in).then_some(&wired.profile)
    }

    /// What is broken. An emergency stop that opens when it is pressed is closed, so released.
    fn broken(&self, wired: &WiredArm) -> Result<Broken, Usage> {
        let stop = wired.profile.profile.emergency_stop.filter(|stop| stop.opens);
        let released = stop.map_or(0, |stop| 1u32.checked_shl(stop.input.into()).unwrap_or(0));
        Ok(Broken {
            lines_low: bits(&self.line_low, 64, "line")?,
            lines_high: bits(&self.line_high, 64, "line")?,
            switches_open: bits(&self.switch_open, 32, "input")? as u32,
            switches_closed: released | bits(&self.switch_closed, 32, "input")? as u32,
            ..Broken::default()
        })
    }
}

fn bits(numbers: &[u8], count: u8, what: &str) -> Result<u64, Usage> {
    match numbers.iter().find(|&&number| number >= count) {
        Some(number) => Err(Usage(format!("no {what} {number}; they go from 0 to {}", count - 1))),
        None => Ok(numbers.iter().fold(0, |bits, number| bits | 1 << number)),
    }
}

/// Makes the folder and opens the camera's socket in it; refuses a folder in which another board runs.
fn claim(folder: &Path) -> anyhow::Result<UnixListener> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let socket = state_folder::camera(folder);
    if std::os::unix::net::UnixStream::connect(&socket).is_ok() {
        return Err(PlantError::Taken(folder.into()).into());
    }
    let _ = std::fs::remove_file(&socket);
    UnixListener::bind(&socket).with_context(|| format!("cannot open the camera's socket {}", socket.display()))
}

/// Until Ctrl-C or the board's end.
fn wait(board: &mut Board) -> anyhow::Result<()> {
    let (interrupted, interrupt) = channel();
    // Nobody waits any more once the board has ended.
    let interrupt_handler = move || interrupted.send(()).unwrap_or_default();
    ctrlc::set_handler(interrupt_handler).context("cannot wait for Ctrl-C")?;
    loop {
        match interrupt.recv_timeout(LOOK) {
            Ok(()) | Err(RecvTimeoutError::Disconnected) => return Ok(()),
            Err(RecvTimeoutError::Timeout) => {
                if let Some(words) = board.ended() {
                    return Err(PlantError::Ended(words).into());
                }
            }
        }
    }
}
