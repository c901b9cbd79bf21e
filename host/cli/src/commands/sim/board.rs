//! The board that runs: the firmware's image in an emulator, or its library in this process.

use std::os::unix::fs::symlink;
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use darm_arm::board_profile::BoardProfile;
use darm_core::output::Wiring;
use darm_core::profile::PinTable;
use darm_core::sequencer::{Command, Phase};
use darm_device::client::Client;
use darm_device::link;
use darm_sim::follow::Follower;
use darm_sim::in_process::{Bench, Chip, InProcess, MemoryFlash, Stepped};
use darm_sim::pico;
use darm_sim::plant::camera::Frame;
use darm_sim::plant::{Broken, Plant};
use darm_sim::qemu::{self, Console, Machine, Qemu};

use super::bridge::{Bridge, Port};
use super::terminal::Terminal;
use crate::state_folder;

/// Inputs that a restart has cleared are set again well within this time.
const CLEARED_WITHIN: Duration = Duration::from_secs(1);

/// A running board with its simulated arm.
pub(crate) struct Board {
    kind: Kind,
    /// Description for people.
    pub(crate) what: String,
    /// Its port.
    pub(crate) port: String,
    /// Where its flash is, for people.
    pub(crate) flash: String,
}

/// Gives the frames that the camera has taken since the last call, with the host's time.
pub(crate) type Frames = Box<dyn FnMut() -> Vec<Frame> + Send>;

enum Kind {
    Emulated { qemu: Qemu, follower: Follower },
    Bridged { bridge: Bridge, ended: &'static str },
}

/// What a board starts with.
pub(crate) struct Setup<'a> {
    /// Folder of its flash and its port.
    pub(crate) folder: &'a Path,
    /// How the arm is wired to it.
    pub(crate) wiring: &'a Wiring,
    /// What is broken in the arm.
    pub(crate) broken: Broken,
    /// Profile to write, unless the board has it.
    pub(crate) profile: Option<&'a BoardProfile>,
}

impl Setup<'_> {
    fn plant(&self) -> Plant {
        let mut plant = Plant::new(self.wiring, &[]);
        // Before the board runs: an emergency stop that opens when pressed is seen released from the first tick.
        plant.set_broken(0.0, self.broken);
        plant
    }
}

/// How to start the emulator.
pub(crate) struct Emulator {
    /// The firmware's image.
    pub(crate) elf: PathBuf,
    /// Kind of port.
    pub(crate) console: Console,
}

impl Board {
    /// Starts the image in the emulator.
    pub(crate) fn emulated(emulator: Emulator, setup: &Setup<'_>) -> anyhow::Result<(Self, Frames)> {
        let Emulator { elf, console } = emulator;
        let what = format!("{} in {} {}", elf.display(), qemu::PROGRAM, qemu::find()?);
        let mut qemu = Qemu::start(&Machine::new(elf, setup.folder.into(), console))?;
        let follower = Follower::start(&qemu, setup.wiring, setup.plant())?;
        qemu.resume()?;
        if let Some(profile) = setup.profile {
            press_and_write(&follower, qemu.console_port(), profile)?;
        }
        let film = follower.film();
        let board = Self {
            port: name_port(setup.folder, qemu.console_port())?,
            kind: Kind::Emulated { qemu, follower },
            what,
            flash: setup.folder.join(qemu::FLASH_FILE).display().to_string(),
        };
        Ok((board, Box::new(move || film.take())))
    }

    /// Starts the firmware's library in this process, with the chip and the pins of the board that the profile names.
    pub(crate) fn in_process(setup: &Setup<'_>, console: Console) -> anyhow::Result<(Self, Frames)> {
        let pins = setup.profile.and_then(|profile| PinTable::of_layout(profile.profile.board.layout?));
        let chip = pins.map_or_else(Chip::default, Chip::of_board);
        let with_profile = |profile: &BoardProfile| MemoryFlash::with_profile_on(chip, &profile.image());
        let flash = setup.profile.map_or_else(|| MemoryFlash::new(chip), with_profile);
        let chips = setup.profile.and_then(|profile| profile.profile.board.chips);
        let plant = setup.plant();
        let board = InProcess::run("in-process", move || {
            let mut bench = Bench::new(plant, flash);
            chips.into_iter().for_each(|chips| bench.set_chips(chips));
            // A board that measures its supply is one with pins.
            pins.into_iter().for_each(|pins| bench.set_supply(nominal_supply_mv(pins)));
            bench
        })?;
        let named = pins.map_or(String::new(), |pins| format!(", as a {}", pins.board));
        let what = format!("the firmware's library in this process{named}");
        let flash = "in memory, empty at every start".to_owned();
        Self::bridged(&board, setup.folder, console, what, flash, "the firmware's library panicked")
    }

