//! The papers, reproduced: their tables beside ours, each with one command.

mod grasp;

use std::path::PathBuf;

use anyhow::Result;
use clap::Subcommand;

/// Reproduces a paper: its tables beside ours
#[derive(clap::Args)]
pub(crate) struct Papers {
    #[command(subcommand)]
    paper: Paper,
    /// Write the figures as JSON
    #[arg(long, global = true, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Subcommand)]
enum Paper {
    Grasp(grasp::Grasp),
}

impl Papers {
    pub(crate) fn run(&self) -> Result<()> {
        match &self.paper {
            Paper::Grasp(grasp) => grasp.run(self.json.as_deref()),
        }
    }
}
