//! The firmware image: the ELF that is flashed and that runs in the emulator.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::setup;

/// Builds the image and returns its path.
pub(crate) fn build() -> Result<PathBuf> {
    build_binary("darm-firmware", "chip")
}

/// Builds the image that counts instructions and returns its path.
pub(crate) fn build_bench() -> Result<PathBuf> {
    build_binary("bench", "bench")
}

/// Builds one of the firmware's binaries for the chip and returns its path.
fn build_binary(name: &str, feature: &str) -> Result<PathBuf> {
    setup::rust()?;
    let root = setup::root();
    let status = Command::new("cargo")
        .current_dir(&root)
        .args(["build", "--package", "darm-firmware", "--features", feature, "--profile", "firmware"])
        .args(["--target", setup::TARGET, "--bin", name])
        .status()
        .context("cargo did not start")?;
    if !status.success() {
        bail!("the firmware does not build; the compiler's words stand above");
    }
    Ok(root.join("target").join(setup::TARGET).join("firmware").join(name))
}
