//! Kinematic synthesis: every example of the paper by its scheme and by ours, error and time over the number of steps, the
//! regularisation of the insufficient case, and what of the printed figures can hold together.

use std::time::Duration;

use anyhow::{Context as _, Result};
use darm_arm::arm::frames::{DesiredFrame, Task};
use darm_arm::arm::{Arm, frames};
use darm_arm::synthesis::{Feedback, Method, Options, Scheme, Synthesis, synthesize};
use darm_core::se::Pose;
use darm_papers::synthesis::pictures::{self, Picture};
use darm_papers::synthesis::{EXAMPLES, Example, Run, Runs, STEPS, text};

use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::shard::Shard;
use serde::{Deserialize, Serialize};
use xtask::setup;

use crate::bench::draws::{Own, PLANAR_WORDS, moved, own_frames};

/// The paper on the kinematic synthesis of discretely actuated arms
#[derive(clap::Args, Serialize, Deserialize)]
pub(crate) struct Darm {}

/// So often a synthesis by the default is timed; the median counts.
const REPEATS: usize = 21;
/// Steps whose figures have goals: those of the paper in the plane.
const MAIN_STEPS: u32 = 1000;
/// Regularisation parameters of the insufficient case, as shares of the Jacobian's norm, and the steps there.
const PARAMETERS: [f64; 6] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0];
const REGULARISED_STEPS: u32 = 1000;
const INSUFFICIENT: usize = 4;
/// Draws of frames on which the orientation error is held beside the position error, and the steps there: both fall alike.
const DRAWS: u64 = 200;
const DRAW_STEPS: u32 = 100;
const DRAW_SIZE: f64 = 0.1;

/// One run: which it is, and of which example.
#[derive(Clone, Copy)]
enum Item {
    Paper {
        example: usize,
        scheme: Scheme,
    },
    Default {
        example: usize,
    },
    Regularised {
        parameter: f64,
    },
    /// Errors of draws with orientations that turn, or stay.
    Draws {
        turns: bool,
    },
    Counts,
}

impl Item {
    fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for (example, Example { max_steps, both_readings, .. }) in EXAMPLES.iter().enumerate() {
            let readings = [Some(Feedback::Actual), both_readings.then_some(Feedback::Interpolated)];
            for feedback in readings.into_iter().flatten() {
                let steps = STEPS.into_iter().filter(|steps| steps <= max_steps);
                all.extend(
                    steps.map(|steps| Self::Paper { example, scheme: Scheme { feedback, ..Scheme::of(steps) } }),
                );
            }
            all.push(Self::Default { example });
        }
        all.extend(PARAMETERS.map(|parameter| Self::Regularised { parameter }));
        all.extend([Self::Draws { turns: true }, Self::Draws { turns: false }, Self::Counts]);
        all
    }

    fn name(&self) -> String {
        match self {
            Self::Paper { example, scheme } => {
                let reading = if scheme.feedback == Feedback::Interpolated { ", interpolated frames" } else { "" };
                format!("{}, {} steps{reading}", EXAMPLES[*example].name, scheme.steps)
            }
            Self::Default { example } => format!("{}, default", EXAMPLES[*example].name),
            Self::Regularised { parameter } => format!("regularisation {parameter}"),
            Self::Draws { turns } => {
                format!("draws, {}", if *turns { "frames that turn" } else { "frames that do not turn" })
            }
            Self::Counts => "sufficient frames".to_owned(),
        }
    }
}

/// What came of one item.
#[derive(Serialize, Deserialize)]
pub(crate) enum Outcome {
    Run(Run),
    /// Orientation error over position error of each draw, rad/m.
    Ratios(Vec<f64>),
    /// Sufficient frames of arms of 1, 2, … modules, less (states − 1)·modules + 1.
    Counts(Vec<i64>),
}

impl Job for Darm {
    const COMMAND: &'static str = "papers darm";
    type Bench = Vec<(Arm, Task)>;
    type Outcome = Outcome;

    fn items(&self) -> Result<Vec<String>> {
        Ok(Item::all().iter().map(Item::name).collect())
    }

    fn bench(&self, _: Shard) -> Result<Vec<(Arm, Task)>> {
        EXAMPLES.iter().map(read).collect()
    }

