//! `darm flash`: writes the firmware to the board, with probe-rs or over the boot drive of a Pico.

mod uf2;

use std::fs::File;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::Serialize;

use crate::firmware_image::{self, Board};
use crate::ui::{Answer, Ui};

/// Mounted drives of Linux.
const MOUNTS: &str = "/proc/mounts";

/// How to install probe-rs.
pub(crate) const INSTALL: &str = "install it with `curl -LsSf \
    https://github.com/probe-rs/probe-rs/releases/latest/download/probe-rs-tools-installer.sh | sh`";

/// USB devices of Linux, one folder each.
const USB_DEVICES: &str = "/sys/bus/usb/devices";
/// USB vendor of STMicroelectronics.
const ST_VENDOR: &str = "0483";
/// First digits of the product numbers of ST-LINK V2, V2-1 and V3.
const ST_LINK_PRODUCTS: [&str; 2] = ["374", "375"];

const EXAMPLES: &str = "\
Examples:
  cargo xtask image && darm flash   # (no_run: probe)

The image is the one that this program was built with, as every release is (`darm doctor` says so), else the one that \
`cargo xtask image` built in the workspace; another one is named: darm flash IMAGE.elf. The ST-LINK of the B-L475E-IOT01A (USB \
connector CN7) is the probe. Tables and calibrations are kept: they are in the other flash bank.

With --board pico the image is that of a Raspberry Pi Pico. Plugged in with its button BOOTSEL held it is a drive, RPI-RP2: the \
image is copied to it.";

/// Write the firmware to the board, with probe-rs or to the boot drive of a Pico
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Flash {
    /// ELF file of the firmware; default: the one in this program, else the one built in this workspace
    #[arg(value_name = "ELF", env = firmware_image::VARIABLE)]
    elf: Option<PathBuf>,
    /// Board that is written to
    #[arg(long, value_enum, default_value = "b-l475e-iot01a")]
    board: Board,
    /// Folder of the boot drive, where it is not found
    #[arg(long, value_name = "FOLDER")]
    drive: Option<PathBuf>,
}

/// Why the firmware was not written.
#[derive(Debug, thiserror::Error)]
enum FlashError {
    #[error("probe-rs is not installed; {INSTALL}, then run `darm flash` again")]
    NoProbeRs,
    #[error("cannot start probe-rs: {0}")]
    Start(std::io::Error),
    #[error("no ST-LINK on the USB; plug in the board's connector CN7 and run `probe-rs list` (probe-rs: {0})")]
    NoProbe(String),
    #[error("probe-rs failed: {0}; run `darm doctor`")]
    Failed(String),
    #[error(
        "no boot drive RPI-RP2 and no probe; hold BOOTSEL while you plug the Pico in, or name the drive: --drive FOLDER"
    )]
    NoDrive,
    #[error(
        "{0} is not the boot drive of a Pico: it has no INFO_UF2.TXT that names RPI-RP2; hold BOOTSEL while you plug it in"
    )]
    NotADrive(PathBuf),
    #[error("{0} is not an image of a Pico; leave out --board pico and --drive, or name another image")]
    OtherChip(PathBuf),
    #[error("cannot write {0}: {1}; plug the Pico in again with BOOTSEL held")]
    Drive(PathBuf, std::io::Error),
}

impl FlashError {
    /// The same of a Pico without its drive: it may have a probe of any kind.
    fn of_pico(self) -> Self {
        match self {
            Self::NoProbeRs => Self::NoDrive,
            Self::NoProbe(message) | Self::Failed(message) => {
                let text = message.to_lowercase();
                let is_missing = text.contains("no probe") || text.contains("no connected probe");
                if is_missing { Self::NoDrive } else { Self::Failed(message) }
            }
            other => other,
        }
    }
}

#[derive(Serialize)]
struct Flashed {
    elf: PathBuf,
    chip: &'static str,
}

impl Answer for Flashed {
    fn text(&self) -> String {
        format!("{} is on the {} and runs; `darm status` queries it", self.elf.display(), self.chip)
    }
}

