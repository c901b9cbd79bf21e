//! `darm bench-ik`: methods of inverse kinematics side by side, many runs each.

use std::path::PathBuf;

use anyhow::Context as _;
use darm_papers::convergence::{Runs, bands};
use darm_papers::memr::{self, CELLS, Repeated};
use darm_robot::ik::search::Settings;
use darm_robot::ik::trials::{Summary, Trials};
use darm_robot::ik::{Method, Options};
use darm_robot::robot::planar::planar_arm;
use darm_robot::robot::{Robot, RobotFrame};
use serde::Serialize;

use super::ik::Target;
use super::subject::{Given, frame_of};
use crate::failure::Usage;
use crate::voice::{Answer, Voice, columns};

const EXAMPLES: &str = "\
Examples:
  darm bench-ik                                              the tables of the paper on MEMR, its figures beside ours
  darm bench-ik --link 200 --figures plots                   the links that it prints, too short for three targets
  darm bench-ik panda.urdf --frame panda_hand_tcp --lock panda_finger_joint1=0 --lock panda_finger_joint2=0 \\
                --to 450,0,400 --angles 180,0,0 --plot panda.svg
  darm bench-ik --planar 300,300,300 --to 500,400,0 --methods lm,memr --runs 50

A linearisation of n joints counts as 1 + n evaluations. Take lm; the others are there to be compared with.";

/// Compare methods of inverse kinematics over many runs; the paper on MEMR without a robot
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct BenchIk {
    /// Robot as URDF, or table of Denavit and Hartenberg
    #[arg(value_name = "ROBOT", requires = "to")]
    robot: Option<PathBuf>,
    /// An arm in the plane instead: lengths of its links, mm; its joints turn by 180 deg both ways
    #[arg(long, value_name = "MM,MM,…", conflicts_with = "robot", requires = "to", value_delimiter = ',')]
    planar: Vec<f64>,
    /// Position of the frame in the base, mm
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    to: Option<String>,
    /// Its orientation: angles about z, the new y, the newest x, deg; any without it
    #[arg(long, value_name = "Z,Y,X", allow_hyphen_values = true, requires = "to")]
    angles: Option<String>,
    /// Frame of the robot: the name of a link
    #[arg(long, value_name = "LINK", requires = "robot")]
    frame: Option<String>,
    /// Hold a joint of a URDF at a position, as if it were fixed
    #[arg(long = "lock", value_name = "JOINT=Q", allow_hyphen_values = true, requires = "robot")]
    locks: Vec<String>,
    /// Methods: those of `darm ik --method`
    #[arg(long, value_delimiter = ',', default_value = "lm,em,memr,ga,de,cma-es", requires = "to")]
    methods: Vec<Method>,
    /// Runs of each method
    #[arg(long, value_name = "N", default_value_t = memr::RUNS as u32, value_parser = up_to(1, 100_000))]
    runs: u32,
    /// Iterations of a population
    #[arg(long, value_name = "N", default_value_t = 1000, requires = "to", value_parser = up_to(0, 10_000_000))]
    iterations: u32,
    /// Points of a population
    #[arg(long, value_name = "N", default_value_t = 50, requires = "to", value_parser = up_to(4, 10_000))]
    population: u32,
    /// How much worse than the record a neighbour of MEMR may be, mm
    #[arg(long, value_name = "MM", default_value_t = 20.0, requires = "to")]
    deviation: f64,
    /// Begin no iteration after so many evaluations
    #[arg(long, value_name = "N", requires = "to")]
    evaluations: Option<usize>,
    /// Nearer than this a target counts as met, mm
    #[arg(long, value_name = "MM", default_value_t = 1e-9, requires = "to")]
    tolerance: f64,
    /// Seed of the first run
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Length of the links of the paper's arm, mm: it prints 200
    #[arg(long, value_name = "MM", default_value_t = 1e3 * memr::LINK_M, conflicts_with = "to")]
    link: f64,
    /// Write Figures 8 to 11 of the paper into this folder
    #[arg(long, value_name = "DIR", conflicts_with = "to")]
    figures: Option<PathBuf>,
    /// How the error falls, mean and band of eight tenths of the runs
    #[arg(long, value_name = "FILE.svg", requires = "to")]
    plot: Option<PathBuf>,
}

/// Numbers that a machine can bear.
fn up_to(least: i64, most: i64) -> clap::builder::RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(least..=most)
}

#[derive(Serialize)]
struct Compared {
    name: String,
    frame: String,
    runs: u32,
    tolerance_m: f64,
    methods: Vec<Line>,
}

/// One method.
#[derive(Serialize)]
struct Line {
    method: &'static str,
    /// Runs that came within the tolerance.
    met: usize,
    #[serde(flatten)]
    summary: Summary,
}

#[derive(Serialize)]
struct Tables {
    link_m: f64,
    runs: u32,
    cells: Vec<TableCell>,
    #[serde(skip)]
    text: String,
}

/// One cell of the paper's tables, in its unit.
#[derive(Serialize)]
struct TableCell {
    table: u8,
    problem: String,
    algorithm: &'static str,
    best: f64,
    mean: f64,
    deviation: f64,
    printed: Vec<f64>,
    short_cm: f64,
}

