//! Inverse kinematics by electromagnetism-like search: Tables 1 to 3, Figures 8 to 11, and the methods that a user
//! should take.

use std::f64::consts::PI;
use std::io::Read as _;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result};
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_papers::convergence;
use darm_papers::memr::{self, CELLS, LINK_M, MET_M, PRINTED_LINK_M, RUNS, Repeated, TARGETS};
use darm_robot::ik::search::{Algorithm, Settings};
use darm_robot::ik::trials::{Summary, Trials};
use darm_robot::ik::{Method, Options, Status};
use darm_robot::robot::Robot;
use darm_robot::robot::planar::planar_arm;
use darm_robot::urdf;

use crate::figures::{Figure, tell};
use crate::progress::Progress;
use xtask::setup;

/// The paper on the electromagnetism-like algorithm with record-to-record travel
#[derive(clap::Args)]
pub(crate) struct Memr {
    /// Seed of the first of the 20 runs of each search
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// What is held beside the paper's methods: the recommended one first.
const METHODS: [Method; 6] = [
    Method::LevenbergMarquardt,
    Method::Population(Algorithm::Em),
    Method::Population(Algorithm::Memr),
    Method::Population(Algorithm::Genetic),
    Method::Population(Algorithm::DifferentialEvolution),
    Method::Population(Algorithm::CmaEs),
];

impl Memr {
    pub(super) fn run(&self, json: Option<&Path>) -> Result<()> {
        let progress = Progress::shown();
        let folder = setup::root().join("target/papers/memr");
        std::fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
        let mut figures = Vec::new();
        for link_m in [PRINTED_LINK_M, LINK_M] {
            progress.say(format!("repeating the tables with links of {} cm", 100.0 * link_m));
            // The functions of Table 1 have no links.
            let cells = CELLS.iter().filter(|cell| cell.table > 1 || link_m == LINK_M);
            let repeat = |cell| Ok(Repeated::new(cell, link_m, RUNS, self.seed)?);
            let repeated: Vec<_> = cells.map(repeat).collect::<Result<_>>()?;
            println!("\nlinks of {} cm, {RUNS} runs{}", 100.0 * link_m, memr::text(&repeated));
            if link_m == LINK_M {
                for (file, svg) in memr::figures(&repeated) {
                    let path = folder.join(file);
                    std::fs::write(&path, svg).with_context(|| format!("{} cannot be written", path.display()))?;
                }
                figures.extend(within(&repeated)?);
            }
        }
        std::fs::write(folder.join("figure-02-configurations.svg"), several()?)?;
        println!("\nFigures 2 and 8 to 11, mean and band of eight tenths of the runs: {}\n", folder.display());
        progress.say("other methods with as many evaluations, and in the same time");
        figures.extend(self.beside()?);
        progress.say("1000 targets of a Panda");
        figures.extend(panda()?);
        tell(&figures, self.seed, json)
    }

    /// Every method on the paper's targets: at MEMR's evaluations, and in MEMR's time.
    fn beside(&self) -> Result<Vec<Figure>> {
        let settings = Settings { seed: self.seed, ..Settings::default() };
        let memr = self.all(Method::Population(Algorithm::Memr), &settings)?;
        let (evaluations, time_s) = (mean(&memr, |summary| summary.evaluations), mean(&memr, |summary| summary.time_s));
        let as_many = Settings { iterations: usize::MAX, evaluations: evaluations as usize, enough: MET_M, ..settings };
        let as_long = Settings { evaluations: usize::MAX, time: Duration::from_secs_f64(time_s), ..as_many };
        let mut figures = Vec::new();
        for (what, settings) in [("as many evaluations", as_many), ("the same time", as_long)] {
            for method in METHODS {
                let all = self.all(method, &settings)?;
                figures.extend(rows(&format!("memr: {method}, {what}"), &all)?);
                if method == Method::LevenbergMarquardt && settings.time == Duration::MAX {
                    let most = all.iter().map(|trials| trials.summary().evaluations).fold(0.0, f64::max);
                    figures.push(Figure::new(
                        "memr: evaluations of lm over MEMR's, worst target",
                        most / evaluations,
                        "",
                    )?);
                }
            }
        }
        Ok(figures)
    }

