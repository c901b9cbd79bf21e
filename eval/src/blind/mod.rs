//! The blind suite: arms with effects that nobody declared, diagnosed, and only then compared with the truth.
//!
//! Which answer is right is in `rules`, written before the first run. Baselines see the same data.

mod arms;
mod baseline;
mod case;
mod cells;
mod damage;
mod damage_of_poses;
mod damage_of_signals;
mod damages;
mod floating;
mod judge;
mod layout;
mod layouts;
mod mechanisms;
mod outside;
mod robots;
mod rules;
mod serial;
mod sets;
mod signals;
mod table;

use anyhow::Result;
use clap::ValueEnum;
use darm_diagnose::diagnosis;
use darm_diagnose::diagnosis::diagnose;
use darm_figures::figure::Figure;
use darm_figures::items::{self, Spread};
use darm_figures::shard::Shard;
use serde::{Deserialize, Serialize};

pub(crate) use arms::{Subject, subjects};
use case::Class;

pub(crate) use damages::Damages;
use judge::Mark;
pub(crate) use layout::Layout;
pub(crate) use layouts::Layouts;
pub(crate) use mechanisms::Mechanisms;
pub(crate) use outside::Outside;
use robots::{Robots, Which};
pub(crate) use table::rate;

/// Diagnoses arms with hidden effects, seed by seed; prints rates with their intervals beside baselines
#[derive(clap::Args)]
pub(crate) struct Blind {
    #[command(flatten)]
    job: Job,
    /// Draw each mechanism alone, a few times, in place of the seeds
    #[arg(long, conflicts_with_all = ["seeds", "arm", "wrong"])]
    mechanisms: bool,
    /// Draw N clean and N changed arms in every layout of measurements that others use, in place of the seeds
    #[arg(long, value_name = "N", conflicts_with_all = ["seeds", "arm", "mechanisms"])]
    layouts: Option<u64>,
    /// Diagnose N logs of every sort of wrong model, wrong log and unusable log, in place of the seeds
    #[arg(long, value_name = "N", conflicts_with_all = ["seeds", "arm", "mechanisms", "layouts"])]
    damages: Option<u64>,
    /// Plant effects that no law has in N logs of every kind of measurement and layout, in place of the seeds
    #[arg(long, value_name = "N", conflicts_with_all = ["seeds", "arm", "mechanisms", "layouts", "damages"])]
    outside: Option<u64>,
    /// Of these logs those only whose kind and layout contain this text
    #[arg(long, value_name = "TEXT", requires = "outside")]
    only: Option<String>,
    /// Plant nothing in these logs
    #[arg(long, requires = "outside")]
    clean: bool,
    /// These layouts only
    #[arg(long, value_enum, value_delimiter = ',', requires = "layouts")]
    layout: Vec<Layout>,
    #[command(flatten)]
    spread: Spread,
}

/// The seeds and arms of a run.
#[derive(clap::Args, Serialize, Deserialize)]
pub(crate) struct Job {
    /// How many seeds: of ten, five are clean, two have one effect, two have two, one has an effect outside the list of laws
    #[arg(long, default_value_t = 200)]
    seeds: u64,
    /// The first seed
    #[arg(long, default_value_t = 0)]
    first_seed: u64,
    /// One arm only, in place of all in turn
    #[arg(long, value_enum)]
    arm: Option<ArmKind>,
    /// Print a line for every seed that was marked wrong, as it comes; of damaged logs for each
    #[arg(long)]
    #[serde(skip)]
    wrong: bool,
}

/// An arm of the suite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum ArmKind {
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
#[derive(Serialize, Deserialize)]
pub(crate) struct Outcome {
    seed: u64,
    arm: ArmKind,
    class: Class,
    truth: String,
    darm: Mark,
    /// Of tool poses.
    baselines: Option<baseline::Marks>,
}

impl Blind {
    pub(crate) fn run(&self) -> Result<()> {
        if self.mechanisms {
            return items::run(&Mechanisms { first_seed: self.job.first_seed }, &self.spread);
        }
        if let Some(arms) = self.layouts {
            let Job { first_seed, wrong, .. } = self.job;
            return items::run(&Layouts { arms, first_seed, layouts: self.layout.clone(), wrong }, &self.spread);
        }
        if let Some(logs) = self.damages {
            let Job { first_seed, wrong, .. } = self.job;
            return items::run(&Damages { logs, first_seed, messages: wrong }, &self.spread);
        }
        if let Some(logs) = self.outside {
            let Job { first_seed, wrong, .. } = self.job;
            let Self { only, clean, .. } = self;
            return items::run(&Outside { logs, first_seed, only: only.clone(), clean: *clean, wrong }, &self.spread);
        }
        items::run(&self.job, &self.spread)
    }
}

