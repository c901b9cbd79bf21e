//! The papers: each by its own method, with its settings and tables, ours beside theirs.

mod grasp;
mod memr;
mod stand;

use std::path::PathBuf;

use anyhow::Result;

/// Reproduces a paper, and prints its tables, ours beside theirs
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
    Grasp(grasp::Grasp),
    Memr(memr::Memr),
    Stand(stand::Stand),
}

impl Papers {
    pub(crate) fn run(&self) -> Result<()> {
        let json = self.json.as_deref();
        match &self.paper {
            Paper::Grasp(grasp) => grasp.run(json),
            Paper::Memr(memr) => memr.run(json),
            Paper::Stand(stand) => stand.run(json),
        }
    }
}
