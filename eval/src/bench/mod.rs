//! Measurements, one file each; each prints its figures beside the goals.

mod better_words;
mod chip;
pub(crate) mod draws;
mod far_frames;
mod foreign;
mod generated;
mod map;
mod measured;
mod peers;
mod reach;
mod replan;
mod stamps;
mod synthesis_sweep;
mod upload;

use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};
use darm_figures::figure::{Figure, Figures};
use darm_figures::items::{self, Job, Spread};

pub(crate) use far_frames::FarFrames;
pub(crate) use reach::Reach;
pub(crate) use synthesis_sweep::SynthesisSweep;

/// Measures, and prints a table beside the goals
#[derive(clap::Args)]
pub(crate) struct Bench {
    #[command(flatten)]
    selection: Selection,
    /// A folder with measured data that may not be copied into this project
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    #[command(flatten)]
    spread: Spread,
}

/// What to measure.
#[derive(clap::Args)]
#[group(required = true, multiple = true)]
struct Selection {
    /// Instruction counts and sizes of the firmware
    #[arg(long)]
    chip: bool,
    /// What can be proved of the image that is flashed: stack, static RAM, panics
    #[arg(long)]
    image: bool,
    /// How fast a table gets to the board over a serial line with delay and losses, in virtual time
    #[arg(long)]
    upload: bool,
    /// Kinematics and dynamics beside Pinocchio and the crate `k`: what they take is built once, in minutes
    #[arg(long)]
    peers: bool,
    /// Generated Rust beside the C that CasADi makes for the same robots, in a virtual environment of Python that is made
    /// where it is missing
    #[arg(long)]
    generated: bool,
    /// In how many of 200 draws a synthesis is exact, as the desired frames move away
    #[arg(long)]
    synthesis_sweep: bool,
    /// Whether a synthesis solves what any of 1000 starts solves and keeps bounds and words, in 1000 draws of far frames
    #[arg(long)]
    far_frames: bool,
    /// The exact nearest word out of 64^6: time and memory, beside a beam search and a genetic algorithm
    #[arg(long)]
    reach: bool,
    /// What better words alone can do for an arm with one wrong stroke: 4096 words beside 64^6, poses beside positions
    #[arg(long)]
    better_words: bool,
    /// The density of frames beside enumeration and beside random words
    #[arg(long)]
    map: bool,
    /// Real measurements: the error of each set before and after a diagnosis
    #[arg(long)]
    measured: bool,
    /// The same sets with stamps that are off, rounded or lost, beside the sets as they are
    #[arg(long)]
    stamps: bool,
    /// Robot files of published packages beside Pinocchio and MuJoCo, in a virtual environment of Python that is made in
    /// this folder where it is missing
    #[arg(long, value_name = "FOLDER")]
    foreign: Option<PathBuf>,
}

/// Seed of the arms and targets that a measurement draws.
const SEED: u64 = 1;

impl Bench {
    pub(crate) fn run(&self) -> Result<()> {
        if self.spread.is_used() {
            return self.spread_out();
        }
        let mut figures = Vec::new();
        if self.selection.chip {
            figures.extend(chip::measure()?);
        }
        if self.selection.image {
            for (name, value, unit) in xtask::image::figures()? {
                figures.push(Figure::new(&name, value, unit)?);
            }
        }
        if self.selection.upload {
            figures.extend(upload::measure()?);
        }
        if self.selection.measured {
            figures.extend(measured::measure(self.data.as_deref())?);
        }
        if self.selection.stamps {
            figures.extend(stamps::measure(self.data.as_deref())?);
        }
        if self.selection.peers {
            figures.extend(peers::measure()?);
        }
        if self.selection.generated {
            figures.extend(generated::measure()?);
        }
        if self.selection.synthesis_sweep {
            figures.extend(figures_of(&SynthesisSweep {})?);
        }
        if self.selection.far_frames {
            figures.extend(figures_of(&FarFrames {})?);
        }
        if self.selection.reach {
            figures.extend(figures_of(&Reach { seed: SEED })?);
        }
        if self.selection.better_words {
            figures.extend(better_words::measure(SEED)?);
        }
        if self.selection.map {
            figures.extend(map::measure(SEED)?);
        }
        if let Some(folder) = &self.selection.foreign {
            figures.extend(foreign::measure(folder)?);
        }
        Figures::new(figures, SEED).report(self.spread.json.as_deref())
    }

    /// One measurement that is a list of items, over several processes.
    fn spread_out(&self) -> Result<()> {
        let Selection {
            chip,
            image,
            upload,
            peers,
            generated,
            synthesis_sweep,
            far_frames,
            reach,
            better_words,
            map,
            measured,
            stamps,
            ref foreign,
        } = self.selection;
        let others = chip
            || image
            || upload
            || peers
            || generated
            || better_words
            || map
            || measured
            || stamps
            || foreign.is_some();
        match (synthesis_sweep, far_frames, reach) {
            (true, false, false) if !others => items::run(&SynthesisSweep {}, &self.spread),
            (false, true, false) if !others => items::run(&FarFrames {}, &self.spread),
            (false, false, true) if !others => items::run(&Reach { seed: SEED }, &self.spread),
            _ => {
                bail!("--shard and --results need one of --synthesis-sweep, --far-frames and --reach, and nothing else")
            }
        }
    }
}

/// The figures of a list of items, all run here.
fn figures_of<J: Job>(job: &J) -> Result<Vec<Figure>> {
    let all = items::outcomes(job, &Spread::default())?;
    job.figures(&all.context("a launcher has started several processes: name one measurement and --results FILE")?)
}
