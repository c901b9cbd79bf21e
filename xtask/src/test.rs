//! All tests: what lands is what passes here.

use std::env;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, bail};

use xtask::image::{self, Board};
use xtask::setup::{self, Emulator};

/// All tests: format, lints, documentation, unit and system tests, the image in the emulator
#[derive(clap::Args)]
pub(crate) struct Test {
    /// What a developer runs at each change: format, lints, unit tests of core, firmware and host, rules of the code
    #[arg(long)]
    quick: bool,
    /// Leave out the tests on the image where there is no emulator, in place of failing
    #[arg(long, conflicts_with = "quick")]
    without_emulator: bool,
}

/// Packages whose unit tests are quick.
const UNIT_TESTED: [&str; 9] = [
    "darm-core",
    "darm-firmware",
    "darm-robot",
    "darm-arm",
    "darm-device",
    "darm-diagnose",
    "darm-serve",
    "darm",
    "darm-figures",
];

impl Test {
    /// Runs the checks in turn and stops at the first that fails.
    pub(crate) fn run(&self) -> Result<()> {
        let start = Instant::now();
        if self.quick {
            quick()?
        } else {
            self.all()?
        }
        let which = if self.quick { "the quick tests" } else { "all tests" };
        eprintln!("{which} passed in {:.0} s", start.elapsed().as_secs_f64());
        Ok(())
    }

    fn all(&self) -> Result<()> {
        setup::rust()?;
        let has_emulator = self.has_emulator()?;
        let has_browser = has_browser()?;
        style()?;
        Board::ALL.into_iter().try_for_each(image::check)?;
        image::check_that_kinematics_cannot_panic()?;
        let mut tests = command(&["test", "--workspace"]);
        if has_emulator {
            tests.env("DARM_EMULATOR_REQUIRED", "1");
        }
        if has_browser {
            tests.env("DARM_BROWSER_REQUIRED", "1");
        }
        run(tests)?;
        cargo(&["doc", "--workspace", "--no-deps"])
    }

    /// False where one is missing and the tests on the images are optional.
    fn has_emulator(&self) -> Result<bool> {
        for board in Board::ALL {
            if let Emulator::Absent(why) = board.emulator() {
                if !self.without_emulator {
                    bail!("there is no emulator of {}: {why}; --without-emulator leaves its tests out", board.name());
                }
                eprintln!("NO EMULATOR of {}: the tests on its image are left out. {why}", board.name());
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// False where there is no browser to test the live page in, and this is not CI.
fn has_browser() -> Result<bool> {
    let Err(why) = setup::browser() else { return Ok(true) };
    if env::var_os("CI").is_some_and(|value| !value.is_empty()) {
        return Err(why.context("there is no browser, and CI tests the live page in one"));
    }
    eprintln!("NO BROWSER: the tests of the live page in one are left out. {why:#}");
    Ok(false)
}

fn quick() -> Result<()> {
    style()?;
    let packages = UNIT_TESTED.iter().flat_map(|package| ["--package", package]);
    let unit_tests: Vec<&str> = ["test", "--quiet", "--lib"].into_iter().chain(packages).collect();
    cargo(&unit_tests)?;
    cargo(&["test", "--quiet", "--package", "darm-tests", "--test", "rules"])
}

/// Of the workspace as the PC builds it, and of each board as its chip does.
fn style() -> Result<()> {
    cargo(&["fmt", "--all", "--check"])?;
    cargo(&["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"])?;
    Board::ALL.into_iter().try_for_each(|board| {
        let chip = ["--package", board.package(), "--features", "chip", "--target", board.target()];
        cargo(&[&["clippy"], &chip[..], &["--", "-D", "warnings"]].concat())
    })
}

fn cargo(arguments: &[&str]) -> Result<()> {
    run(command(arguments))
}

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new("cargo");
    command.current_dir(setup::root()).args(arguments).env("RUSTDOCFLAGS", "-D warnings");
    command
}

fn run(mut command: Command) -> Result<()> {
    let arguments: Vec<_> = command.get_args().map(|argument| argument.to_string_lossy().into_owned()).collect();
    let line = format!("cargo {}", arguments.join(" "));
    eprintln!("running {line}");
    let start = Instant::now();
    let status = command.status().context("cargo did not start")?;
    if !status.success() {
        bail!("{line} failed; its output is above");
    }
    eprintln!("{line}: {:.0} s", start.elapsed().as_secs_f64());
    Ok(())
}