impl items::Job for Job {
    const COMMAND: &'static str = "blind";
    type Bench = Bench;
    type Outcome = Outcome;

    fn items(&self) -> Result<Vec<String>> {
        Ok((0..self.seeds).map(|k| format!("seed {}", self.first_seed + k)).collect())
    }

    fn bench(&self, _: Shard) -> Result<Bench> {
        Ok(Bench { subjects: arms::subjects()?, robots: Robots::read()? })
    }

    fn run(&self, bench: &Bench, item: usize) -> Result<Outcome> {
        let seed = self.first_seed + item as u64;
        let outcome = bench.outcome(self.arm.unwrap_or(ArmKind::of(seed)), seed)?;
        if self.wrong && outcome.is_wrong() {
            println!("{}", outcome.line());
        }
        Ok(outcome)
    }

    fn figures(&self, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
        table::by_arm(outcomes);
        table::figures(outcomes)
    }

    fn seed(&self) -> u64 {
        self.first_seed
    }
}

/// All arms.
pub(crate) struct Bench {
    subjects: [Subject; 3],
    robots: Robots,
}

impl ArmKind {
    /// The arm of a seed.
    fn of(seed: u64) -> Self {
        [Self::Planar, Self::Spatial, Self::Hybrid, Self::Serial, Self::Floating][(seed / 10) as usize % 5]
    }
}

impl Bench {
    /// One seed: drawn, diagnosed, revealed, marked.
    fn outcome(&self, arm: ArmKind, seed: u64) -> Result<Outcome> {
        let class = Class::of(seed);
        let [planar, spatial, hybrid] = &self.subjects;
        let which = match arm {
            ArmKind::Planar => return poses(planar, arm, seed),
            ArmKind::Spatial => return poses(spatial, arm, seed),
            ArmKind::Hybrid => return poses(hybrid, arm, seed),
            ArmKind::Serial => Which::Serial,
            ArmKind::Floating => Which::Floating,
        };
        let (darm, truth) = self.robots.run(which, class, seed)?;
        Ok(Outcome { seed, arm, class, truth, darm, baselines: None })
    }
}

fn poses(subject: &Subject, arm: ArmKind, seed: u64) -> Result<Outcome> {
    let class = Class::of(seed);
    let blind = case::draw(subject, seed)?;
    let diagnosis = diagnose(&subject.arm, blind.measured(), &diagnosis::PoseOptions::default())?;
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
    use darm_diagnose::truth::Kind;

    use super::arms;
    use darm_figures::items::Job as _;
    use darm_figures::shard::Shard;

    use super::layout::Layout;
    use super::layouts::Layouts;
    use super::mechanisms::mark;

    /// A sample; `blind --layouts` has all of them. The second of these clean arms once got a step in its last rows.
    #[test]
    fn an_arm_without_effects_gets_no_name_in_a_layout_without_anything_to_compare() {
        let layouts = vec![Layout::NothingToCompare];
        let job = Layouts { arms: 2, first_seed: 0, layouts, wrong: false };
        let bench = job.bench(Shard::ALL).unwrap();
        for clean in [0, 2] {
            let outcome = job.run(&bench, clean).unwrap();
            assert!(!outcome.answer.is_wrong(), "{clean}: {:?}", outcome.answer);
        }
    }

    /// A clean arm, of which a step was selected that held-out rows veto; and a joint that is off its encoder by so little that
    /// its torque is a third of the noise: constant torques of two joints take as much of it.
    #[test]
    fn what_hardly_shows_in_torques_gets_no_wrong_name() {
        let outcome = |layout, first_seed, item| {
            let job = Layouts { arms: 2, first_seed, layouts: vec![layout], wrong: false };
            job.run(&job.bench(Shard::ALL).unwrap(), item).unwrap()
        };
        assert!(!outcome(Layout::RoundedStamps, 300_002, 0).answer.is_wrong());
        assert!(!outcome(Layout::LostRows, 300_024, 3).answer.is_wrong());
    }

    /// A sample; `blind --mechanisms` has all of them.
    #[test]
    fn the_law_of_a_mechanism_is_found_and_no_other_gets_a_name() {
        let subjects = arms::subjects().unwrap();
        let inside = mark(&subjects, Kind::StrokeLoss, 1).unwrap();
        assert!(inside.placed, "{}", inside.answer);
        let outside = mark(&subjects, darm_diagnose::truth::Blind::OUTSIDE[0], 1).unwrap();
        assert!(outside.named, "{}", outside.answer);
    }
}