    /// Starts the image of the Pico at `elf` in its emulator. Its time is as fast as the host's, or slower where the host
    /// cannot emulate it as fast.
    pub(crate) fn pico(elf: &Path, setup: &Setup<'_>) -> anyhow::Result<(Self, Frames)> {
        let board = pico::boot(elf, setup.folder, setup.plant())?;
        if let Some(profile) = setup.profile {
            let has =
                Client::connect(board.link())?.hello().is_some_and(|hello| hello.profile == profile.profile.digest);
            if !has {
                pico::write_profile(&board, &profile.image())?;
            }
        }
        let what = format!("{} in rp2040js", elf.display());
        let flash = setup.folder.join(pico::FLASH_FILE).display().to_string();
        Self::bridged(&board, setup.folder, Console::Socket, what, flash, "the emulator of the Pico has ended")
    }

    /// A board in virtual time behind a socket in the folder, or a terminal that the folder names. `ended` is the reason when its thread has ended.
    fn bridged<B: Stepped + 'static>(
        board: &InProcess<B>,
        folder: &Path,
        console: Console,
        what: String,
        flash: String,
        ended: &'static str,
    ) -> anyhow::Result<(Self, Frames)> {
        let (port, name) = match console {
            Console::Socket => socket(folder)?,
            Console::Pty => {
                let (terminal, path) = Terminal::new().context("cannot open a pseudo terminal")?;
                (Port::Terminal(terminal), name_port(folder, &path.display().to_string())?)
            }
        };
        let (bridge, frames) = Bridge::start(port, board.link(), board.film())?;
        let board = Self { kind: Kind::Bridged { bridge, ended }, what, port: name, flash };
        Ok((board, Box::new(move || frames.try_iter().collect())))
    }

    /// The reason, if the board has ended.
    pub(crate) fn ended(&mut self) -> Option<String> {
        match &mut self.kind {
            Kind::Emulated { qemu, .. } => (!qemu.is_running()).then(|| qemu.complaints()),
            Kind::Bridged { bridge, ended } => (!bridge.is_running()).then(|| (*ended).into()),
        }
    }

    /// Ends the board.
    pub(crate) fn stop(self) {
        match self.kind {
            Kind::Emulated { qemu, follower } => {
                drop(follower.stop());
                drop(qemu);
            }
            Kind::Bridged { bridge, .. } => bridge.stop(),
        }
    }
}

/// Writes a profile with the user button held. Does nothing where the board already has it.
fn press_and_write(follower: &Follower, port: &str, profile: &BoardProfile) -> anyhow::Result<()> {
    let mut client = Client::connect(link::open(port)?)?;
    if client.hello().is_some_and(|hello| hello.profile == profile.profile.digest) {
        return Ok(());
    }
    follower.hold_button(true);
    let written = crate::commands::profile::write(&mut client, profile);
    follower.hold_button(false);
    written?;
    // The restart has cleared the inputs of the emulated machine for a moment, and so pressed such an emergency stop.
    if profile.profile.emergency_stop.is_some_and(|stop| stop.opens) {
        clear(&mut client)?;
    }
    Ok(())
}

/// Leaves the safe state, once its cause is gone.
fn clear(client: &mut Client) -> anyhow::Result<()> {
    let since = Instant::now();
    while matches!(client.status()?.phase, Phase::Safe(_)) {
        // The emergency stop has ended the connection.
        client.say_hello()?;
        if client.command(Command::Clear).is_ok() || since.elapsed() > CLEARED_WITHIN {
            break;
        }
        std::thread::sleep(CLEARED_WITHIN / 20);
    }
    Ok(())
}

/// A socket in the folder, and its name.
fn socket(folder: &Path) -> anyhow::Result<(Port, String)> {
    let path = state_folder::port(folder);
    // There may be none.
    let _ = std::fs::remove_file(&path);
    let listener = UnixListener::bind(&path).with_context(|| format!("cannot open the port {}", path.display()))?;
    Ok((Port::Socket(listener), format!("unix:{}", path.display())))
}

/// The supply that a board has on the bench, mV: 3.3 V where no more is measured, else the 4.7 V that USB leaves at VSYS.
fn nominal_supply_mv(pins: &PinTable) -> u16 {
    let [_, highest] = pins.supply_mv;
    if highest < 4_700 { 3_300 } else { 4_700 }
}

/// Links the emulator's port to a fixed path in the folder.
fn name_port(folder: &Path, port: &str) -> anyhow::Result<String> {
    let name = state_folder::port(folder);
    let (prefix, target) = port.split_once(':').map_or(("", port), |(_, path)| ("unix:", path));
    // There may be none.
    let _ = std::fs::remove_file(&name);
    symlink(target, &name).with_context(|| format!("cannot link the port {}", name.display()))?;
    Ok(format!("{prefix}{}", name.display()))
}