    fn run(&self, bench: &Vec<(Arm, Task)>, item: usize) -> Result<Outcome> {
        let item = Item::all()[item];
        let solve = |example: usize, method| {
            let (arm, task) = &bench[example];
            let options = Options { method, ranges: task.ranges.clone(), ..Options::default() };
            synthesize(arm, &task.frames, &options).with_context(|| item.name())
        };
        match item {
            Item::Paper { example, scheme } => {
                let found = solve(example, Method::Paper(scheme))?;
                Ok(Outcome::Run(Run::new(&found, scheme.feedback, found.time.as_secs_f64())))
            }
            Item::Default { example } => {
                let found: Vec<Synthesis> =
                    (0..REPEATS).map(|_| solve(example, Method::Newton)).collect::<Result<_>>()?;
                let mut times: Vec<Duration> = found.iter().map(|found| found.time).collect();
                times.sort_unstable();
                Ok(Outcome::Run(Run::new(&found[0], Feedback::Actual, times[REPEATS / 2].as_secs_f64())))
            }
            Item::Regularised { parameter } => {
                let scheme = Scheme { regularisation: parameter, ..Scheme::of(REGULARISED_STEPS) };
                let found = solve(INSUFFICIENT, Method::Paper(scheme))?;
                let rss = found.error_m2().sqrt();
                let run = Run::new(&found, scheme.feedback, found.time.as_secs_f64());
                Ok(Outcome::Run(Run { position_m: rss, ..run }))
            }
            Item::Draws { turns } => ratios(turns).map(Outcome::Ratios),
            Item::Counts => counts().map(Outcome::Counts),
        }
    }

    /// Times are measured.
    fn runs_alone(&self, _: usize) -> bool {
        true
    }

    fn figures(&self, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
        let mut all: Vec<Runs> = Vec::new();
        let (mut figures, mut trade_off) = (Vec::new(), Vec::new());
        let mut paper = Vec::new();
        for (item, outcome) in Item::all().into_iter().zip(outcomes) {
            match (item, outcome) {
                (Item::Paper { .. }, Outcome::Run(run)) => paper.push(run.clone()),
                (Item::Default { example }, Outcome::Run(run)) => {
                    let paper = std::mem::take(&mut paper);
                    all.push(Runs { example: EXAMPLES[example], paper, default: run.clone() });
                }
                (Item::Regularised { parameter }, Outcome::Run(run)) => {
                    trade_off.push([parameter, run.position_m, run.alteration_m]);
                }
                (Item::Draws { turns }, Outcome::Ratios(ratios)) => figures.extend(ratio_figures(turns, ratios)?),
                (Item::Counts, Outcome::Counts(off)) => {
                    let off = off.iter().map(|off| off.abs()).max().unwrap_or(0);
                    figures.push(Figure::new("sufficient frames, off (states - 1) x modules + 1", off as f64, "")?);
                }
                _ => {}
            }
        }
        println!("{}", text(&all));
        print_trade_off(&trade_off);
        write_pictures(&all, &trade_off)?;
        let mut rows = Vec::new();
        for runs in &all {
            rows.extend(rows_of(runs)?);
        }
        rows.extend(figures);
        Ok(rows)
    }

    fn seed(&self) -> u64 {
        0
    }
}

fn read(example: &Example) -> Result<(Arm, Task)> {
    let folder = setup::root().join("examples");
    let arm = Arm::read(&folder.join(example.arm))?;
    let task = frames::read_task(&folder.join(example.frames), &arm)?;
    Ok((arm, task))
}

/// Orientation error over position error of the paper's scheme, rad/m, on frames of the planar arm moved at random.
fn ratios(turns: bool) -> Result<Vec<f64>> {
    let own = own_frames("planar4.toml", &PLANAR_WORDS)?;
    (0..DRAWS).map(|seed| ratio(&own, turns, seed)).collect()
}

/// Orientation error over position error on the frames of one seed, rad/m; the frames turn only where `turns`.
fn ratio(Own { arm, frames }: &Own, turns: bool, seed: u64) -> Result<f64> {
    let options = Options { method: Method::Paper(Scheme::of(DRAW_STEPS)), ..Options::default() };
    let mut desired = moved(frames, DRAW_SIZE, true, seed);
    for (frame, own) in desired.iter_mut().zip(frames).filter(|_| !turns) {
        frame.pose_base_tool = Pose { rotation: own.pose_base_tool.rotation, ..frame.pose_base_tool };
    }
    let found = synthesize(arm, &desired, &options)?;
    let run = Run::new(&found, Feedback::Actual, 0.0);
    Ok(run.orientation_rad.unwrap_or(0.0) / run.position_m)
}

fn ratio_figures(turns: bool, ratios: &[f64]) -> Result<Vec<Figure>> {
    let mut sorted: Vec<f64> = ratios.iter().map(|ratio| ratio.to_degrees()).collect();
    sorted.sort_by(f64::total_cmp);
    let name = format!(
        "planar 4 modules, orientation error over position error, {DRAWS} draws{}",
        if turns { "" } else { ", frames that do not turn" }
    );
    Ok(vec![
        Figure::new(&format!("{name}, least"), sorted[0], "deg/m")?,
        Figure::new(&format!("{name}, median"), sorted[sorted.len() / 2], "deg/m")?,
    ])
}

