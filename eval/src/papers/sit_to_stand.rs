//! `cargo xtask papers stand`: sit-to-stand on a humanoid robot from human demonstration.
//!
//! The robot is the planar one of five links (`tests/data/urdf/planar5.urdf`, 88 postures of the golden data): the paper gives
//! no masses. What is missing in its CAD data is drawn here: a backpack and hoses.

mod arm_rests;
mod capture;
mod figure;
mod hidden;
mod motions;
mod postures;
mod robots;
mod sequences;

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};
use darm_arm::draw::page::page;
use maud::html;

use motions::Study;

use darm_figures::figure::Figures;
use darm_figures::progress::Progress;
use xtask::setup;

/// Seed of all that is drawn.
const SEED: u64 = 1;

/// Sit-to-stand: identification, an undeclared mass, motion mapping
#[derive(clap::Args)]
pub(crate) struct SitToStand {
    /// Seed of noise, masses and people
    #[arg(long, default_value_t = SEED)]
    seed: u64,
    /// Robots with an undeclared mass, and as many complete ones
    #[arg(long, default_value_t = 100)]
    robots: u64,
    /// Robots of other masses that stand up
    #[arg(long, default_value_t = 20)]
    standing: u64,
    /// Folder of the report and of the tables that `darm com` reads
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl SitToStand {
    pub(crate) fn run(&self) -> Result<()> {
        let progress = Progress::shown();
        let folder = self.output.clone().unwrap_or_else(|| setup::root().join("target/papers/stand"));
        fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
        let mut figures = Vec::new();
        progress.say("identification from 88 postures");
        let robots = postures::identify(&mut figures, self.seed, &folder)?;
        progress.say("identification from motions, with friction");
        postures::from_motions(&mut figures, &robots, self.seed)?;
        progress.say(format!("{} robots with an undeclared mass, {} complete ones", self.robots, self.robots));
        hidden::search(&mut figures, &progress, self.robots, self.seed)?;
        progress.say("a person on a force plate");
        hidden::person(&mut figures)?;
        progress.say(format!("two motions on the robot, and on {} of other masses", self.standing));
        let drawn = robots::draw(&robots.cad, self.standing.max(1), self.seed)?;
        let study = Study { robots: &robots, drawn: &drawn, seed: self.seed, folder: &folder };
        let pictures = motions::map_both(&mut figures, &progress, &study)?;
        let body = html! { @for (title, svg) in &pictures { section { h2 { (title) } (maud::PreEscaped(svg)) } } };
        fs::write(folder.join("report.html"), page("Sit to stand", &body))?;
        progress.say(format!("pictures and tables are in {}", folder.display()));
        println!(
            "\nThe paper has one figure: 19.6 mm RMS of the centre of pressure on 9 of 88 postures. Sensor noise alone makes"
        );
        println!("2 mm of it: the rest was posture, play and elasticity of that robot, which nothing here can know.\n");
        Figures::new(figures, self.seed).report(self.json.as_deref())
    }
}
