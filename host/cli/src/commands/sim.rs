//! `darm sim`: simulates board, arm and camera. The firmware runs in an emulator or in this process, with an arm on its pins.

mod board;
mod bridge;
mod camera_server;
mod hidden;
mod terminal;

use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use anyhow::Context as _;
use darm_arm::arm::Arm;
use darm_arm::board_profile::BoardProfile;
use darm_arm::stops::differences;
use darm_arm::wired_arm::WiredArm;
use darm_core::profile::{PICO, PinTable};
use darm_core::units::Digest;
use darm_diagnose::report::numbers::after;
use darm_diagnose::truth::{Sealed, Truth};
use darm_sim::pico;
use darm_sim::plant::Broken;
use darm_sim::qemu::{self, Console};
use serde::Serialize;

use crate::failure::Usage;
use crate::firmware_image::NoImage;
use crate::ui::{Answer, Ui};
use crate::{firmware_image, state_folder};
use board::{Board, Emulator, Frames, Setup};
use camera_server::CameraServer;
use hidden::Effect;

const EXAMPLES: &str = "\
Examples:
  darm sim arm.toml                       # board, arm and camera; in another terminal: darm console
  darm sim arm.toml --pty                 # its port is a pseudo terminal, for any terminal program
  darm sim arm.toml --in-process          # the firmware's library in this process
  darm sim pneumatic9.toml                # its profile names the Pico
  darm sim arm.toml --effect any --seed 7 # an undeclared effect in the arm: measure and diagnose it
  darm sim arm3.toml --before arm.toml --effect any --seed 7   # the same arm after its adjustment
  darm sim arm.toml --line-low 4          # output line 4 is stuck low: its limit switch reveals it
  darm sim arm.toml --wired-as planar4.profile.toml   # a wiring to find by `darm bringup`

Ctrl-C ends the simulator and reveals the effect.

While the simulator runs, every command finds the board without --port, unless a real one is plugged in. \
The camera's measurements (CSV, 50 per second) are served on a socket for `darm record --camera`. \
The emulated board's flash is a file in --folder: the next start finds the same table.";

/// Interval between two checks that the board still runs.
const POLL: Duration = Duration::from_millis(200);

/// Simulate board, arm and camera
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Sim {
    /// The arm on the board's pins
    #[arg(value_name = "ARM.toml")]
    arm: PathBuf,
    /// The board whose image runs in its emulator: QEMU, or rp2040js for the Pico [default: the one that the profile names, or
    /// b-l475e-iot01a]
    #[arg(long, value_enum, value_name = "BOARD")]
    board: Option<Emulated>,
    /// ELF file of the firmware; default: the one in this program, else the one built in this workspace
    #[arg(long, value_name = "ELF", env = firmware_image::VARIABLE)]
    firmware: Option<PathBuf>,
    /// Folder of the board's flash, port and camera socket
    #[arg(long, value_name = "FOLDER")]
    folder: Option<PathBuf>,
    /// Profile to write to the simulated board; default: the one that the arm names
    #[arg(long, value_name = "PROFILE.toml")]
    profile: Option<PathBuf>,
    /// Do not write a profile
    #[arg(long, conflicts_with = "profile")]
    no_profile: bool,
    /// Profile that says how the arm is really wired, to try `darm bringup`; default: as the board's profile says
    #[arg(long, value_name = "WIRED.toml")]
    wired_as: Option<PathBuf>,
    /// Make the port a pseudo terminal, for any terminal program. The emulator polls for a new reader once a second: a
    /// `darm stop` directly after another command may end with exit code 5 although the arm is idle
    #[arg(long)]
    pty: bool,
    /// Run the firmware's library in this process; the default without the emulator or without an image
    #[arg(long)]
    in_process: bool,
    /// Undeclared effect in the arm
    #[arg(long, value_name = "KIND", default_value = "none", value_parser = Effect::parser())]
    effect: Effect,
    /// Seed of the effect's place and size, and of the camera noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Arm before its stops were adjusted: the effect is drawn for this one
    #[arg(long, value_name = "OLD.toml")]
    before: Option<PathBuf>,
    /// Output line that is stuck low; can be given several times
    #[arg(long, value_name = "LINE")]
    line_low: Vec<u8>,
    /// Output line that is stuck high
    #[arg(long, value_name = "LINE")]
    line_high: Vec<u8>,
    /// Input that stays open: a limit switch that never closes, or a pressed emergency stop with `opens = true`
    #[arg(long, value_name = "INPUT")]
    switch_open: Vec<u8>,
    /// Input that stays closed: a limit switch that never opens, or a pressed emergency stop with `opens = false`
    #[arg(long, value_name = "INPUT")]
    switch_closed: Vec<u8>,
}

