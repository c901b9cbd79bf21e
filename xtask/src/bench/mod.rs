//! Measurements, one file each; each prints its figures beside the goals.

mod chip;
mod map;
mod reach;

use std::path::PathBuf;

use anyhow::Result;

use crate::figures::tell;

/// Measures, and prints a table beside the goals
#[derive(clap::Args)]
pub(crate) struct Bench {
    #[command(flatten)]
    what: What,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What to measure.
#[derive(clap::Args)]
#[group(required = true, multiple = true)]
struct What {
    /// Instruction counts and sizes of the firmware
    #[arg(long)]
    chip: bool,
    /// The exact nearest word out of 64^6: time and memory, beside a beam search and a genetic algorithm
    #[arg(long)]
    reach: bool,
    /// The density of frames beside enumeration and beside random words
    #[arg(long)]
    map: bool,
}

/// Seed of the arms and targets that a measurement draws.
const SEED: u64 = 1;

impl Bench {
    pub(crate) fn run(&self) -> Result<()> {
        let mut figures = Vec::new();
        if self.what.chip {
            figures.extend(chip::measure()?);
        }
        if self.what.reach {
            figures.extend(reach::measure(SEED)?);
        }
        if self.what.map {
            figures.extend(map::measure(SEED)?);
        }
        tell(&figures, SEED, self.json.as_deref())
    }
}
