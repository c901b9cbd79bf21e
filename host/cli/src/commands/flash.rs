//! `darm flash`: brings the firmware onto the board through probe-rs.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::Serialize;

use crate::firmware_image;
use crate::voice::{Answer, Voice};

/// Name of the chip as probe-rs knows it.
pub(crate) const CHIP: &str = "STM32L475VG";

/// How to come by probe-rs.
pub(crate) const INSTALL: &str = "install it with `curl -LsSf \
    https://github.com/probe-rs/probe-rs/releases/latest/download/probe-rs-tools-installer.sh | sh`";

const EXAMPLES: &str = "\
Examples:
  cargo xtask image && darm flash       build the image, bring it onto the board
  darm flash darm-firmware              an image that was built elsewhere

The board's own ST-LINK (USB connector CN7) is the probe. Tables and calibrations stay: they are \
in the other flash bank.";

/// Bring the firmware onto the board, through probe-rs
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Flash {
    /// ELF of the firmware; that of this workspace where it is left out
    #[arg(value_name = "ELF", env = firmware_image::VARIABLE)]
    elf: Option<PathBuf>,
}

/// Why nothing was flashed.
#[derive(Debug, thiserror::Error)]
enum FlashError {
    #[error("probe-rs is not installed; {INSTALL}, then `darm flash` again")]
    NoProbeRs,
    #[error("cannot start probe-rs: {0}")]
    Start(std::io::Error),
    #[error("no debug probe found; plug the board's ST-LINK connector in (CN7) and see `probe-rs list`")]
    NoProbe,
    #[error("probe-rs failed: {0}; see `darm doctor`")]
    Failed(String),
}

#[derive(Serialize)]
struct Flashed {
    elf: PathBuf,
    chip: &'static str,
}

impl Answer for Flashed {
    fn text(&self) -> String {
        format!("{} is on the {} and runs; `darm status` asks it", self.elf.display(), self.chip)
    }
}

impl Flash {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let elf = firmware_image::find(self.elf.as_deref())?;
        let wheel = voice.wheel("flashing");
        probe_rs(&["download", "--chip", CHIP, "--verify", "--disable-progressbars"], Some(&elf))?;
        probe_rs(&["reset", "--chip", CHIP], None)?;
        wheel.finish_and_clear();
        voice.tell(&Flashed { elf, chip: CHIP })
    }
}

fn probe_rs(arguments: &[&str], file: Option<&Path>) -> Result<(), FlashError> {
    let output =
        Command::new("probe-rs").args(arguments).args(file).stdin(Stdio::null()).output().map_err(|error| {
            if error.kind() == ErrorKind::NotFound { FlashError::NoProbeRs } else { FlashError::Start(error) }
        })?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    if said.contains("No connected probes") || said.contains("no probe") {
        return Err(FlashError::NoProbe);
    }
    let words = said.split_whitespace().collect::<Vec<_>>().join(" ");
    Err(FlashError::Failed(words.trim_start_matches("Error: ").trim_end_matches('.').to_owned()))
}
