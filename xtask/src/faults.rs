//! Hostile runs: power cuts in the emulator, damaged frames and lines on the PC. The tests run them short, this runs them long.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::figures::{Figure, tell};
use crate::image;
use crate::setup::{self, Emulator};

/// Cuts the power at seeded moments, sends damaged frames; prints the counts
#[derive(clap::Args)]
pub(crate) struct Faults {
    /// Kill the emulator so many times during uploads and stores, and start it again on the same flash
    #[arg(long, value_name = "COUNT")]
    kills: Option<u64>,
    /// Send so many random and mutated frames and lines to the decoder and the dispatcher
    #[arg(long, value_name = "COUNT")]
    frames: Option<u64>,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl Faults {
    pub(crate) fn run(&self) -> Result<()> {
        if self.kills.is_none() && self.frames.is_none() {
            bail!("nothing to do: give --kills COUNT, --frames COUNT or both");
        }
        let mut figures = Vec::new();
        if let Some(kills) = self.kills {
            if let Emulator::Absent(why) = setup::emulator() {
                bail!("power is cut in the emulator, and there is none: {why}");
            }
            image::build()?;
            let arguments = ["--package", "darm-tests", "--test", "qemu", "power_cuts"];
            figures.extend(run_test(&arguments, "DARM_KILLS", kills)?);
        }
        if let Some(frames) = self.frames {
            let arguments = ["--package", "darm-firmware", "--lib", "frames"];
            figures.extend(run_test(&arguments, "DARM_FRAMES", frames)?);
        }
        tell(&figures, 1, self.json.as_deref())
    }
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
