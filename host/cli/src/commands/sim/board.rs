//! The board that runs: the firmware's image in the emulator, or its library in this process.

use std::os::unix::fs::symlink;
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use darm_arm::board_profile::BoardProfile;
use darm_core::output::Wiring;
use darm_core::sequencer::{Command, Phase};
use darm_device::client::Client;
use darm_device::follow::Follower;
use darm_device::in_process::MemoryFlash;
use darm_device::link;
use darm_device::plant::camera::Frame;
use darm_device::plant::{Broken, Plant};
use darm_device::qemu::{self, Console, Machine, Qemu};

use super::bridge::Bridge;
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
    InProcess(Bridge),
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
    pub(crate) fn emulated(
        emulator: Emulator,
        folder: &Path,
        wiring: &Wiring,
        broken: Broken,
        profile: Option<&BoardProfile>,
    ) -> anyhow::Result<(Self, Frames)> {
        let Emulator { elf, console } = emulator;
        let what = format!("{} in {} {}", elf.display(), qemu::PROGRAM, qemu::find()?);
        let mut qemu = Qemu::start(&Machine::new(elf, folder.into(), console))?;
        let mut plant = Plant::new(wiring, &[]);
        // Before the machine runs: an emergency stop that opens when pressed is seen released from the first tick.
        plant.set_broken(0.0, broken);
        let follower = Follower::start(&qemu, wiring, plant)?;
        qemu.resume()?;
        if let Some(profile) = profile {
            press_and_write(&follower, qemu.console_port(), profile)?;
        }
        let film = follower.film();
        let board = Self {
            port: name_port(folder, qemu.console_port())?,
            kind: Kind::Emulated { qemu, follower },
            what,
            flash: folder.join(qemu::FLASH_FILE).display().to_string(),
        };
        Ok((board, Box::new(move || film.take())))
    }

    /// Starts the firmware's library in this process.
    pub(crate) fn in_process(
        folder: &Path,
        wiring: &Wiring,
        broken: Broken,
        profile: Option<&BoardProfile>,
    ) -> anyhow::Result<(Self, Frames)> {
        let port = state_folder::port(folder);
        // There may be none.
        let _ = std::fs::remove_file(&port);
        let listener = UnixListener::bind(&port).with_context(|| format!("cannot open the port {}", port.display()))?;
        let mut plant = Plant::new(wiring, &[]);
        plant.set_broken(0.0, broken);
        let flash = profile.map_or_else(MemoryFlash::default, |profile| MemoryFlash::with_profile(&profile.image()));
        let (bridge, frames) = Bridge::start(listener, plant, flash)?;
        let board = Self {
            kind: Kind::InProcess(bridge),
            what: "the firmware's library in this process".into(),
            port: format!("unix:{}", port.display()),
            flash: "in memory, empty at every start".into(),
        };
        Ok((board, Box::new(move || frames.try_iter().collect())))
    }

    /// The reason, if the board has ended.
    pub(crate) fn ended(&mut self) -> Option<String> {
        match &mut self.kind {
            Kind::Emulated { qemu, .. } => (!qemu.is_running()).then(|| qemu.complaints()),
            Kind::InProcess(bridge) => (!bridge.is_running()).then(|| "the firmware's library panicked".into()),
        }
    }

    /// Ends the board.
    pub(crate) fn stop(self) {
        match self.kind {
            Kind::Emulated { qemu, follower } => {
                drop(follower.stop());
                drop(qemu);
            }
            Kind::InProcess(bridge) => bridge.stop(),
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
        if client.command(Command::Clear).is_ok() || since.elapsed() > CLEARED_WITHIN {
            break;
        }
        std::thread::sleep(CLEARED_WITHIN / 20);
    }
    Ok(())
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
