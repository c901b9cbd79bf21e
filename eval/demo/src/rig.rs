//! The board of the demo with its plant: the image in the emulator, or the firmware library in this process.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use darm_arm::arm::Arm;
use darm_arm::board_profile::BoardProfile;
use darm_arm::wired_arm::WiredArm;
use darm_device::client::Client;
use darm_device::link;
use darm_sim::follow::Follower;
use darm_sim::in_process::{InProcess, MemoryFlash};
use darm_sim::pico::{self, PicoBench};
use darm_sim::plant::Plant;
use darm_sim::plant::camera::Film;
use darm_sim::qemu::{self, Console, Machine, Qemu};

/// A board that can be talked to, and a camera that looks at what hangs on its pins.
pub(crate) struct Rig {
    /// The host's end of the wire.
    pub(crate) client: Client,
    /// What the camera takes.
    pub(crate) film: Film,
    /// What it is, in a few words.
    pub(crate) what: String,
    /// What is wired to it.
    pub(crate) profile: BoardProfile,
    _board: Board,
}

/// Keeps the board alive. The emulator ends with it.
enum Board {
    Emulated { _follower: Follower, _qemu: Qemu },
    InProcess { _board: InProcess },
    Pico { _board: InProcess<PicoBench> },
}

impl Rig {
    /// Boots the image at `elf` in the emulator; the plant follows its pins. The flash lives in `folder`.
    pub(crate) fn emulated(elf: PathBuf, folder: &Path, arm: &Arm) -> Result<Self> {
        let WiredArm { profile, wiring, .. } = WiredArm::new(arm.clone())?;
        let flash = folder.join(qemu::FLASH_FILE);
        if !flash.exists() {
            std::fs::write(&flash, MemoryFlash::with_profile(&profile.image()).bytes())?;
        }
        let machine = Machine::new(elf, folder.to_path_buf(), Console::Socket);
        let mut qemu = Qemu::start(&machine)?;
        let follower = Follower::start(&qemu, &wiring, Plant::new(&wiring, &[]))?;
        qemu.resume()?;
        let client = Client::connect(link::open(qemu.console_port())?).context("the emulated board does not answer")?;
        let film = follower.film();
        let what = "the firmware image in QEMU b-l475e-iot01a".to_owned();
        Ok(Self { client, film, what, profile, _board: Board::Emulated { _follower: follower, _qemu: qemu } })
    }

    /// Boots the image of the Pico at `elf` in its emulator, in virtual time; the plant follows its pins. The flash lives in
    /// `folder`, and the profile is written with the jumper set.
    pub(crate) fn pico(elf: &Path, folder: &Path, arm: &Arm) -> Result<Self> {
        let WiredArm { profile, wiring, .. } = WiredArm::new(arm.clone())?;
        let board = pico::boot(elf, folder, Plant::new(&wiring, &[]))?;
        pico::write_profile(&board, &profile.image()).context("the emulated Pico takes no profile")?;
        let client = Client::connect_as(board.link(), 1).context("the emulated Pico does not answer")?;
        let film = board.film();
        let what = "the firmware image of the Pico in rp2040js, in virtual time".to_owned();
        Ok(Self { client, film, what, profile, _board: Board::Pico { _board: board } })
    }

    /// Runs the firmware library in this process, in virtual time.
    pub(crate) fn in_process(arm: &Arm) -> Result<Self> {
        let WiredArm { profile, wiring, .. } = WiredArm::new(arm.clone())?;
        let flash = MemoryFlash::with_profile(&profile.image());
        let board = InProcess::boot(Plant::new(&wiring, &[]), flash)?;
        let client = Client::connect_as(board.link(), 1).context("the board in this process does not answer")?;
        let film = board.film();
        let what = "the firmware library in this process, in virtual time".to_owned();
        Ok(Self { client, film, what, profile, _board: Board::InProcess { _board: board } })
    }
}
