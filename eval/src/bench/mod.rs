//! Measurements, one file each; each prints its figures beside the goals.

mod chip;
mod map;
mod measured;
mod peers;
mod reach;
mod replan;
mod synthesis;
mod synthesis_sweep;

use std::path::PathBuf;

use anyhow::Result;

use crate::figures::tell;

/// Measures, and prints a table beside the goals
#[derive(clap::Args)]
pub(crate) struct Bench {
    #[command(flatten)]
    what: What,
    /// A folder with measured data that may not be copied into this project
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
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
    /// Kinematics and dynamics beside Pinocchio and the crate `k`: what they take is built once, in minutes
    #[arg(long)]
    peers: bool,
    /// The examples of the synthesis paper, by its method and by ours
    #[arg(long)]
    synthesis: bool,
    /// In how many of 200 draws a synthesis is exact, as the desired frames move away
    #[arg(long)]
    synthesis_sweep: bool,
    /// The exact nearest word out of 64^6: time and memory, beside a beam search and a genetic algorithm
    #[arg(long)]
    reach: bool,
    /// The density of frames beside enumeration and beside random words
    #[arg(long)]
    map: bool,
    /// Real measurements: the error of each set before and after a diagnosis
    #[arg(long)]
    measured: bool,
}

/// Seed of the arms and targets that a measurement draws.
const SEED: u64 = 1;

impl Bench {
    pub(crate) fn run(&self) -> Result<()> {
        let mut figures = Vec::new();
        if self.what.chip {
            figures.extend(chip::measure()?);
        }
        if self.what.measured {
            figures.extend(measured::measure(self.data.as_deref())?);
        }
        if self.what.peers {
            figures.extend(peers::measure()?);
        }
        if self.what.synthesis {
            figures.extend(synthesis::measure()?);
        }
        if self.what.synthesis_sweep {
            figures.extend(synthesis_sweep::measure()?);
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
