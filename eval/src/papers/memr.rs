//! Inverse kinematics by electromagnetism-like search: Tables 1 to 3, Figures 8 to 11, and the methods that a user
//! should take.

use std::f64::consts::PI;
use std::io::Read as _;
use std::time::Duration;

use anyhow::{Context, Result};
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_papers::convergence;
use darm_papers::memr::{self, CELLS, Cell, LINK_M, MET_M, PRINTED_LINK_M, Printed, Problem, RUNS, Repeated, TARGETS};
use darm_robot::ik::search::{Algorithm, Mark, Run, Settings};
use darm_robot::ik::trials::{Summary, Trials};
use darm_robot::ik::{Method, Options, Status};
use darm_robot::robot::Robot;
use darm_robot::robot::planar::planar_arm;
use darm_robot::urdf;

use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::shard::Shard;
use serde::{Deserialize, Serialize};
use xtask::setup;

/// The paper on the electromagnetism-like algorithm with record-to-record travel
#[derive(clap::Args, Serialize, Deserialize)]
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

/// One cell of the tables with links of one length.
struct Part {
    cell: &'static Cell,
    link_m: f64,
}

/// The cells with the links that are printed, then those with ours; the functions of Table 1 have no links.
fn parts() -> Vec<Part> {
    let of = |link_m: f64| CELLS.iter().map(move |cell| Part { cell, link_m });
    of(PRINTED_LINK_M).filter(|part| part.cell.table > 1).chain(of(LINK_M)).collect()
}

/// What came of one item.
#[derive(Serialize, Deserialize)]
pub(crate) enum Outcome {
    /// The runs of one cell.
    Cell(Kept),
    /// Figures: name, value, unit.
    Rows(Vec<(String, f64, String)>),
}

/// The runs of one cell, in the order of their seeds.
#[derive(Serialize, Deserialize)]
pub(crate) struct Kept {
    runs: Vec<KeptRun>,
    short_cm: f64,
}

#[derive(Serialize, Deserialize)]
struct KeptRun {
    x: Vec<f64>,
    value: f64,
    evaluations: usize,
    time_s: f64,
    /// Evaluations and the best value so far.
    history: Vec<(usize, f64)>,
}

impl From<Repeated> for Kept {
    fn from(repeated: Repeated) -> Self {
        let run = |Run { x, value, evaluations, time_s, history }: Run| KeptRun {
            x,
            value,
            evaluations,
            time_s,
            history: history.iter().map(|mark| (mark.evaluations, mark.value)).collect(),
        };
        Self { runs: repeated.trials.runs.into_iter().map(run).collect(), short_cm: repeated.short_cm }
    }
}

impl Kept {
    fn repeated(&self, cell: &Cell) -> Repeated {
        let mark = |&(evaluations, value): &(usize, f64)| Mark { evaluations, value };
        let run = |KeptRun { x, value, evaluations, time_s, history }: &KeptRun| Run {
            x: x.clone(),
            value: *value,
            evaluations: *evaluations,
            time_s: *time_s,
            history: history.iter().map(mark).collect(),
        };
        let trials = Trials { runs: self.runs.iter().map(run).collect() };
        Repeated { cell: *cell, trials, short_cm: self.short_cm }
    }
}

impl Job for Memr {
    const COMMAND: &'static str = "papers memr";
    type Bench = ();
    type Outcome = Outcome;

    fn items(&self) -> Result<Vec<String>> {
        let name = |Part { cell, link_m }: &Part| {
            let (table, algorithm) = (cell.table, memr::printed_name(cell.algorithm));
            format!("links of {link_m} m, Table {table}, {}, {algorithm}", cell.problem.name())
        };
        let mut names: Vec<String> = parts().iter().map(name).collect();
        names.extend(["all methods", "targets of a Panda", "GA on De Jong, more iterations"].map(str::to_owned));
        Ok(names)
    }

    fn bench(&self, _: Shard) -> Result<()> {
        Ok(())
    }

    fn run(&self, (): &(), item: usize) -> Result<Outcome> {
        let parts = parts();
        if let Some(Part { cell, link_m }) = parts.get(item) {
            return Ok(Outcome::Cell(Repeated::new(cell, *link_m, RUNS, self.seed)?.into()));
        }
        let figures = match item - parts.len() {
            0 => self.other_methods()?,
            1 => panda()?,
            _ => longer_genetic(self.seed)?,
        };
        Ok(Outcome::Rows(figures.into_iter().map(|figure| (figure.name, figure.value, figure.unit)).collect()))
    }

    /// The runs of each item use all cores, and their times are measured.
    fn runs_alone(&self, _: usize) -> bool {
        true
    }

    fn figures(&self, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
        let parts = parts();
        let mut figures = Vec::new();
        for link_m in [PRINTED_LINK_M, LINK_M] {
            let own = parts.iter().zip(outcomes).filter(|(part, _)| part.link_m == link_m);
            let kept = own.filter_map(|(part, outcome)| match outcome {
                Outcome::Cell(kept) => Some(kept.repeated(part.cell)),
                Outcome::Rows(_) => None,
            });
            let repeated: Vec<Repeated> = kept.collect();
            println!("\nlinks of {} cm, {RUNS} runs{}", 100.0 * link_m, memr::text(&repeated));
            if link_m == LINK_M {
                pictures(&repeated)?;
            }
            figures.extend(within(&repeated, link_m)?);
        }
        for outcome in outcomes {
            let Outcome::Rows(rows) = outcome else { continue };
            for (name, value, unit) in rows {
                figures.push(Figure::new(name, *value, unit)?);
            }
        }
        Ok(figures)
    }

    fn seed(&self) -> u64 {
        self.seed
    }
}