/// A board whose emulator can have an arm on its pins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Emulated {
    /// B-L475E-IOT01A
    #[value(name = "b-l475e-iot01a")]
    BL475eIot01a,
    /// Raspberry Pi Pico
    Pico,
}

impl Emulated {
    /// The board that a profile names; the first one where it names none.
    fn of(profile: Option<&BoardProfile>) -> Self {
        let pins = profile.and_then(|profile| PinTable::of_layout(profile.profile.board.layout?));
        if pins == Some(&PICO) { Self::Pico } else { Self::BL475eIot01a }
    }

    /// What its image is called.
    fn image(self) -> firmware_image::Board {
        match self {
            Self::BL475eIot01a => firmware_image::Board::BL475eIot01a,
            Self::Pico => firmware_image::Board::Pico,
        }
    }
}

/// Board, arm and addresses of the running simulator.
#[derive(Serialize)]
struct Running {
    board: String,
    flash: String,
    arm: String,
    actuators: usize,
    servos: usize,
    port: String,
    camera: String,
    /// Commands find the board without --port.
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
             simulator",
            self.board, self.flash, self.arm, self.actuators, self.port, self.camera,
        )
    }
}

/// The undeclared effect, revealed at the end.
#[derive(Serialize)]
struct Ended {
    effect: Sealed,
}

impl Answer for Ended {
    fn text(&self) -> String {
        let Sealed { effect, place, size, unit, .. } = &self.effect;
        if place.is_empty() {
            return "\nno undeclared effect in the arm".to_owned();
        }
        format!("\nundeclared effect in the arm: {effect} at {place}, {size:.6}{}", after(unit))
    }
}

/// Why the simulator ended or did not start.
#[derive(Debug, thiserror::Error)]
enum SimError {
    #[error("another simulator runs in {0}; end it, or choose another --folder")]
    Taken(PathBuf),
    #[error("the simulated board ended: {0}")]
    Ended(String),
}

