//! `cargo xtask simulate`: many seeds of the whole system under two judges.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context as _, Result};
use clap::Parser;
use darm_eval::mutants;
use darm_eval::run::{Outcome, run};
use darm_eval::script::Script;
use darm_eval::shrink::shrink;
use darm_eval::summary;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

/// Failing seeds that are shown when they are shrunk.
const SHOWN: usize = 5;

/// Runs the whole system in virtual time under two judges; prints what they find
#[derive(Parser)]
#[command(name = "cargo xtask simulate")]
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
            None if self.mutants => self.run_mutants().map(|()| true),
            None => self.run_seeds(),
        }
    }

    fn run_seeds(&self) -> Result<bool> {
        let (from, to) = range(&self.seeds)?;
        let began = Instant::now();
        let outcomes: Vec<Outcome> = (from..to).into_par_iter().map(|seed| run(&Script::of(seed), false)).collect();
        let took_s = began.elapsed().as_secs_f64();
        let failed: Vec<&Outcome> = outcomes.iter().filter(|outcome| !outcome.verdict.firsts().is_empty()).collect();
        let shown = if self.no_shrink { failed.len() } else { SHOWN };
        for outcome in failed.iter().take(shown) {
            self.show(outcome);
        }
        let rows = summary::with_goals(summary::rows(&outcomes), &root().join("tests/goals.toml"))?;
        print!("{}", summary::text(&rows));
        let per_seed_s = took_s * rayon::current_num_threads() as f64 / outcomes.len().max(1) as f64;
        eprintln!("{took_s:.1} s, {per_seed_s:.2} s of one core per seed");
        if let Some(path) = &self.json {
            summary::write_json(&rows, from, path)?;
        }
        Ok(failed.is_empty())
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
        small.world.iter().for_each(|entry| println!("  {:6} ms world {:?}", entry.at_ms, entry.act));
    }

    fn run_mutants(&self) -> Result<()> {
        let (root, scratch) = (root(), root().join("target/mutants"));
        let wanted = |mutant: &mutants::Mutant| self.only.as_ref().is_none_or(|only| *only == mutant.name);
        let clean = mutants::judge(root, &scratch, None, &self.seeds)?;
        println!("(unchanged): {} seeds, {:?}", clean.seeds, clean.rules);
        for mutant in mutants::list(&root.join("eval/mutants"))?.iter().filter(|mutant| wanted(mutant)) {
            let caught = mutants::judge(root, &scratch, Some(mutant), &self.seeds)?;
            println!("{}: {}", mutant.name, mutant.description.trim());
            let more = caught.more_than(&clean);
            more.iter().for_each(|(rule, count, before)| println!("  {rule}: {count} seeds, unchanged {before}"));
            if more.is_empty() {
                println!("  NOT CAUGHT");
            }
        }
        Ok(())
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
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("eval/ lies in the workspace")
}
