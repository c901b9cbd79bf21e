//! `darm flash`: writes the firmware to the board with probe-rs.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::Serialize;

use crate::firmware_image;
use crate::ui::{Answer, Ui};

/// Name of the chip as probe-rs knows it.
pub(crate) const CHIP: &str = "STM32L475VG";

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
  cargo xtask image && darm flash  # (no_run: probe)

This builds the image and writes it to the board; an image that was built elsewhere is named: darm flash IMAGE.elf. The board's own ST-LINK (USB connector CN7) is the probe. Tables and calibrations are kept: they are \
in the other flash bank.";

/// Write the firmware to the board, with probe-rs
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Flash {
    /// ELF file of the firmware; default: the one built in this workspace
    #[arg(value_name = "ELF", env = firmware_image::VARIABLE)]
    elf: Option<PathBuf>,
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
        let elf = firmware_image::find(self.elf.as_deref())?;
        let spinner = ui.spinner("flashing");
        probe_rs(&["download", "--chip", CHIP, "--verify", "--disable-progressbars"], Some(&elf))?;
        probe_rs(&["reset", "--chip", CHIP], None)?;
        spinner.finish_and_clear();
        ui.print(&Flashed { elf, chip: CHIP })
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
    use super::has_st_link;

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
