//! Suárez and Claret, Searching a valid hand configuration to perform a given grasp: Table 1, Figures 4 and 5, and the
//! method to use on constraints that the training never saw.

use std::iter;
use std::path::Path;
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::progress::Progress;
use darm_figures::shard::Shard;
use darm_papers::grasp::contact::{Configuration, Contacts};
use darm_papers::grasp::file::{HandFile, read_hand};
use darm_papers::grasp::library::Library;
use darm_papers::grasp::paper::{End, Settings};
use darm_papers::grasp::train::{Chosen, PAPER_LAMBDAS, PAPER_SUCCESS, Training};
use darm_papers::grasp::{plot, solve};
use serde::{Deserialize, Serialize};
use xtask::setup;

/// Finding a hand's configuration for a grasp: Table 1, Figures 4 and 5, and the method to use
#[derive(clap::Args, Serialize, Deserialize)]
pub(crate) struct Grasp {
    /// Constraints of the training
    #[arg(long, default_value_t = 10_000)]
    n: usize,
    /// Constraints of the comparison, which no training has seen
    #[arg(long, default_value_t = 10_000)]
    held_out: usize,
    /// Values of λ in the training
    #[arg(long, default_value_t = 100)]
    lambdas: usize,
}

const SEED: u64 = 1;
/// Of the comparison.
const HELD_OUT_SEED: u64 = 2;
const LIBRARY_SEED: u64 = 3;
const LIBRARY: usize = 1000;
/// The longest sequence of the paper.
const LENGTH: usize = 10;
/// Constraints of one item.
const BATCH: usize = 100;

/// What one method came to on one constraint.
#[derive(Serialize, Deserialize)]
pub(crate) struct Run {
    /// The start or the number of the λ that solved it.
    solved_by: Option<usize>,
    iterations: u32,
    time_s: f64,
    /// What the independent forward kinematics finds wrong.
    faults: Faults,
}

#[derive(Clone, Copy, Default, Serialize, Deserialize)]
struct Faults {
    collides: bool,
    is_past_limits: bool,
    error_m: f64,
}

/// One λ of the sequence that was trained.
#[derive(Serialize, Deserialize)]
pub(crate) struct Lambda {
    lambda: f64,
    rate: f64,
    accumulated: f64,
}

/// What came of one item.
#[derive(Serialize, Deserialize)]
pub(crate) enum Outcome {
    /// The trained sequence.
    Sequence(Vec<Lambda>),
    /// Some held-out constraints by both methods, and some with contacts in an order that nobody gave.
    HeldOut { paper: Vec<Run>, ours: Vec<Run>, unassigned: Vec<Run> },
}

/// The hand, what was trained, and constraints that the training never saw.
pub(crate) struct Bench {
    file: HandFile,
    sequence: Vec<Chosen>,
    lambdas: Vec<f64>,
    library: Library,
    held_out: Vec<Contacts>,
}

impl Job for Grasp {
    const COMMAND: &'static str = "papers grasp";
    type Bench = Bench;
    type Outcome = Outcome;

    fn items(&self) -> Result<Vec<String>> {
        let batches = (0..self.held_out).step_by(BATCH).map(|first| format!("constraints from {first}"));
        Ok(iter::once("training".to_owned()).chain(batches).collect())
    }

    /// The training is the same in each process. A separate file lets it resume after an interruption.
    fn bench(&self, shard: Shard) -> Result<Bench> {
        let progress = Progress::shown();
        let file = read_hand(&setup::root().join("examples/allegro_hand.toml"))?;
        let folder = setup::root().join("target/papers/grasp");
        std::fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
        let training = Training { count: self.n, lambdas: self.lambdas, seed: SEED, settings: Settings::default() };
        progress
            .say(format!("training: {} constraints, {} values of λ; it resumes if interrupted", self.n, self.lambdas));
        let bar = progress.bar("constraints", self.n as u64);
        let part = if shard.is_part() { format!("-{}", shard.number()) } else { String::new() };
        let kept = folder.join(format!("training-{}-{}{part}.txt", self.n, self.lambdas));
        let outcomes = training.run(&file.hand, Some(&kept), |done| bar.set_position(done as u64))?;
        bar.finish_and_clear();
        let sequence = outcomes.sequence(LENGTH);
        ensure!(!sequence.is_empty(), "no λ solves any constraint");
        pictures(&folder, &outcomes.lambdas, &sequence)?;
        let held_out = file.hand.draw_many(self.held_out, HELD_OUT_SEED);
        let lambdas = sequence.iter().map(|chosen| chosen.lambda).collect();
        let library = Library::draw(&file.hand, LIBRARY, LIBRARY_SEED);
        Ok(Bench { file, sequence, lambdas, library, held_out })
    }

