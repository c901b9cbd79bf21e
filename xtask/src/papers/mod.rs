//! The papers' tables and figures again, ours beside theirs, one file each.

mod memr;

use std::path::PathBuf;

use anyhow::Result;

/// Repeats the tables and figures of a paper, and prints them beside the goals
#[derive(clap::Args)]
pub(crate) struct Papers {
    #[command(subcommand)]
    paper: Paper,
    /// Write the figures as JSON
    #[arg(long, global = true, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(clap::Subcommand)]
enum Paper {
    Memr(memr::Memr),
}

impl Papers {
    pub(crate) fn run(&self) -> Result<()> {
        match &self.paper {
            Paper::Memr(memr) => memr.run(self.json.as_deref()),
        }
    }
}