    /// The runs to each of the five targets.
    fn all(&self, method: Method, settings: &Settings) -> Result<Vec<Trials>> {
        TARGETS.iter().map(|target| Ok(memr::reach(LINK_M, method, *target, settings, RUNS)?)).collect()
    }
}

/// Some of the postures with which an arm of three links reaches one point: Figure 2.
fn several() -> Result<String> {
    let (arm, tip) = planar_arm(&[LINK_M; 3], &[[-PI, PI]; 3]);
    let target = Pose::at(Vec3::new(0.4, 0.3, 0.0));
    let options = Options { orientation_rad: f64::INFINITY, starts: 500, ..Options::default() };
    let found = arm.configurations(&tip, &target, &[], &options, 6)?;
    Ok(convergence::postures(&arm, &tip, &found)?)
}

/// How far our tables lie from the paper's: EMW and MEMR have a goal, GA has none.
fn within(repeated: &[Repeated]) -> Result<Vec<Figure>> {
    let mut figures = Vec::new();
    for repeated in repeated {
        let algorithm = memr::printed_name(repeated.cell.algorithm);
        let name = format!("memr: Table {}, {}, {algorithm}", repeated.cell.table, repeated.cell.problem.name());
        figures.push(Figure::new(&name, repeated.off(), "of spread")?);
        if let Some(count) = repeated.printed_within() {
            figures.push(Figure::new(&format!("{name}: printed runs within ours, of 5"), count as f64, "")?);
        }
    }
    Ok(figures)
}

/// The error of a method over all targets, and how many runs met them.
fn rows(name: &str, all: &[Trials]) -> Result<Vec<Figure>> {
    let mut errors: Vec<_> = all.iter().flat_map(Trials::values).collect();
    errors.sort_by(f64::total_cmp);
    let met: usize = all.iter().map(|trials| trials.within(MET_M)).sum();
    Ok(vec![
        Figure::new(&format!("{name}: met to 1e-10 cm, of {}", errors.len()), met as f64, "")?,
        Figure::new(&format!("{name}: error, median"), 100.0 * errors[errors.len() / 2], "cm")?,
        Figure::new(&format!("{name}: error, largest"), 100.0 * errors[errors.len() - 1], "cm")?,
        Figure::new(&format!("{name}: evaluations, mean"), mean(all, |summary| summary.evaluations).round(), "")?,
        Figure::new(&format!("{name}: time, mean"), 1e3 * mean(all, |summary| summary.time_s), "ms")?,
    ])
}

/// The mean over all targets.
fn mean(all: &[Trials], of: fn(&Summary) -> f64) -> f64 {
    all.iter().map(|trials| of(&trials.summary())).sum::<f64>() / all.len() as f64
}

/// The recommended method on the 1000 poses of `ik_targets_panda_urdf`, each from its own start.
fn panda() -> Result<Vec<Figure>> {
    let robot = arm()?;
    let frame = robot.frame("panda_hand_tcp").context("panda.urdf has no panda_hand_tcp")?;
    let targets = golden("ik_targets_panda_urdf")?;
    let rows = targets["targets"].as_array().context("no targets")?;
    let mut met = 0;
    let mut steps = 0;
    for row in rows {
        let row: Vec<f64> =
            row.as_array().context("no numbers")?.iter().filter_map(serde_json::Value::as_f64).collect();
        let (start, six) = row.split_at_checked(7).context("a target has fewer than seven numbers")?;
        let [a, b, c, x, y, z] = six.try_into().context("a target has no six numbers")?;
        let target = Pose::new(&Vec3::new(a, b, c), Vec3::new(x, y, z));
        let found = robot.inverse(Method::LevenbergMarquardt, frame, &target, start, &Options::default())?;
        let stands = robot.kinematics(frame, &found.q)?.pose_base_frame.to(&target);
        let near = stands.position.norm() <= 1e-5 && stands.angle_rad() <= 1e-5;
        met += usize::from(found.status == Status::Reached && near);
        steps += found.steps;
    }
    Ok(vec![
        Figure::new(&format!("memr: lm, Panda, poses reached, of {}", rows.len()), met as f64, "")?,
        Figure::new("memr: lm, Panda, steps of all starts, mean", steps as f64 / rows.len() as f64, "")?,
    ])
}

/// Panda with its fingers held.
fn arm() -> Result<Robot> {
    let locks = ["panda_finger_joint1", "panda_finger_joint2"].map(|joint| (joint.to_owned(), 0.0)).into();
    Ok(urdf::read(&setup::root().join("tests/data/urdf/panda.urdf"), &locks)?)
}

fn golden(name: &str) -> Result<serde_json::Value> {
    let path = setup::root().join(format!("tests/data/golden/{name}.json.gz"));
    let file = std::fs::File::open(&path).with_context(|| format!("{} cannot be read", path.display()))?;
    let mut text = String::new();
    flate2::read::GzDecoder::new(file).read_to_string(&mut text).with_context(|| format!("{}", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("{} is no JSON", path.display()))
}
