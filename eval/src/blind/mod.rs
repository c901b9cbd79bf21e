//! The blind suite: arms with effects that nobody declared, diagnosed, and only then compared with the truth.
//!
//! Which answer is right stands in `rules`, written before the first run. Baselines see the same data.

mod arms;
mod baseline;
mod case;
mod channels;
mod floating;
mod judge;
mod rules;
mod serial;
mod sets;
mod table;

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::ValueEnum;
use darm_diagnose::diagnosis;
use darm_diagnose::diagnosis::diagnose;
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};

use crate::figures::tell;
use crate::progress::Progress;
use arms::Subject;
use case::Class;
use channels::{Robots, Which};
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
    /// One arm only, in place of all in turn
    #[arg(long, value_enum)]
    arm: Option<Kin>,
    /// Print a line for every seed that was marked wrong, as it comes
    #[arg(long)]
    wrong: bool,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// An arm of the suite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
enum Kin {
    /// Four planar modules, tool poses
    Planar,
    /// Three modules of six legs, tool poses
    Spatial,
    /// Four planar modules on a servo joint, tool poses
    Hybrid,
    /// Six joints, torques in motion
    Serial,
    /// A floating base in held postures, contact wrench
    Floating,
}

/// What came of one seed.
struct Outcome {
    seed: u64,
    arm: Kin,
    class: Class,
    truth: String,
    darm: Mark,
    /// Of tool poses.
    baselines: Option<baseline::Marks>,
}

impl Blind {
    pub(crate) fn run(&self) -> Result<()> {
        let progress = Progress::shown();
        let bench = Bench { subjects: arms::subjects()?, robots: Robots::read()? };
        let bar = progress.bar("seeds", self.seeds);
        let seeds: Vec<u64> = (self.first_seed..self.first_seed + self.seeds).collect();
        let outcomes: Vec<Outcome> = seeds
            .par_iter()
            .map(|&seed| {
                let arm = self.arm.unwrap_or(Kin::of(seed));
                let outcome = bench.outcome(arm, seed).with_context(|| format!("seed {seed}"));
                bar.inc(1);
                let outcome = outcome?;
                if self.wrong && outcome.is_wrong() {
                    println!("{}", outcome.line());
                }
                Ok(outcome)
            })
            .collect::<Result<_>>()?;
        bar.finish_and_clear();
        table::by_arm(&outcomes);
        let figures = table::figures(&outcomes)?;
        tell(&figures, self.first_seed, self.json.as_deref())
    }
}

/// All arms.
struct Bench {
    subjects: [Subject; 3],
    robots: Robots,
}

impl Kin {
    /// The arm of a seed.
    fn of(seed: u64) -> Self {
        [Self::Planar, Self::Spatial, Self::Hybrid, Self::Serial, Self::Floating][(seed / 10) as usize % 5]
    }
}

impl Bench {
    /// One seed: drawn, diagnosed, unsealed, marked.
    fn outcome(&self, arm: Kin, seed: u64) -> Result<Outcome> {
        let class = Class::of(seed);
        let [planar, spatial, hybrid] = &self.subjects;
        let which = match arm {
            Kin::Planar => return poses(planar, arm, seed),
            Kin::Spatial => return poses(spatial, arm, seed),
            Kin::Hybrid => return poses(hybrid, arm, seed),
            Kin::Serial => Which::Serial,
            Kin::Floating => Which::Floating,
        };
        let (darm, truth) = self.robots.run(which, class, seed)?;
        Ok(Outcome { seed, arm, class, truth, darm, baselines: None })
    }
}

fn poses(subject: &Subject, arm: Kin, seed: u64) -> Result<Outcome> {
    let class = Class::of(seed);
    let blind = case::draw(subject, seed)?;
    let diagnosis = diagnose(&subject.arm, blind.measured(), &diagnosis::Options::default())?;
    let darm = judge::mark(&subject.arm, class, &blind, &diagnosis)?;
    let baselines = baseline::marks(&subject.arm, class, &blind)?;
    let truth: Vec<String> = blind
        .unseal()
        .iter()
        .map(|sealed| format!("{} {} ({:.0})", sealed.effect, sealed.place, sealed.times_scatter))
        .collect();
    Ok(Outcome { seed, arm, class, truth: truth.join(" + "), darm, baselines: Some(baselines) })
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
        let marks =
            format!("{}{} {ratio:.2} {hits}/{n}", if *named { "n" } else { "-" }, if *placed { "p" } else { "-" });
        let arm = format!("{:?}", self.arm);
        format!("{:5} {arm:8} {:7} {marks}  {}  ->  {answer}", self.seed, self.class.name(), self.truth)
    }
}

#[cfg(test)]
mod tests {
    use darm_diagnose::truth::{self, Kind};

    use super::*;

    const SEED: u64 = 1;
    /// Of so many seeds one has to be a case that the law alone explains: sizes and conditions are drawn.
    const CASES: u64 = 4;

    /// A mechanism in the planar arm; on a servo where it needs one.
    fn mark(subjects: &[Subject; 3], kind: Kind, seed: u64) -> Mark {
        let subject = if kind == Kind::JointOffset { &subjects[2] } else { &subjects[0] };
        let blind = truth::Blind::draw(&subject.arm, subject.steps(seed), &[kind], seed).unwrap();
        let diagnosis = diagnose(&subject.arm, blind.measured(), &diagnosis::Options::default()).unwrap();
        let class = if truth::Blind::INSIDE.contains(&kind) { Class::One } else { Class::Outside };
        judge::mark(&subject.arm, class, &blind, &diagnosis).unwrap()
    }

    #[test]
    fn each_mechanism_has_a_case_that_its_own_law_alone_explains() {
        let subjects = arms::subjects().unwrap();
        truth::Blind::INSIDE.par_iter().for_each(|&kind| {
            let mut told = Vec::new();
            let alone = (SEED..SEED + CASES).any(|seed| {
                let mark = mark(&subjects, kind, seed);
                told.push(mark.answer);
                mark.placed
            });
            assert!(alone, "{kind}: {told:?}");
        });
    }

    #[test]
    fn what_no_law_knows_is_given_no_name() {
        let subjects = arms::subjects().unwrap();
        truth::Blind::OUTSIDE.par_iter().for_each(|&kind| {
            let mark = mark(&subjects, kind, SEED);
            assert!(mark.named, "{kind:?}: {}", mark.answer);
        });
    }
}
