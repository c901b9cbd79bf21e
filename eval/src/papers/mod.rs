//! The papers: each by its own method, with its settings and tables, ours beside theirs.

mod darm;
mod grasp;
mod lecture;
mod memr;
mod sit_to_stand;

use anyhow::Result;
use darm_figures::items::{self, Spread};

pub(crate) use darm::Darm;
pub(crate) use grasp::Grasp;
use lecture::Lecture;
pub(crate) use memr::Memr;
use sit_to_stand::SitToStand;

/// Reproduces a paper, and prints its tables, ours beside theirs
#[derive(clap::Args)]
pub(crate) struct Papers {
    #[command(subcommand)]
    paper: Paper,
}

#[derive(clap::Subcommand)]
enum Paper {
    Darm(Spreadable<Darm>),
    Grasp(Spreadable<Grasp>),
    Lecture(Lecture),
    Memr(Spreadable<Memr>),
    #[command(name = "stand")]
    SitToStand(SitToStand),
}

/// A paper whose runs several processes can share.
#[derive(clap::Args)]
struct Spreadable<J: clap::Args> {
    #[command(flatten)]
    job: J,
    #[command(flatten)]
    spread: Spread,
}

impl Papers {
    pub(crate) fn run(&self) -> Result<()> {
        match &self.paper {
            Paper::Darm(darm) => items::run(&darm.job, &darm.spread),
            Paper::Grasp(grasp) => items::run(&grasp.job, &grasp.spread),
            Paper::Lecture(lecture) => lecture.run(),
            Paper::Memr(memr) => items::run(&memr.job, &memr.spread),
            Paper::SitToStand(sit_to_stand) => sit_to_stand.run(),
        }
    }
}
