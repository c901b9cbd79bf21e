//! `cargo xtask simulate`: many seeds of the whole system under two judges.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context as _, Result, bail};
use clap::Parser;
use darm_simulate::markdown;
use darm_simulate::mutants::{self, Mutant, Scratch};
use darm_simulate::run::{Outcome, run};
use darm_simulate::script::Script;
use darm_simulate::shrink::shrink;
use darm_simulate::summary;
use rayon::iter::{IntoParallelIterator as _, ParallelExtend as _, ParallelIterator as _};

/// Failing seeds that are shown when they are shrunk.
const SHOWN: usize = 5;
/// Seeds that run before it is looked whether a rule is broken.
const BLOCK: u64 = 20;

/// Runs the whole system in virtual time under two judges; prints what they find
#[derive(Parser)]
#[command(name = "cargo xtask simulate", bin_name = "cargo xtask simulate")]
struct Arguments {
    /// Seeds from A to B, B not included
    #[arg(long, value_name = "A..B", default_value = "0..200")]
    seeds: String,
    /// Print what happens in one seed, line by line
    #[arg(long, value_name = "SEED")]
    replay: Option<u64>,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Put known defects in, one by one, and see in how many seeds the judges find each
    #[arg(long)]
    mutants: bool,
    /// Only the mutant of this name
    #[arg(long, value_name = "NAME", requires = "mutants")]
    only: Option<String>,
    /// Run all seeds of a mutant, also after it was caught
    #[arg(long, requires = "mutants")]
    all_seeds: bool,
    /// Stop soon after the first seed in which a rule is broken
    #[arg(long)]
    until_broken: bool,
    /// Print the results as Markdown tables
    #[arg(long)]
    markdown: bool,
    /// Show all failing seeds as they are, without leaving out what does not matter
    #[arg(long)]
    no_shrink: bool,
}

fn main() -> ExitCode {
    match Arguments::parse().run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

impl Arguments {
    /// True when no rule was broken.
    fn run(&self) -> Result<bool> {
        match self.replay {
            Some(seed) => Ok(replay(&Script::of(seed))),
            None if self.mutants => self.run_mutants(),
            None => self.run_seeds(),
        }
    }

    fn run_seeds(&self) -> Result<bool> {
        let (from, to) = range(&self.seeds)?;
        let began = Instant::now();
        let outcomes = self.outcomes(from, to);
        let took_s = began.elapsed().as_secs_f64();
        let failed: Vec<&Outcome> = outcomes.iter().filter(|outcome| !outcome.verdict.firsts().is_empty()).collect();
        let shown = if self.no_shrink { failed.len() } else { SHOWN };
        for outcome in failed.iter().take(shown) {
            self.show(outcome);
        }
        let rows = summary::with_goals(summary::rows(&outcomes), &root().join("tests/goals.toml"))?;
        print!("{}", if self.markdown { markdown::figures(&rows) } else { summary::text(&rows) });
        let per_seed_s = took_s * rayon::current_num_threads() as f64 / outcomes.len().max(1) as f64;
        eprintln!("{took_s:.1} s, {per_seed_s:.2} s of one core per seed");
        if let Some(path) = &self.json {
            summary::write_json(&rows, summary::broken(&outcomes), from, path)?;
        }
        Ok(failed.is_empty())
    }

    fn outcomes(&self, from: u64, to: u64) -> Vec<Outcome> {
        let block = if self.until_broken { BLOCK } else { u64::MAX };
        let mut outcomes: Vec<Outcome> = Vec::new();
        let mut next = from;
        while next < to && outcomes.iter().all(|outcome| outcome.verdict.firsts().is_empty()) {
            let end = to.min(next.saturating_add(block));
            outcomes.par_extend((next..end).into_par_iter().map(|seed| run(&Script::of(seed), false)));
            next = end;
        }
        outcomes
    }

    fn show(&self, outcome: &Outcome) {
        let seed = outcome.seed;
        for (violation, count) in outcome.verdict.firsts() {
            let (rule, at_ms, sentence) = (violation.rule, violation.at_ms, &violation.sentence);
            println!("seed {seed}, {rule} at {at_ms} ms: {sentence} ({count} times)");
        }
        let Some((first, _)) = outcome.verdict.firsts().first().filter(|_| !self.no_shrink) else { return };
        let small = shrink(&Script::of(seed), first.rule);
        println!("  {} needs only:", first.rule);
        small.host.iter().for_each(|entry| println!("  {:6} ms host  {:?}", entry.at_ms, entry.act));
        small.second.iter().for_each(|entry| println!("  {:6} ms second {:?}", entry.at_ms, entry.act));
        small.world.iter().for_each(|entry| println!("  {:6} ms world {:?}", entry.at_ms, entry.act));
    }

    /// True when each mutant was caught.
    fn run_mutants(&self) -> Result<bool> {
        let (from, to) = range(&self.seeds)?;
        let mut mutants = mutants::list(&root().join("eval/simulate/mutants"))?;
        mutants::check(root(), &mutants)?;
        mutants.retain(|mutant| self.only.as_ref().is_none_or(|only| *only == mutant.name));
        if mutants.is_empty() {
            bail!("there is no mutant of this name in eval/simulate/mutants");
        }
        let scratch = Scratch::new(root())?;
        if self.markdown {
            println!("{}", markdown::MUTANTS);
        }
        let (mut missed, mut failed) = (0, Vec::new());
        for mutant in &mutants {
            match scratch.judge(mutant, from..to, self.all_seeds) {
                Ok(caught) => {
                    self.print_mutant(mutant, &caught);
                    missed += usize::from(caught.broken.is_empty());
                }
                // The others are still worth their time.
                Err(error) => failed.push(format!("{}: {error:#}", mutant.name)),
            }
        }
        let rows = summary::mutant_rows(mutants.len(), missed + failed.len());
        let rows = summary::with_goals(rows, &root().join("tests/goals.toml"))?;
        if let Some(path) = &self.json {
            summary::write_json(&rows, Vec::new(), from, path)?;
        }
        if !failed.is_empty() {
            bail!("{} mutants did not run:\n{}", failed.len(), failed.join("\n"));
        }
        Ok(missed == 0)
    }

    fn print_mutant(&self, mutant: &Mutant, caught: &mutants::Caught) {
        if self.markdown {
            println!("{}", markdown::mutant(&mutant.name, caught));
            return;
        }
        let seeds = caught.seeds();
        println!("{}: {}", mutant.name, mutant.description.trim());
        match seeds.first() {
            Some(first) => println!("  caught in {} of {} seeds, first in seed {first}", seeds.len(), caught.ran),
            None => println!("  NOT CAUGHT in {} seeds", caught.ran),
        }
        caught.rules().iter().for_each(|(rule, count)| println!("  {rule}: {count}"));
    }
}

fn replay(script: &Script) -> bool {
    let outcome = run(script, true);
    println!("seed {}, clock {} ppm, loss {} %", script.seed, script.clock_ppm, script.loss_percent);
    println!("{:#?}", script.arm);
    for line in &outcome.lines {
        println!("{:10.3} ms {:8} {}", line.at_ns as f64 * 1e-6, line.who, line.what);
    }
    println!("digest {:016x}", outcome.digest);
    outcome.verdict.firsts().is_empty()
}

fn range(text: &str) -> Result<(u64, u64)> {
    let (from, to) = text.split_once("..").with_context(|| format!("{text:?} is no range; write 0..200"))?;
    let number = |text: &str| text.parse().with_context(|| format!("{text:?} is no seed"));
    Ok((number(from)?, number(to)?))
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).expect("eval/simulate lies in the workspace")
}
