//! The blind suite: arms with effects that nobody declared, diagnosed, and only then compared with the truth.
//!
//! Which answer is right stands in `rules`, written before the first run. Baselines see the same data.

mod arms;
mod case;
mod judge;
mod rules;
mod table;

use std::path::PathBuf;

use anyhow::{Context, Result};
use darm::diagnose::{self, diagnose};
use rayon::prelude::*;

use crate::figures::tell;
use crate::progress::Progress;
use case::Class;
use judge::Mark;

/// Diagnoses arms with hidden effects, seed by seed; prints rates with their intervals beside baselines
#[derive(clap::Args)]
pub(crate) struct Blind {
    /// How many seeds: of ten, five are clean, two have one effect, two have two, one has what no law knows
    #[arg(long, default_value_t = 200)]
    seeds: u64,
    /// The first seed
    #[arg(long, default_value_t = 0)]
    first_seed: u64,
    /// Print a line for every seed that was marked wrong
    #[arg(long)]
    wrong: bool,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What came of one seed.
struct Outcome {
    seed: u64,
    arm: &'static str,
    class: Class,
    truth: String,
    darm: Mark,
}

impl Blind {
    pub(crate) fn run(&self) -> Result<()> {
        let progress = Progress::shown();
        progress.say("choosing the words of each arm");
        let subjects = arms::subjects()?;
        let bar = progress.bar("seeds", self.seeds);
        let seeds: Vec<u64> = (self.first_seed..self.first_seed + self.seeds).collect();
        let outcomes: Vec<Outcome> = seeds
            .par_iter()
            .map(|&seed| {
                let outcome = outcome(case::subject(&subjects, seed), seed).with_context(|| format!("seed {seed}"));
                bar.inc(1);
                outcome
            })
            .collect::<Result<_>>()?;
        bar.finish_and_clear();
        if self.wrong {
            outcomes.iter().filter(|outcome| outcome.is_wrong()).for_each(|outcome| println!("{}", outcome.line()));
        }
        let figures = table::figures(&outcomes)?;
        tell(&figures, self.first_seed, self.json.as_deref())
    }
}

/// One seed: drawn, diagnosed, unsealed, marked.
fn outcome(subject: &arms::Subject, seed: u64) -> Result<Outcome> {
    let class = Class::of(seed);
    let blind = case::draw(subject, seed)?;
    let diagnosis = diagnose(&subject.arm, blind.measured(), &diagnose::Options::default())?;
    let darm = judge::mark(&subject.arm, class, &blind, &diagnosis)?;
    let truth: Vec<String> = blind
        .unseal()
        .iter()
        .map(|sealed| format!("{} {} ({:.0})", sealed.effect, sealed.place, sealed.times_scatter))
        .collect();
    Ok(Outcome { seed, arm: subject.name, class, truth: truth.join(" + "), darm })
}

impl Outcome {
    fn is_wrong(&self) -> bool {
        let Mark { named, placed, ratio, variable, covered, .. } = &self.darm;
        match self.class {
            Class::Clean => !named,
            Class::Outside => !variable,
            Class::One | Class::Two => !placed || *ratio > table::RATIO || covered[0] < covered[1],
        }
    }

    fn line(&self) -> String {
        let Mark { named, placed, ratio, covered: [hits, n], answer, .. } = &self.darm;
        let marks = format!("{}{} {ratio:.2} {hits}/{n}", if *named { "n" } else { "-" }, if *placed { "p" } else { "-" });
        format!("{:5} {:14} {:7} {marks}  {}  ->  {answer}", self.seed, self.arm, self.class.name(), self.truth)
    }
}
