//! The demo: the main job end to end, on the image that is flashed, with a report.

mod conditions;
mod course;
mod measure;
mod report;
mod rig;
mod summary;
mod sweep;
mod task;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::ValueEnum;
use darm_diagnose::truth::Kind;

use darm_figures::items::{self, Spread};
use darm_figures::progress::Progress;
use serde::{Deserialize, Serialize};

use course::Keep;
use rig::Rig;
pub use sweep::Sweep;
pub use task::{Design, Task};
use xtask::image;
use xtask::setup::{self, Emulator};

/// The complete loop: synthesis, table, upload, play, measure, diagnose, close; writes a report
#[derive(clap::Args)]
pub struct Demo {
    /// Which arm
    #[arg(long, value_enum, default_value = "planar")]
    arm: ArmKind,
    /// Seed of everything that is drawn: the hidden effect, the noise, the words
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Effect that the true arm hides; default: drawn by the seed
    #[arg(long, value_name = "LAW")]
    effect: Option<Kind>,
    /// Board whose image runs in its emulator
    #[arg(long, value_enum, default_value = "b-l475e-iot01a", conflicts_with = "in_process")]
    board: image::Board,
    /// Run the firmware library in this process, in virtual time, in place of the image in the emulator
    #[arg(long)]
    in_process: bool,
    /// Run the loop for this many seeds in this process, and print one table
    #[arg(long, value_name = "SEEDS")]
    sweep: Option<u64>,
    #[command(flatten)]
    spread: Spread,
    /// Where the report and all files go
    #[arg(long, default_value = "target/demo")]
    out: PathBuf,
}

/// An arm of the demo.
#[derive(Clone, Copy, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ArmKind {
    /// Four planar modules, twelve bits
    Planar,
    /// The same on a servo joint
    Hybrid,
    /// Six spatial modules, 64^6 words: positions, by better words alone
    Spatial6,
}

impl ArmKind {
    fn files(self) -> [PathBuf; 2] {
        let names = match self {
            Self::Planar => ["planar4.toml", "planar4-frames.toml"],
            Self::Hybrid => ["planar4-hybrid.toml", "planar4-hybrid-frames.toml"],
            Self::Spatial6 => ["spatial6.toml", "spatial6-positions.toml"],
        };
        names.map(|name| setup::root().join("examples").join(name))
    }

    /// The task of one seed, with this effect or one that the seed draws.
    ///
    /// # Errors
    ///
    /// A file of the examples cannot be read.
    pub fn task(self, seed: u64, effect: Option<Kind>) -> Result<Task> {
        let [arm, frames] = self.files();
        Task::read(&arm, &frames, seed, effect)
    }
}

impl Demo {
    /// Runs the loop once with a report, or for many seeds with a table.
    ///
    /// # Errors
    ///
    /// The image does not build, a step of the loop fails, or a file cannot be written.
    pub fn run(&self) -> Result<()> {
        match self.sweep {
            Some(seeds) => items::run(&Sweep { seeds, arm: self.arm, effect: self.effect }, &self.spread),
            None if self.spread.is_used() || self.spread.json.is_some() => {
                bail!("one seed has no figures; add --sweep SEEDS")
            }
            None => self.once(),
        }
    }

    /// One course on the emulated board, with a report.
    fn once(&self) -> Result<()> {
        let emulated = if self.in_process { None } else { emulated_image(self.board)? };
        fs::create_dir_all(&self.out).with_context(|| format!("{} cannot be made", self.out.display()))?;
        let progress = Progress::shown();
        let task = self.arm.task(self.seed, self.effect)?;
        if !task.is_for_positions() {
            progress.say("synthesis");
        }
        let design = task.design()?;
        let mut rig = match emulated {
            Some(elf) if self.board == image::Board::Pico => Rig::pico(&elf, &self.out, &design.arm)?,
            Some(elf) => Rig::emulated(elf, &self.out, &design.arm)?,
            None => Rig::in_process(&design.arm)?,
        };
        progress.say(format!("board: {}, device {}", rig.what, rig.client.identity().device));
        let mut keep = |name: &str, what: Keep| keep(&self.out.join(name), what);
        let course = course::run(&task, design, &mut rig, &progress, &mut keep)?;
        let report = summary::report(&task, course, &rig.what, progress.elapsed_s())?;
        report.write(&self.out).with_context(|| format!("{} cannot be written", self.out.display()))?;
        println!("{}", report::table(&report));
        progress.say(format!("report: {}", self.out.join("report.html").display()));
        Ok(())
    }
}

/// The image for the emulator; `None` on a machine that has no emulator and cannot get one.
fn emulated_image(board: image::Board) -> Result<Option<PathBuf>> {
    match board.emulator() {
        Emulator::Ready => image::build_for(board).map(Some),
        Emulator::Absent(why) => {
            eprintln!("NO EMULATOR: the firmware's library runs in this process instead. {why}");
            Ok(None)
        }
    }
}

fn keep(path: &Path, what: Keep) -> Result<()> {
    let text = match what {
        Keep::Run(run) => darm_measure::write_text(run),
        Keep::Diagnosis(diagnosis) => serde_json::to_string_pretty(diagnosis)?,
        Keep::Arm(arm) => return Ok(arm.write(path)?),
    };
    fs::write(path, text).with_context(|| format!("{} cannot be written", path.display()))
}