    fn run(&self, bench: &Bench, item: usize) -> Result<Outcome> {
        let Bench { file, lambdas, library, held_out, .. } = bench;
        let Some(batch) = item.checked_sub(1) else {
            let lambda = |Chosen { lambda, rate, accumulated, .. }: &Chosen| Lambda {
                lambda: *lambda,
                rate: *rate,
                accumulated: *accumulated,
            };
            return Ok(Outcome::Sequence(bench.sequence.iter().map(lambda).collect()));
        };
        let first = batch * BATCH;
        let batch = &held_out[first..held_out.len().min(first + BATCH)];
        // A tenth of all constraints, the first ones.
        let unassigned = held_out.len().div_ceil(10).saturating_sub(first).min(batch.len());
        Ok(Outcome::HeldOut {
            paper: batch.iter().map(|contacts| by_paper(file, lambdas, contacts)).collect::<Result<_>>()?,
            ours: batch.iter().map(|contacts| by_us(file, library, contacts)).collect::<Result<_>>()?,
            unassigned: batch[..unassigned]
                .iter()
                .map(|contacts| unassigned_by_us(file, library, contacts))
                .collect::<Result<_>>()?,
        })
    }

    fn figures(&self, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
        let mut figures = Vec::new();
        let [mut all_paper, mut all_ours, mut all_unassigned] = [const { Vec::new() }; 3];
        for outcome in outcomes {
            match outcome {
                Outcome::Sequence(sequence) => {
                    table(sequence);
                    figures.extend(trained(sequence)?);
                }
                Outcome::HeldOut { paper, ours, unassigned } => {
                    all_paper.extend(paper);
                    all_ours.extend(ours);
                    all_unassigned.extend(unassigned);
                }
            }
        }
        figures.extend(compared("paper's method, held out", &all_paper)?);
        figures.extend(compared("Levenberg-Marquardt", &all_ours)?);
        figures.extend(assigned(&all_unassigned)?);
        Ok(figures)
    }

    fn seed(&self) -> u64 {
        SEED
    }
}

/// Figures 4 and 5.
fn pictures(folder: &Path, lambdas: &[f64], sequence: &[Chosen]) -> Result<()> {
    for (name, svg) in
        [("figure-4.svg", plot::selection(lambdas, sequence)), ("figure-5.svg", plot::accumulation(sequence))]
    {
        let path = folder.join(name);
        std::fs::write(&path, svg).with_context(|| format!("{} cannot be written", path.display()))?;
    }
    println!("Figures 4 and 5: {}\n", folder.display());
    Ok(())
}

/// Table 1, ours beside the paper's.
fn table(sequence: &[Lambda]) {
    println!("Table 1: the sequence of λ, and what it solves; the paper gives the first two percentages");
    println!("{:>3} {:>7} {:>10} {:>12} {:>13} {:>10}", "k", "λ", "of rest %", "of all %", "λ, paper", "of rest %");
    for (k, chosen) in sequence.iter().enumerate() {
        let paper = PAPER_SUCCESS.get(k).map_or(String::new(), |success| format!("{success:.2}"));
        let Lambda { lambda, rate, accumulated } = chosen;
        let paper_lambda = PAPER_LAMBDAS.get(k).map_or(String::new(), |lambda| format!("{lambda:.2}"));
        println!("{:>3} {lambda:>7.2} {rate:>10.2} {accumulated:>12.2} {paper_lambda:>13} {paper:>10}", k + 1);
    }
    println!();
}

/// What the training promises.
fn trained(sequence: &[Lambda]) -> Result<Vec<Figure>> {
    let (first, all) =
        (sequence.first().map_or(0.0, |c| c.accumulated), sequence.last().map_or(0.0, |c| c.accumulated));
    Ok(vec![
        Figure::new("grasp: paper's method, first lambda", first, "%")?,
        Figure::new("grasp: paper's method, first lambda, at most", first, "%")?,
        Figure::new("grasp: paper's method, ten lambdas", all, "%")?,
    ])
}

