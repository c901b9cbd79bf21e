//! All tests: what lands is what passes here.

use std::env;
use std::process::Command;
use std::thread;
use std::time::Instant;

use anyhow::{Context, Result, anyhow, bail};

use xtask::image::{self, Board};
use xtask::setup::{self, Emulator};

/// All tests: format, lints, documentation, unit and system tests, the image in the emulator
#[derive(clap::Args)]
pub(crate) struct Test {
    /// What a developer runs at each change: format, lints, rules of the code, unit tests of the packages that changed
    #[arg(long, conflicts_with = "part")]
    quick: bool,
    /// Only one part, as a job of CI beside the others
    #[arg(long, value_enum)]
    part: Option<Part>,
    /// Leave out the tests on the image where there is no emulator, in place of failing
    #[arg(long, conflicts_with = "quick")]
    without_emulator: bool,
}

/// What can run as a job of CI, in the order in which one machine runs all of them.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// Format and lints
    Style,
    /// Stack and panics of the images
    Images,
    /// Unit tests, system tests, the images in their emulators
    Tests,
    /// The documentation of the code, the book, what is published: nothing else needs the renderer of the book
    Documents,
}

/// The tests of the book and of what is published.
const BOOK: &str = "darm-book";
/// Packages whose unit tests are quick, with their folders.
const UNIT_TESTED: [(&str, &str); 11] = [
    ("darm-core", "shared/"),
    ("darm-firmware", "firmware/src/"),
    ("darm-robot", "host/robot/"),
    ("darm-arm", "host/arm/"),
    ("darm-device", "host/device/"),
    ("darm-sim", "host/sim/"),
    ("darm-measure", "host/measure/"),
    ("darm-diagnose", "host/diagnose/"),
    ("darm-serve", "host/serve/"),
    ("darm", "host/cli/"),
    ("darm-figures", "eval/figures/"),
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
        // What is missing on this machine is reported before minutes of compilation.
        let runs_tests = self.part.is_none_or(|part| part == Part::Tests);
        let (has_emulator, has_browser) =
            if runs_tests { (self.has_emulator()?, has_browser()?) } else { (false, false) };
        match self.part {
            Some(Part::Style) => style(),
            Some(Part::Images) => images(),
            Some(Part::Tests) => tests(has_emulator, has_browser),
            Some(Part::Documents) => documents(),
            None => {
                // The linker's optimisation of an image uses one core for most of its time: the lints take the other.
                let built =
                    thread::spawn(|| Board::ALL.into_iter().try_for_each(|board| image::build_for(board).map(drop)));
                style()?;
                built.join().map_err(|_| anyhow!("the build of the images panicked"))??;
                images()?;
                tests(has_emulator, has_browser)?;
                documents()
            }
        }
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

fn images() -> Result<()> {
    Board::ALL.into_iter().try_for_each(image::check)?;
    // What counts instructions has the tasks in it and grows with them.
    image::build_bench()?;
    image::build_kinematics()?;
    image::check_that_kinematics_cannot_panic()
}

fn tests(has_emulator: bool, has_browser: bool) -> Result<()> {
    // Pictures are drawn with a feature that no default build has.
    let mut tests = command(&["test", "--workspace", "--exclude", BOOK, "--features", "darm-camera/render"]);
    if has_emulator {
        tests.env("DARM_EMULATOR_REQUIRED", "1");
    }
    if has_browser {
        tests.env("DARM_BROWSER_REQUIRED", "1");
    }
    run(tests)
}

fn documents() -> Result<()> {
    cargo(&["doc", "--workspace", "--no-deps"])?;
    cargo(&["test", "--package", BOOK])
}

/// Lints see every package; the unit tests of a package run where one of its files differs from the last commit. After a line of the
/// core all others would be compiled for minutes, to run tests of code that is as it was: these are for the complete tests.
fn quick() -> Result<()> {
    style()?;
    let packages = packages_of(changed_files().as_deref());
    if !packages.is_empty() {
        let packages = packages.iter().flat_map(|package| ["--package", package]);
        cargo(&["test", "--quiet", "--lib", "--bins"].into_iter().chain(packages).collect::<Vec<_>>())?;
    }
    cargo(&["test", "--quiet", "--package", "darm-rules"])
}

/// The files that differ from the last commit, from the root; `None` outside of a git checkout.
fn changed_files() -> Option<Vec<String>> {
    let lines = |arguments: &[&str]| {
        let output = Command::new("git").current_dir(setup::root()).args(arguments).output().ok()?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        output.status.success().then(|| text.lines().map(str::to_owned).collect::<Vec<_>>())
    };
    let mut files = lines(&["diff", "--name-only", "--relative", "HEAD"])?;
    files.extend(lines(&["ls-files", "--others", "--exclude-standard"])?);
    Some(files)
}

/// The packages of these files; all where it is not known what changed.
fn packages_of(files: Option<&[String]>) -> Vec<&'static str> {
    let has_changed = |folder: &str| files.is_none_or(|files| files.iter().any(|file| file.starts_with(folder)));
    UNIT_TESTED.into_iter().filter(|(_, folder)| has_changed(folder)).map(|(package, _)| package).collect()
}

/// Of the workspace as the PC builds it, and of each board as its chip does.
fn style() -> Result<()> {
    cargo(&["fmt", "--all", "--check"])?;
    // CI has it, and the database of advisories.
    if setup::has("cargo-deny") {
        cargo(&["deny", "--offline", "check", "licenses", "bans", "sources"])?;
    }
    // With the features that no default build has: nothing is compiled only without them.
    let features = "darm/camera,darm-camera/render";
    cargo(&["clippy", "--workspace", "--all-targets", "--features", features, "--", "-D", "warnings"])?;
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

#[cfg(test)]
mod tests {
    use super::{UNIT_TESTED, packages_of};

    #[test]
    fn the_quick_tests_are_those_of_the_packages_that_changed() {
        let files = ["shared/src/se.rs", "docs/wire.md", "host/cli/src/ui.rs"].map(str::to_owned);
        assert_eq!(packages_of(Some(&files)), ["darm-core", "darm"]);
        assert_eq!(packages_of(Some(&[])), [""; 0]);
        assert_eq!(packages_of(None).len(), UNIT_TESTED.len(), "no git");
        let root = xtask::setup::root();
        assert!(UNIT_TESTED.iter().all(|(_, folder)| root.join(folder).is_dir()));
    }
}
