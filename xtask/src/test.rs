//! All tests: what lands is what passes here.

use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, bail};

use xtask::image;
use xtask::setup::{self, Emulator, SMALL_TARGET, TARGET};

/// Runs every check in turn and stops at the first that fails.
pub(crate) fn run() -> Result<()> {
    setup::rust()?;
    if let Emulator::Absent(why) = setup::emulator() {
        eprintln!("NO EMULATOR: the tests on the image are left out. {why}");
    }
    let start = Instant::now();
    cargo(&["fmt", "--all", "--check"])?;
    cargo(&["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"])?;
    let chip = ["--package", "darm-firmware", "--features", "chip", "--target", TARGET];
    cargo(&[&["clippy"], &chip[..], &["--", "-D", "warnings"]].concat())?;
    for target in [TARGET, SMALL_TARGET] {
        cargo(&["build", "--package", "darm-core", "--target", target])?;
    }
    image::check(&image::build()?)?;
    image::check_that_kinematics_cannot_panic()?;
    cargo(&["test", "--workspace"])?;
    cargo(&["doc", "--workspace", "--no-deps"])?;
    eprintln!("all tests passed in {:.0} s", start.elapsed().as_secs_f64());
    Ok(())
}

fn cargo(arguments: &[&str]) -> Result<()> {
    eprintln!("running cargo {}", arguments.join(" "));
    let mut command = Command::new("cargo");
    command.current_dir(setup::root()).args(arguments).env("RUSTDOCFLAGS", "-D warnings");
    let status = command.status().context("cargo did not start")?;
    if status.success() { Ok(()) } else { bail!("cargo {} failed; its words stand above", arguments.join(" ")) }
}