/// Figures 2 and 8 to 11.
fn pictures(repeated: &[Repeated]) -> Result<()> {
    let folder = setup::root().join("target/papers/memr");
    std::fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
    for (file, svg) in memr::figures(repeated) {
        let path = folder.join(file);
        std::fs::write(&path, svg).with_context(|| format!("{} cannot be written", path.display()))?;
    }
    std::fs::write(folder.join("figure-02-configurations.svg"), several()?)?;
    println!("\nFigures 2 and 8 to 11, mean and band of eight tenths of the runs: {}\n", folder.display());
    Ok(())
}

impl Memr {
    /// Every method on the paper's targets: at MEMR's evaluations, and in MEMR's time.
    fn other_methods(&self) -> Result<Vec<Figure>> {
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
                    let largest = all.iter().map(|trials| trials.summary().evaluations).fold(0.0, f64::max);
                    figures.push(Figure::new(
                        "memr: evaluations of lm over MEMR's, worst target",
                        largest / evaluations,
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

/// What the figures of a problem say of its links: a function has none.
fn links(problem: Problem, link_m: f64) -> &'static str {
    match problem {
        Problem::Target(_) if link_m == PRINTED_LINK_M => ", links of 20 cm as printed",
        Problem::Target(_) => ", links of 30 cm",
        _ => "",
    }
}

/// Our tables beside the paper's, and how far they lie from each other; a target out of reach has only how far it is.
fn within(repeated: &[Repeated], link_m: f64) -> Result<Vec<Figure>> {
    let mut figures = Vec::new();
    for repeated in repeated {
        let (cell, algorithm) = (&repeated.cell, memr::printed_name(repeated.cell.algorithm));
        let links = links(cell.problem, link_m);
        if repeated.short_cm > 0.0 {
            let name = format!("memr: {}{links}: out of reach by", cell.problem.name());
            if !figures.iter().any(|figure: &Figure| figure.name == name) {
                figures.push(Figure::new(&name, repeated.short_cm, "cm")?);
            }
            continue;
        }
        let name = format!("memr: Table {}, {}, {algorithm}{links}", cell.table, cell.problem.name());
        figures.push(Figure::new(&name, repeated.off(), "of spread")?);
        let ([ours, paper], unit) = (repeated.compared(), if repeated.cell.table > 1 { "cm" } else { "" });
        let what = if repeated.cell.table == 3 { "mean" } else { "best" };
        figures.push(Figure::new(&format!("{name}: {what}, ours"), ours, unit)?);
        figures.push(Figure::new(&format!("{name}: {what}, paper"), paper, unit)?);
        if let Printed::Best { deviation, .. } = repeated.cell.printed {
            let ours = repeated.cell.problem.factor() * repeated.trials.summary().deviation;
            figures.push(Figure::new(&format!("{name}: standard deviation, ours"), ours, unit)?);
            figures.push(Figure::new(&format!("{name}: standard deviation, paper"), deviation, unit)?);
        }
        if let Some(count) = repeated.printed_within() {
            figures.push(Figure::new(&format!("{name}: printed runs within ours, of 5"), count as f64, "")?);
        }
        if let Some(off) = repeated.off_of_best() {
            figures.push(Figure::new(&format!("{name}: our best 5 of 20, chosen afterwards"), off, "of spread")?);
        }
    }
    Ok(figures)
}

/// The genetic algorithm on De Jong's function with as many iterations as all other problems have.
fn longer_genetic(seed: u64) -> Result<Vec<Figure>> {
    let iterations = memr::GENETIC_DE_JONG_ITERATIONS;
    let off = Cell::genetic_de_jong(iterations, seed).off();
    Ok(vec![Figure::new(&format!("memr: Table 1, De Jong, GA, {iterations} iterations"), off, "of spread")?])
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
        let reached = robot.kinematics(frame, &found.q)?.pose_base_frame.to(&target);
        let near = reached.position.norm() <= 1e-5 && reached.angle_rad() <= 1e-5;
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

#[cfg(test)]
mod tests {
    use super::*;
    use darm_robot::ik::search::Algorithm::Memr as MEMR;

    /// A cell of one short run.
    fn short(target: [f64; 2], link_m: f64) -> Repeated {
        let cell = CELLS.iter().find(|cell| cell.problem == Problem::Target(target) && cell.algorithm == MEMR);
        let settings = Settings { iterations: 1, ..Settings::default() };
        let cell = *cell.unwrap();
        let trials = memr::reach(link_m, Method::Population(MEMR), target, &settings, 1).unwrap();
        let nearest = memr::reach(link_m, Method::LevenbergMarquardt, target, &settings, 1).unwrap().summary().best;
        Repeated { cell, trials, short_cm: if nearest > MET_M { 100.0 * nearest } else { 0.0 } }
    }

    #[test]
    fn rows_say_which_links_they_have_and_which_targets_are_out_of_their_reach() {
        let names = |target, link_m| -> Vec<String> {
            let twice = [short(target, link_m), short(target, link_m)];
            within(&twice, link_m).unwrap().into_iter().map(|figure| figure.name).collect()
        };
        for target in [[50.0, 60.0], [70.0, 20.0]] {
            let printed = names(target, PRINTED_LINK_M);
            assert!(printed.iter().all(|name| name.contains(", MEMR, links of 20 cm as printed")), "{printed:?}");
        }
        assert!(names([70.0, 20.0], LINK_M).iter().all(|name| name.contains(", MEMR, links of 30 cm")));
        let far = "memr: (80, 30) cm, links of 20 cm as printed: out of reach by";
        assert_eq!(names([80.0, 30.0], PRINTED_LINK_M), [far], "once for all methods, and nothing is compared");
    }
}
