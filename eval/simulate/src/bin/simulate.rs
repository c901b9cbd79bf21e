//! `cargo xtask simulate`: many seeds of the complete system under two judges.

use std::ops::Range;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context as _, Result};
use clap::Parser;
use darm_figures::figure::Figures;
use darm_figures::items::{self, Job as _, Spread};
use darm_sim::in_process::Chip;
use darm_simulate::markdown;
use darm_simulate::mutants::Mutants;
use darm_simulate::run::run;
use darm_simulate::script::Script;
use darm_simulate::seeds::Seeds;
use darm_simulate::shrink::shrink;
use darm_simulate::summary::{self, Record, Violated};

/// Failing seeds that are shown when they are shrunk.
const SHOWN: usize = 5;

/// Runs the complete system in virtual time under two judges; prints what they find
#[derive(Parser)]
#[command(name = "cargo xtask simulate", bin_name = "cargo xtask simulate")]
struct Arguments {
    /// Seeds from A to B, B not included
    #[arg(long, value_name = "A..B", default_value = "0..200")]
    seeds: String,
    /// Print what happens in one seed, line by line
    #[arg(long, value_name = "SEED")]
    replay: Option<u64>,
    /// The chip whose flash and times the board has: stm32l475 or rp2040; a mutant says its own
    #[arg(long, default_value_t, conflicts_with = "mutants")]
    chip: Chip,
    #[command(flatten)]
    spread: Spread,
    /// Put known defects in, one by one, and see in how many seeds the judges find each
    #[arg(long)]
    mutants: bool,
    /// Only the mutants of these names, with commas between them
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "mutants")]
    only: Vec<String>,
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
            Some(seed) => Ok(replay(&Script::on(self.chip, seed))),
            None if self.mutants => self.run_mutants(),
            None => self.run_seeds(),
        }
    }

    fn run_seeds(&self) -> Result<bool> {
        let seeds = range(&self.seeds)?;
        let from = seeds.start;
        let began = Instant::now();
        let Some(records) = items::outcomes(&Seeds::new(seeds, self.chip, self.until_broken), &self.spread)? else {
            return Ok(true);
        };
        let took_s = began.elapsed().as_secs_f64();
        let failed: Vec<&Record> = records.iter().filter(|record| !record.violations.is_empty()).collect();
        let shown = if self.no_shrink { failed.len() } else { SHOWN };
        failed.iter().take(shown).for_each(|record| self.show(record));
        let figures = Figures::new(summary::figures(&records)?, from);
        let markdown = markdown::figures(&figures.rows);
        print!("{}", if self.markdown { markdown } else { figures.text() });
        let per_seed_s = took_s * rayon::current_num_threads() as f64 / records.len().max(1) as f64;
        eprintln!("{took_s:.1} s, {per_seed_s:.2} s of one core per seed");
        if let Some(path) = &self.spread.json {
            figures.write(path)?;
        }
        Ok(failed.is_empty())
    }

    fn show(&self, record: &Record) {
        let seed = record.seed;
        for Violated { rule, at_ms, sentence, count, .. } in &record.violations {
            println!("seed {seed}, {rule} at {at_ms} ms: {sentence} ({count} times)");
        }
        let Some(first) = record.violations.first().filter(|_| !self.no_shrink) else { return };
        let small = shrink(&Script::on(self.chip, seed), &first.rule);
        println!("  {} needs only:", first.rule);
        small.host.iter().for_each(|entry| println!("  {:6} ms host  {:?}", entry.at_ms, entry.act));
        small.second.iter().for_each(|entry| println!("  {:6} ms second {:?}", entry.at_ms, entry.act));
        small.world.iter().for_each(|entry| println!("  {:6} ms world {:?}", entry.at_ms, entry.act));
    }

    /// True when each mutant was caught.
    fn run_mutants(&self) -> Result<bool> {
        let job = Mutants::new(&self.only, range(&self.seeds)?, self.all_seeds)?;
        let Some(caught) = items::outcomes(&job, &self.spread)? else { return Ok(true) };
        items::report(&job, &caught, self.spread.json.as_deref())?;
        if self.markdown {
            println!("{}", markdown::MUTANTS);
            let lines = job.items()?.into_iter().zip(&caught);
            lines.for_each(|(name, caught)| println!("{}", markdown::mutant(&name, caught)));
        }
        Ok(caught.iter().all(|caught| !caught.broken.is_empty()))
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

fn range(text: &str) -> Result<Range<u64>> {
    let (from, to) = text.split_once("..").with_context(|| format!("{text:?} is not a range; write 0..200"))?;
    let number = |text: &str| text.parse().with_context(|| format!("{text:?} is not a seed"));
    Ok(number(from)?..number(to)?)
}