impl Flash {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let elf = firmware_image::find_for(self.board, self.elf.as_deref())?;
        let segments = std::fs::read(&elf).ok().and_then(|bytes| uf2::segments(&bytes));
        let spinner = ui.spinner("flashing");
        let chip = match segments {
            Some(segments) => {
                Self::flash_pico(&elf, &segments, self.drive.as_deref())?;
                Board::Pico.chip()
            }
            None if self.drive.is_some() || self.board == Board::Pico => return Err(FlashError::OtherChip(elf).into()),
            None => {
                flash_by_probe(self.board.chip(), &elf)?;
                self.board.chip()
            }
        };
        spinner.finish_and_clear();
        ui.print(&Flashed { elf, chip })
    }

    /// Copies the image to the boot drive; where there is none, a probe may be connected.
    fn flash_pico(elf: &Path, segments: &[(u32, Vec<u8>)], named: Option<&Path>) -> Result<(), FlashError> {
        let drive = match named {
            Some(folder) if uf2::is_drive(folder) => Some(folder.to_path_buf()),
            Some(folder) => return Err(FlashError::NotADrive(folder.to_path_buf())),
            None => uf2::drive(Path::new(MOUNTS)),
        };
        let Some(drive) = drive else {
            return flash_by_probe(Board::Pico.chip(), elf).map_err(FlashError::of_pico);
        };
        let path = drive.join("darm.uf2");
        write(&drive, &path, &uf2::file(segments)).map_err(|error| FlashError::Drive(path, error))
    }
}

/// Writes the image to the drive. The chip starts it when the last block has come, and the drive disappears: what cannot be
/// synchronised after that has arrived.
fn write(drive: &Path, path: &Path, image: &[u8]) -> std::io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(image)?;
    match file.sync_all() {
        Err(error) if uf2::is_drive(drive) => Err(error),
        Ok(()) | Err(_) => Ok(()),
    }
}

fn flash_by_probe(chip: &str, elf: &Path) -> Result<(), FlashError> {
    probe_rs(&["download", "--chip", chip, "--verify", "--disable-progressbars"], Some(elf))?;
    probe_rs(&["reset", "--chip", chip], None)
}

fn probe_rs(arguments: &[&str], file: Option<&Path>) -> Result<(), FlashError> {
    let output =
        Command::new("probe-rs").args(arguments).args(file).stdin(Stdio::null()).output().map_err(|error| {
            if error.kind() == ErrorKind::NotFound { FlashError::NoProbeRs } else { FlashError::Start(error) }
        })?;
    if output.status.success() {
        return Ok(());
    }
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let message = words.trim_start_matches("Error: ").trim_end_matches('.').to_owned();
    match has_st_link(Path::new(USB_DEVICES)) {
        Some(false) => Err(FlashError::NoProbe(message)),
        Some(true) | None => Err(FlashError::Failed(message)),
    }
}

/// Whether an ST-LINK is among the USB devices of this folder of sysfs; `None` where the folder cannot be read.
fn has_st_link(devices: &Path) -> Option<bool> {
    let ids = std::fs::read_dir(devices).ok()?.flatten().map(|device| {
        ["idVendor", "idProduct"].map(|file| std::fs::read_to_string(device.path().join(file)).unwrap_or_default())
    });
    let is_st_link = |[vendor, product]: [String; 2]| {
        vendor.trim() == ST_VENDOR && ST_LINK_PRODUCTS.iter().any(|start| product.trim().starts_with(start))
    };
    Some(ids.into_iter().any(is_st_link))
}

#[cfg(test)]
mod tests {
    use super::{FlashError, has_st_link};

    #[test]
    fn a_probe_of_a_pico_that_fails_is_no_missing_drive() {
        let of = |error: FlashError| error.of_pico().to_string();
        assert!(of(FlashError::NoProbe("No connected probes were found.".into())).starts_with("no boot drive"));
        assert!(of(FlashError::NoProbeRs).starts_with("no boot drive"));
        let failed = of(FlashError::NoProbe("Verification failed at 0x10000100".into()));
        assert_eq!(failed, "probe-rs failed: Verification failed at 0x10000100; run `darm doctor`");
    }

    #[test]
    fn an_st_link_is_recognised_by_its_usb_ids() {
        let devices = tempfile::tempdir().unwrap();
        let plug = |name: &str, vendor: &str, product: &str| {
            std::fs::create_dir(devices.path().join(name)).unwrap();
            std::fs::write(devices.path().join(name).join("idVendor"), format!("{vendor}\n")).unwrap();
            std::fs::write(devices.path().join(name).join("idProduct"), format!("{product}\n")).unwrap();
        };
        plug("1-1", "0483", "5740");
        plug("1-2", "1d6b", "374b");
        assert_eq!(has_st_link(devices.path()), Some(false));
        plug("1-3", "0483", "374b");
        assert_eq!(has_st_link(devices.path()), Some(true));
        assert_eq!(has_st_link(&devices.path().join("none")), None);
    }
}
