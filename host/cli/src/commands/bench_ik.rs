//! `darm bench-ik`: benchmark of methods of inverse kinematics.

use std::path::PathBuf;

use anyhow::Context as _;
use darm_papers::convergence::{Runs, bands};
use darm_papers::memr::{self, CELLS, Repeated};
use darm_robot::ik::search::Settings;
use darm_robot::ik::trials::{Experiment, Summary, Trials};
use darm_robot::ik::{Method, Options};
use darm_robot::robot::planar::planar_arm;
use darm_robot::robot::{Robot, RobotFrame};
use serde::Serialize;

use super::ik::{OrientationArgs, Target};
use super::subject::{SubjectArgs, frame_of};
use crate::failure::Usage;
use crate::output_file::{self, Syntax};
use crate::overwrite::OutputFile;
use crate::ui::{Answer, Ui, columns};

const EXAMPLES: &str = "\
Examples:
  darm bench-ik --runs 2                             # the tables of the MEMR paper and ours
  darm bench-ik --runs 2 --link 200 --plot plots     # with the link length that the paper prints
  darm bench-ik puma560.toml --to 400,150,900 --runs 3 --iterations 100 --plot puma560.svg
  darm bench-ik --planar 300,300,300 --to 500,400,0 --methods lm,memr --runs 10

A linearisation of n joints counts as 1 + n evaluations. Use lm; the other methods are for comparison.";

/// Benchmark IK methods; without ROBOT, reproduce the MEMR paper
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct BenchIk {
    /// Robot as URDF or MJCF, or Denavit-Hartenberg table
    #[arg(value_name = "ROBOT", requires = "to")]
    robot: Option<PathBuf>,
    /// Planar arm instead of a file: lengths of its links, mm; joint limits of ±180 deg
    #[arg(long, value_name = "MM,MM,…", conflicts_with = "robot", requires = "to", value_delimiter = ',')]
    planar: Vec<f64>,
    /// Position of the frame in the base, mm
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    to: Option<String>,
    #[command(flatten)]
    orientation: OrientationArgs,
    /// Frame of the robot: the name of a link
    #[arg(long, value_name = "LINK", requires = "robot")]
    frame: Option<String>,
    /// Fix a joint of a robot at a position, in deg or mm
    #[arg(long = "lock", value_name = "JOINT=Q", allow_hyphen_values = true, requires = "robot")]
    locks: Vec<String>,
    /// Read one tree of a URDF or MJCF: the one that begins with this link or body
    #[arg(long, value_name = "BODY")]
    root: Option<String>,
    /// Methods, as of `darm ik --method`
    #[arg(long, value_delimiter = ',', default_value = "lm,em,memr,ga,de,cma-es", requires = "to")]
    methods: Vec<Method>,
    /// Runs of each method
    #[arg(long, value_name = "N", default_value_t = memr::RUNS as u32, value_parser = up_to(1, 100_000))]
    runs: u32,
    /// Iterations of a population method
    #[arg(long, value_name = "N", default_value_t = 1000, requires = "to", value_parser = up_to(0, 10_000_000))]
    iterations: u32,
    /// Population size
    #[arg(long, value_name = "N", default_value_t = 50, requires = "to", value_parser = up_to(4, 10_000))]
    population: u32,
    /// Deviation of MEMR's record-to-record travel, mm
    #[arg(long, value_name = "MM", default_value_t = 20.0, requires = "to")]
    deviation: f64,
    /// Start no iteration after this number of evaluations
    #[arg(long, value_name = "N", requires = "to")]
    evaluations: Option<usize>,
    /// Position error below which a target counts as reached, mm
    #[arg(long, value_name = "MM", default_value_t = 1e-9, requires = "to")]
    tolerance: f64,
    /// Seed of the first run
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Link length of the paper's arm, mm; the paper prints 200
    #[arg(long, value_name = "MM", default_value_t = 1e3 * memr::LINK_M, conflicts_with = "to")]
    link: f64,
    /// Plot the error, mean and 10th to 90th percentile, as this SVG file; without --to a folder for the paper's Figures 8
    /// to 11
    #[arg(long, value_name = "FILE.svg|FOLDER")]
    plot: Option<OutputFile>,
}

/// Parser of a bounded number.
fn up_to(low: i64, high: i64) -> clap::builder::RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(low..=high)
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
    /// Runs that reached the target.
    reached: usize,
    best_m: f64,
    median_m: f64,
    mean_m: f64,
    /// `None` of a single run.
    deviation_m: Option<f64>,
    worst_m: f64,
    evaluations: f64,
    time_s: f64,
}

#[derive(Serialize)]
struct Tables {
    link_m: f64,
    runs: u32,
    cells: Vec<TableCell>,
    #[serde(skip)]
    text: String,
}

/// One cell of the paper's tables, in the paper's unit.
#[derive(Serialize)]
struct TableCell {
    table: u8,
    problem: String,
    algorithm: &'static str,
    best: f64,
    mean: f64,
    /// `None` of a single run.
    deviation: Option<f64>,
    printed: Vec<f64>,
    shortfall_m: f64,
}