fn by_paper(file: &HandFile, lambdas: &[f64], contacts: &Contacts) -> Result<Run> {
    let start = Instant::now();
    let attempts = file.hand.search(lambdas, contacts, &Settings::default());
    let time_s = start.elapsed().as_secs_f64();
    let last = attempts.last().context("there is no λ")?;
    let is_solved = last.end == End::Solved;
    Ok(Run {
        solved_by: is_solved.then_some(attempts.len()),
        iterations: attempts.iter().map(|attempt| attempt.iterations).sum(),
        time_s,
        faults: checked(file, is_solved, &last.configuration, contacts)?,
    })
}

fn by_us(file: &HandFile, library: &Library, contacts: &Contacts) -> Result<Run> {
    let start = Instant::now();
    let solution = file.hand.solve(library, contacts, &solve::Settings::default());
    let time_s = start.elapsed().as_secs_f64();
    Ok(Run {
        solved_by: solution.is_solved.then_some(solution.starts),
        iterations: solution.iterations,
        time_s,
        faults: checked(file, solution.is_solved, &solution.configuration, contacts)?,
    })
}

/// Faults of an answer, by the robot's own forward kinematics; what is no answer has none.
fn checked(file: &HandFile, is_solved: bool, configuration: &Configuration, contacts: &Contacts) -> Result<Faults> {
    if !is_solved {
        return Ok(Faults::default());
    }
    let verdict = file.referee.judge(&file.hand, configuration, contacts)?;
    Ok(Faults {
        collides: verdict.overlap.is_some(),
        is_past_limits: verdict.past_limit_rad > 0.0,
        error_m: verdict.point_m,
    })
}

fn compared(method: &str, runs: &[&Run]) -> Result<Vec<Figure>> {
    let name = |what: &str| format!("grasp: {method}, {what}");
    let solved = |starts: usize| runs.iter().filter(|run| run.solved_by.is_some_and(|by| by <= starts)).count() as f64;
    let percent = |starts: usize| 100.0 * solved(starts) / runs.len() as f64;
    let faults = |is: fn(&Faults) -> bool| runs.iter().filter(|run| is(&run.faults)).count() as f64;
    let max_m = runs.iter().map(|run| run.faults.error_m).fold(0.0, f64::max);
    let iterations: f64 = runs.iter().map(|run| f64::from(run.iterations)).sum();
    let time_s: f64 = runs.iter().map(|run| run.time_s).sum();
    Ok(vec![
        Figure::new(&name("one start"), percent(1), "%")?,
        Figure::new(&name("two starts"), percent(2), "%")?,
        Figure::new(&name("ten starts"), percent(LENGTH), "%")?,
        Figure::new(&name("answers that collide"), faults(|fault| fault.collides), "")?,
        Figure::new(&name("answers past a limit"), faults(|fault| fault.is_past_limits), "")?,
        Figure::new(&name("largest error of an answer"), 1e3 * max_m, "mm")?,
        Figure::new(&name("iterations for a grasp"), iterations / solved(LENGTH), "")?,
        Figure::new(&name("time for a grasp"), 1e3 * time_s / solved(LENGTH), "ms")?,
    ])
}

/// Contacts in an order that nobody gave.
fn unassigned_by_us(file: &HandFile, library: &Library, contacts: &Contacts) -> Result<Run> {
    let shuffled = [2, 3, 1, 0].map(|k: usize| contacts[k]);
    let start = Instant::now();
    let (solution, order) = file.hand.solve_any(library, &shuffled, &solve::Settings::default());
    let time_s = start.elapsed().as_secs_f64();
    let wanted = order.map(|k| shuffled[k]);
    let faults = checked(file, solution.is_solved, &solution.configuration, &wanted)?;
    let solved_by = solution.is_solved.then_some(solution.starts);
    Ok(Run { solved_by, iterations: solution.iterations, time_s, faults })
}

fn assigned(runs: &[&Run]) -> Result<Vec<Figure>> {
    let solved = runs.iter().filter(|run| run.solved_by.is_some()).count() as f64;
    let wrong = runs.iter().filter(|run| run.faults.collides || run.faults.is_past_limits).count() as f64;
    let time_s: f64 = runs.iter().map(|run| run.time_s).sum();
    Ok(vec![
        Figure::new("grasp: fingers not assigned, solved", 100.0 * solved / runs.len() as f64, "%")?,
        Figure::new("grasp: fingers not assigned, wrong answers", wrong, "")?,
        Figure::new("grasp: fingers not assigned, time for a grasp", 1e3 * time_s / solved, "ms")?,
    ])
}
