//! Hostile runs: power cuts in the emulator, damaged frames and lines on the PC, a port that another program holds. The tests run them short, this runs them long.

use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result, bail};

use crate::figures::{Figure, tell};
use xtask::image;
use xtask::setup::{self, Emulator};
use xtask::step;

const BUILD_LIMIT: Duration = Duration::from_secs(1800);

/// Cuts the power at seeded moments, sends damaged frames, stops through a port that is held; prints the counts
#[derive(clap::Args)]
pub(crate) struct Faults {
    /// Kill the emulator so many times during uploads and stores, and start it again on the same flash
    #[arg(long, value_name = "COUNT")]
    kills: Option<u64>,
    /// Send so many random and mutated frames and lines to the decoder and the dispatcher
    #[arg(long, value_name = "COUNT")]
    frames: Option<u64>,
    /// Stop the arm so many times while another program holds the port
    #[arg(long, value_name = "COUNT")]
    stops: Option<u64>,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl Faults {
    pub(crate) fn run(&self) -> Result<()> {
        if self.kills.or(self.frames).or(self.stops).is_none() {
            bail!("nothing to do: give --kills COUNT, --frames COUNT or --stops COUNT");
        }
        let mut figures = Vec::new();
        if let Some(kills) = self.kills {
            prepare_emulator()?;
            let arguments = ["--package", "darm-tests", "--test", "qemu", "power_cuts"];
            figures.extend(run_test(&arguments, "DARM_KILLS", kills)?);
        }
        if let Some(frames) = self.frames {
            let arguments = ["--package", "darm-firmware", "--lib", "frames"];
            figures.extend(run_test(&arguments, "DARM_FRAMES", frames)?);
        }
        if let Some(stops) = self.stops {
            prepare_emulator()?;
            let mut build = Command::new("cargo");
            build.current_dir(setup::root()).args(["build", "--package", "darm"]);
            step::run("build darm", &mut build, BUILD_LIMIT, "run `cargo build --package darm`")?;
            let arguments = ["--package", "darm-tests", "--test", "stop"];
            figures.extend(run_test(&arguments, "DARM_STOPS", stops)?);
        }
        tell(&figures, 1, self.json.as_deref())
    }
}

fn prepare_emulator() -> Result<()> {
    if let Emulator::Absent(why) = setup::emulator() {
        bail!("this runs in the emulator, and there is none: {why}");
    }
    image::build().map(|_| ())
}

/// Runs a test at length; its figures stand in lines `FIGURE name = value unit`.
fn run_test(arguments: &[&str], variable: &str, count: u64) -> Result<Vec<Figure>> {
    let mut command = Command::new("cargo");
    command.current_dir(setup::root()).arg("test").args(arguments).args(["--", "--nocapture"]);
    let output = command.env(variable, count.to_string()).output().context("cargo did not start")?;
    let text = String::from_utf8_lossy(&output.stdout);
    if !output.status.success() {
        bail!("the run failed:\n{text}\n{}", String::from_utf8_lossy(&output.stderr));
    }
    let figures = text.lines().filter_map(|line| line.split_once("FIGURE ")).map(|(_, figure)| {
        let (name, value) = figure.split_once(" = ").context("a figure without a value")?;
        let (value, unit) = value.split_once(' ').context("a figure without a unit")?;
        Figure::new(name, value.parse().context("a figure that is no number")?, unit)
    });
    figures.collect()
}
