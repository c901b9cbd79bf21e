//! The papers: each by its own method, with its settings and tables, ours beside theirs.

mod stand;

use std::path::PathBuf;

use anyhow::Result;
use clap::Subcommand;

/// Reproduces a paper, and prints its tables, ours beside theirs
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
    Stand(stand::Stand),
}

impl Papers {
    pub(crate) fn run(&self) -> Result<()> {
        match &self.paper {
            Paper::Stand(stand) => stand.run(self.json.as_deref()),
        }
    }
}