impl Sim {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let wired = WiredArm::read(&self.arm, self.profile.as_deref())?;
        let arm = &wired.arm;
        let really = self.wired_as.as_deref().map(|wired_as| WiredArm::read(&self.arm, Some(wired_as))).transpose()?;
        let really = really.as_ref().unwrap_or(&wired);
        let broken = self.broken(really)?;
        let truth = self.truth(arm)?;
        let profile = self.profile_to_write(&wired);
        let folder = self.folder.clone().map_or_else(state_folder::board, Ok)?;
        let listener = claim(&folder)?;
        let (mut board, frames) =
            self.start(ui, &Setup { folder: &folder, wiring: &really.wiring, broken, profile })?;
        let planar = arm.model.chain.is_planar();
        let camera_server = CameraServer::start(listener, truth.clone(), planar, frames)?;
        let interrupt = interrupts()?;
        ui.print(&Running {
            board: board.what.clone(),
            flash: board.flash.clone(),
            arm: arm.name.clone(),
            actuators: arm.n_actuators(),
            servos: arm.n_servos(),
            camera: format!("unix:{}", state_folder::camera(&folder).display()),
            port: board.port.clone(),
            found: self.folder.is_none(),
        })?;
        let end = wait(&mut board, &interrupt);
        camera_server.stop();
        board.stop();
        ui.print(&Ended { effect: truth.unseal().clone() })?;
        end
    }

    fn start(&self, ui: Ui, setup: &Setup<'_>) -> anyhow::Result<(Board, Frames)> {
        let console = if self.pty { Console::Pty } else { Console::Socket };
        let board = self.board.unwrap_or_else(|| Emulated::of(setup.profile));
        if self.in_process {
            return Board::in_process(setup, console);
        }
        match self.image(board)? {
            Ok(elf) if board == Emulated::Pico => Board::pico(&elf, setup),
            Ok(elf) => Board::emulated(Emulator { elf, console }, setup),
            Err(missing) => {
                ui.note(&format!("{missing}; running the firmware's library in this process instead"));
                Board::in_process(setup, console)
            }
        }
    }

    /// The image to emulate; else what is missing, for the library to run in its place. An image of the Pico that is named is not
    /// replaced by the library.
    fn image(&self, board: Emulated) -> anyhow::Result<Result<PathBuf, String>> {
        let is_named = self.firmware.is_some();
        let missing = match board {
            Emulated::BL475eIot01a => qemu::find()
                .err()
                .filter(|error| matches!(error, qemu::VersionError::Missing))
                .map(|error| error.to_string()),
            Emulated::Pico if self.pty => Some("the emulator of the Pico has its port at a socket".to_owned()),
            Emulated::Pico => pico::find().err().filter(|_| !is_named).map(|error| error.to_string()),
        };
        if let Some(missing) = missing {
            return Ok(Err(missing));
        }
        match firmware_image::find_for(board.image(), self.firmware.as_deref()) {
            Err(missing @ NoImage::NotBuilt(_)) => Ok(Err(missing.to_string())),
            found => Ok(Ok(found?)),
        }
    }

    /// The true arm: with the effect drawn for the arm before its adjustment, if there is one.
    fn truth(&self, arm: &Arm) -> anyhow::Result<Truth> {
        let Some(before) = &self.before else { return Ok(self.effect.draw(arm, self.seed)?) };
        let before = Arm::read(before)?;
        differences(&before, arm)?;
        Ok(self.effect.draw(&before, self.seed)?.with_geometry(arm))
    }

    /// The profile to write with the simulated user button held; `None` keeps the board's own or the built-in one.
    fn profile_to_write<'a>(&self, wired: &'a WiredArm) -> Option<&'a BoardProfile> {
        let is_built_in = wired.profile.profile.digest == Digest::default();
        (!self.no_profile && !is_built_in).then_some(&wired.profile)
    }

    /// Simulated faults. An emergency stop that opens when pressed is closed, that is released.
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
        Some(number) => Err(Usage(format!("{what} {number} does not exist; give 0 to {}", count - 1))),
        None => Ok(numbers.iter().fold(0, |bits, number| bits | 1 << number)),
    }
}

/// Creates the folder and opens the camera's socket in it; refuses a folder that another simulator uses.
fn claim(folder: &Path) -> anyhow::Result<UnixListener> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create the folder {}", folder.display()))?;
    let socket = state_folder::camera(folder);
    if std::os::unix::net::UnixStream::connect(&socket).is_ok() {
        return Err(SimError::Taken(folder.into()).into());
    }
    let _ = std::fs::remove_file(&socket);
    UnixListener::bind(&socket).with_context(|| format!("cannot open the camera's socket {}", socket.display()))
}

/// From now on Ctrl-C and SIGTERM arrive here.
fn interrupts() -> anyhow::Result<Receiver<()>> {
    let (interrupted, interrupt) = channel();
    let handler = move || {
        // The receiver is gone once the board has ended.
        let _ = interrupted.send(());
    };
    ctrlc::set_handler(handler).context("cannot wait for Ctrl-C")?;
    Ok(interrupt)
}

/// Waits for Ctrl-C or the board's end.
fn wait(board: &mut Board, interrupt: &Receiver<()>) -> anyhow::Result<()> {
    loop {
        match interrupt.recv_timeout(POLL) {
            Ok(()) | Err(RecvTimeoutError::Disconnected) => return Ok(()),
            Err(RecvTimeoutError::Timeout) => {
                if let Some(words) = board.ended() {
                    return Err(SimError::Ended(words).into());
                }
            }
        }
    }
}