impl BenchIk {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        match &self.to {
            Some(to) => self.compare(to, voice),
            None => self.paper(voice),
        }
    }

    fn arm(&self) -> anyhow::Result<(Robot, RobotFrame)> {
        if let Some(wrong) = self.planar.iter().find(|length| !(length.is_finite() && **length >= 0.0)) {
            return Err(Usage(format!("--planar: {wrong} mm is no length")).into());
        }
        if let Some(file) = &self.robot {
            let locks = self.locks.clone();
            let given = Given { file: file.clone(), q: None, word: None, postures: None, locks, floating: false };
            let robot = given.subject()?.into_robot("bench-ik")?;
            let frame = frame_of(&robot, self.frame.as_deref())?.clone();
            return Ok((robot, frame));
        }
        let lengths: Vec<_> = self.planar.iter().map(|length| 1e-3 * length).collect();
        if lengths.is_empty() {
            return Err(Usage("name a robot, or the links of an arm in the plane: --planar 300,300,300".into()).into());
        }
        let pi = std::f64::consts::PI;
        Ok(planar_arm(&lengths, &vec![[-pi, pi]; lengths.len()]))
    }

    fn compare(&self, to: &str, voice: Voice) -> anyhow::Result<()> {
        let (robot, frame) = self.arm()?;
        let target = Target::typed(to, self.angles.as_deref())?;
        let tolerance_m = 1e-3 * self.tolerance;
        let default = Options::default();
        let options = Options {
            position_m: tolerance_m,
            orientation_rad: if target.is_oriented { tolerance_m / default.length_scale_m } else { f64::INFINITY },
            ..default
        };
        let settings = Settings {
            population: self.population as usize,
            iterations: self.iterations as usize,
            deviation: 1e-3 * self.deviation,
            evaluations: self.evaluations.unwrap_or(usize::MAX),
            seed: self.seed,
            ..Settings::default()
        };
        let bar = voice.bar("comparing", self.methods.len() as u64, "methods");
        let mut all: Vec<(Method, Trials)> = Vec::new();
        for method in &self.methods {
            let options = Options { steps: method.usual_steps(), ..options };
            all.push((*method, robot.trials(*method, &frame, &target.pose, &options, &settings, self.runs as usize)?));
            bar.inc(1);
        }
        bar.finish_and_clear();
        if let Some(path) = &self.plot {
            let runs = all.iter().map(|(method, trials)| Runs { name: method.name(), trials, beside: None });
            let svg = bands("error, mm", 1e3, &runs.collect::<Vec<_>>());
            std::fs::write(path, svg).with_context(|| format!("cannot write {}", path.display()))?;
        }
        // The value of a pose is the root of two squares, each within its tolerance.
        let bound = if target.is_oriented { std::f64::consts::SQRT_2 * tolerance_m } else { tolerance_m };
        let line = |(method, trials): &(Method, Trials)| Line {
            method: method.name(),
            met: trials.within(bound),
            summary: trials.summary(),
        };
        let methods = all.iter().map(line).collect();
        voice.tell(&Compared { name: robot.name, frame: frame.name, runs: self.runs, tolerance_m, methods })
    }

    fn paper(&self, voice: Voice) -> anyhow::Result<()> {
        if !(self.link.is_finite() && self.link > 0.0) {
            return Err(Usage(format!("--link {}: a length above zero is needed", self.link)).into());
        }
        let link_m = 1e-3 * self.link;
        let bar = voice.bar("repeating the paper", CELLS.len() as u64, "cells");
        let mut repeated = Vec::new();
        for cell in &CELLS {
            repeated.push(Repeated::new(cell, link_m, self.runs as usize, self.seed)?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        if let Some(folder) = &self.figures {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
            for (file, svg) in memr::figures(&repeated) {
                let path = folder.join(file);
                std::fs::write(&path, svg).with_context(|| format!("cannot write {}", path.display()))?;
            }
        }
        let cells = repeated.iter().map(TableCell::from).collect();
        voice.tell(&Tables { link_m, runs: self.runs, cells, text: memr::text(&repeated) })
    }
}

impl From<&Repeated> for TableCell {
    fn from(repeated: &Repeated) -> Self {
        let Repeated { cell, trials, short_cm } = repeated;
        let (summary, factor) = (trials.summary(), cell.problem.factor());
        Self {
            table: cell.table,
            problem: cell.problem.name(),
            algorithm: memr::printed_name(cell.algorithm),
            best: factor * summary.best,
            mean: factor * summary.mean,
            deviation: factor * summary.deviation,
            printed: match cell.printed {
                memr::Printed::Best { value, deviation } => vec![value, deviation],
                memr::Printed::Runs(errors) => errors.to_vec(),
            },
            short_cm: *short_cm,
        }
    }
}

impl Answer for Compared {
    fn text(&self) -> String {
        let head =
            ["method", "met", "best, mm", "median, mm", "mean, mm", "s.d., mm", "worst, mm", "evaluations", "ms"];
        let rows = self.methods.iter().map(|line| {
            let Summary { best, median, mean, deviation, worst, evaluations, time_s } = line.summary;
            let errors = [best, median, mean, deviation, worst].map(|value| format!("{:.2e}", 1e3 * value));
            let met = [line.method.to_owned(), format!("{} of {}", line.met, self.runs)];
            met.into_iter().chain(errors).chain([format!("{evaluations:.0}"), format!("{:.3}", 1e3 * time_s)]).collect()
        });
        columns(&std::iter::once(head.map(str::to_owned).to_vec()).chain(rows).collect::<Vec<_>>())
    }
}

impl Answer for Tables {
    fn text(&self) -> String {
        let link = 100.0 * self.link_m;
        format!("links of {link} cm, {} runs\n{}", self.runs, self.text.trim_end())
    }
}
