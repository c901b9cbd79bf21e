//! `cargo xtask papers lecture`: differential kinematics and dynamics, every equation and picture of the lecture.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context as _, Result};
use darm_figures::figure::{Figure, Figures};
use darm_papers::lecture::{self, Row, pictures};
use darm_robot::dh;
use xtask::setup;

/// Differential kinematics and dynamics: every equation of the lecture beside ours
#[derive(clap::Args)]
pub(crate) struct Lecture {
    /// Seed of the postures
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder of the pictures
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl Lecture {
    pub(crate) fn run(&self) -> Result<()> {
        let root = setup::root();
        let folder = self.output.clone().unwrap_or_else(|| root.join("target/papers/lecture"));
        fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
        let puma = dh::read(&root.join("examples/puma560.toml"))?;
        let rows = lecture::rows([&puma, &lecture::sliding_arm()], self.seed)?;
        for (name, svg) in pictures::all(&puma, self.seed)? {
            let path = folder.join(name);
            fs::write(&path, svg).with_context(|| format!("{} cannot be written", path.display()))?;
        }
        let figure = |row: &Row| Figure::new(&format!("lecture: {}: {}", row.section, row.what), row.value, row.unit);
        let figures = rows.iter().map(figure).collect::<Result<Vec<_>>>()?;
        println!(
            "Largest differences between the lecture's equations and ours, 1000 postures each; pictures: {}\n",
            folder.display()
        );
        Figures::new(figures, self.seed).report(self.json.as_deref())
    }
}