/// For arms of the first modules of two examples: the frames of complete modules that are sufficient, less the law's.
fn counts() -> Result<Vec<i64>> {
    let mut off = Vec::new();
    for (file, per_frame) in [("planar4.toml", 3), ("spatial6.toml", 6)] {
        let complete = Arm::read(&setup::root().join("examples").join(file))?;
        for modules in 1..=complete.model.chain.stages.len() {
            let mut arm = complete.clone();
            arm.model.chain.stages.truncate(modules);
            let rest = "0".repeat(arm.n_actuators());
            let own: Vec<DesiredFrame> = own_frames_of(&arm, &rest)?;
            let case = synthesize(&arm, &own, &Options::default())?.case;
            off.push((case.max_rank / per_frame) as i64 - (modules as i64 + 1));
        }
    }
    Ok(off)
}

fn own_frames_of(arm: &Arm, word: &str) -> Result<Vec<DesiredFrame>> {
    Ok(Own::new(arm.clone(), &[word])?.frames)
}

/// The rows of one example: names of runs of 1000 steps leave the steps out.
fn rows_of(Runs { example, paper, default }: &Runs) -> Result<Vec<Figure>> {
    let mut figures = Vec::new();
    for run in paper {
        let reading = if run.is_interpolated { ", interpolated frames" } else { "" };
        let steps = if run.steps == MAIN_STEPS { String::new() } else { format!(", {} steps", run.steps) };
        let name = format!("{}, paper's method{reading}{steps}", example.name);
        figures.extend(rows_of_run(&name, run, example.is_redundant)?);
    }
    figures.extend(rows_of_run(&format!("{}, default", example.name), default, example.is_redundant)?);
    Ok(figures)
}

/// The rows of one run; those of a redundant arm have the alteration too.
fn rows_of_run(name: &str, run: &Run, is_redundant: bool) -> Result<Vec<Figure>> {
    let row = |what: &str, value: f64, unit: &str| Figure::new(&format!("{name}: {what}"), value, unit);
    let mut rows = vec![row("position error", run.position_m, "m")?];
    if let Some(rad) = run.orientation_rad {
        rows.push(row("orientation error", rad.to_degrees(), "deg")?);
    }
    if is_redundant {
        rows.push(row("alteration", run.alteration_m, "m")?);
    }
    rows.push(row("steps", run.steps.into(), "")?);
    rows.push(row("time", 1e3 * run.time_s, "ms")?);
    Ok(rows)
}

fn print_trade_off(points: &[[f64; 3]]) {
    println!("Figure 7: regularisation of the insufficient example, {REGULARISED_STEPS} steps");
    println!("{:>12} {:>24} {:>24}", "parameter", "error of frames, RSS", "alteration of stops, RSS");
    for [parameter, error_m, alteration_m] in points {
        println!("{parameter:12.0e} {:21.2} mm {:21.2} mm", 1e3 * error_m, 1e3 * alteration_m);
    }
    println!();
}

/// All figures of the paper that show arms, and charts of what it reports in words.
fn write_pictures(all: &[Runs], trade_off: &[[f64; 3]]) -> Result<()> {
    let folder = setup::root().join("target/papers/darm");
    std::fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
    let mut pictures: Vec<Picture> = pictures::charts(all);
    pictures.push(pictures::trade_off(trade_off));
    for (index, example) in EXAMPLES.iter().enumerate() {
        let (arm, task) = read(example)?;
        let found = || -> Result<Arm> {
            let options = Options { ranges: task.ranges.clone(), ..Options::default() };
            Ok(synthesize(&arm, &task.frames, &options)?.arm)
        };
        pictures.extend(match index {
            0 | 1 => pictures::configurations(index as u32 + 1, &arm)?,
            2 => {
                [pictures::in_frames(5, &arm, &task.frames)?, pictures::in_frames(6, &found()?, &task.frames)?].concat()
            }
            4..=6 => pictures::in_frames(index as u32 + 3, &found()?, &task.frames)?,
            7 => vec![pictures::configuration(3, &arm, &arm.rest())?],
            _ => Vec::new(),
        });
    }
    for (file, svg) in pictures {
        let path = folder.join(file);
        std::fs::write(&path, svg).with_context(|| format!("{} cannot be written", path.display()))?;
    }
    println!("Figures 1 to 3 and 5 to 9, error and time over the steps, regularisation: {}\n", folder.display());
    Ok(())
}