impl BenchIk {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        match &self.to {
            Some(to) => self.compare(to, ui),
            None => self.paper(ui),
        }
    }

    fn arm(&self) -> anyhow::Result<(Robot, RobotFrame)> {
        if let Some(wrong) = self.planar.iter().find(|length| !(length.is_finite() && **length >= 0.0)) {
            return Err(Usage(format!("--planar: {wrong} is not a length in mm; give numbers of at least 0")).into());
        }
        if let Some(file) = &self.robot {
            let (locks, root) = (self.locks.clone(), self.root.clone());
            let given =
                SubjectArgs { file: file.clone(), q: None, word: None, postures: None, locks, root, floating: false };
            let robot = given.subject()?.into_robot("bench-ik")?;
            let frame = frame_of(&robot, self.frame.as_deref())?.clone();
            return Ok((robot, frame));
        }
        let lengths: Vec<_> = self.planar.iter().map(|length| 1e-3 * length).collect();
        if lengths.is_empty() {
            return Err(
                Usage("no robot; name one, or give the links of a planar arm: --planar 300,300,300".into()).into()
            );
        }
        let pi = std::f64::consts::PI;
        Ok(planar_arm(&lengths, &vec![[-pi, pi]; lengths.len()]))
    }

    fn compare(&self, to: &str, ui: Ui) -> anyhow::Result<()> {
        let (robot, frame) = self.arm()?;
        let target = Target::parse(to, &self.orientation)?;
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
        let bar = ui.progress_bar("comparing", self.methods.len() as u64, "methods");
        let mut all: Vec<(Method, Trials)> = Vec::new();
        for method in &self.methods {
            let options = Options { steps: method.usual_steps(), ..options };
            let experiment =
                Experiment { method: *method, options: &options, settings: &settings, runs: self.runs as usize };
            all.push((*method, robot.trials(&frame, &target.pose, &experiment)?));
            bar.inc(1);
        }
        bar.finish_and_clear();
        if let Some(path) = &self.plot {
            let runs = all.iter().map(|(method, trials)| Runs { name: method.name(), trials, compared: None });
            let svg = bands("error, mm", 1e3, &runs.collect::<Vec<_>>());
            output_file::write_text(path, Syntax::Svg, &svg)?;
        }
        // The error of a pose is the root of two squares, each within its tolerance.
        let bound = if target.is_oriented { std::f64::consts::SQRT_2 * tolerance_m } else { tolerance_m };
        let methods = all.iter().map(|(method, trials)| line(*method, trials, bound)).collect();
        ui.print(&Compared { name: robot.name, frame: frame.name, runs: self.runs, tolerance_m, methods })
    }

    fn paper(&self, ui: Ui) -> anyhow::Result<()> {
        if !(self.link.is_finite() && self.link > 0.0) {
            return Err(Usage(format!("--link {}: give a length above 0 mm", self.link)).into());
        }
        let link_m = 1e-3 * self.link;
        let bar = ui.progress_bar("reproducing the paper", CELLS.len() as u64, "cells");
        let mut repeated = Vec::new();
        for cell in &CELLS {
            repeated.push(Repeated::new(cell, link_m, self.runs as usize, self.seed)?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        if let Some(folder) = &self.plot {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("cannot create the folder {}", folder.display()))?;
            for (file, svg) in memr::figures(&repeated) {
                let path = folder.join(file);
                output_file::write_text(&path, Syntax::Svg, &svg)?;
            }
        }
        let cells = repeated.iter().map(TableCell::from).collect();
        ui.print(&Tables { link_m, runs: self.runs, cells, text: memr::text(&repeated) })
    }
}

/// The standard deviation of a single run does not exist.
fn finite(deviation: f64) -> Option<f64> {
    Some(deviation).filter(|deviation| deviation.is_finite())
}

fn line(method: Method, trials: &Trials, bound_m: f64) -> Line {
    let Summary { best, median, mean, deviation, worst, evaluations, time_s } = trials.summary();
    Line {
        method: method.name(),
        reached: trials.within(bound_m),
        best_m: best,
        median_m: median,
        mean_m: mean,
        deviation_m: finite(deviation),
        worst_m: worst,
        evaluations,
        time_s,
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
            deviation: finite(factor * summary.deviation),
            printed: match cell.printed {
                memr::Printed::Best { value, deviation } => vec![value, deviation],
                memr::Printed::Runs(errors) => errors.to_vec(),
            },
            shortfall_m: 1e-2 * short_cm,
        }
    }
}

impl Answer for Compared {
    fn text(&self) -> String {
        let head =
            ["method", "reached", "best, mm", "median, mm", "mean, mm", "s.d., mm", "worst, mm", "evaluations", "ms"];
        let rows = self.methods.iter().map(|line| {
            let errors =
                [Some(line.best_m), Some(line.median_m), Some(line.mean_m), line.deviation_m, Some(line.worst_m)];
            let errors =
                errors.map(|error_m| error_m.map_or("-".to_owned(), |error_m| format!("{:.2e}", 1e3 * error_m)));
            let head = [line.method.to_owned(), format!("{} of {}", line.reached, self.runs)];
            let cost = [format!("{:.0}", line.evaluations), format!("{:.3}", 1e3 * line.time_s)];
            head.into_iter().chain(errors).chain(cost).collect()
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
