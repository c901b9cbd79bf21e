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

/// Builds the image that does kinematics alone and fails when anything in it can panic: no code of that may be linked.
pub(crate) fn check_that_kinematics_cannot_panic() -> Result<()> {
    use object::{Object as _, ObjectSymbol as _};
    let elf = build_binary("probe", "chip")?;
    let bytes = std::fs::read(&elf).with_context(|| format!("{} cannot be read", elf.display()))?;
    let file = object::File::parse(&*bytes).with_context(|| format!("{} is no ELF", elf.display()))?;
    let names: Vec<&str> = file.symbols().filter_map(|symbol| symbol.name().ok()).collect();
    if !names.iter().any(|name| name.contains("probe")) {
        bail!("{} has no symbols: nothing can be looked for in it", elf.display());
    }
    let panics: Vec<&str> = names.into_iter().filter(|name| name.contains("panic")).collect();
    if !panics.is_empty() {
        bail!("kinematics can panic on the chip: {}", panics.join(", "));
    }
    Ok(())
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
