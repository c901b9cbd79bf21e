//! Wrong models, wrong logs and unusable logs: whether any effect is named in them, and whether the wrong ones are recognised.

use std::collections::BTreeMap;

use anyhow::{Context as _, Result};
use darm_diagnose::diagnosis::{self, diagnose};
use darm_diagnose::error::DiagnoseError;
use darm_diagnose::outcome::{Diagnosis, Verdict};
use darm_figures::figure::Figure;
use darm_figures::items;
use darm_figures::shard::Shard;
use darm_measure::poses::{self, Which as Rows};
use darm_measure::write_text;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::case::{self, Class};
use super::cells::Cells;
use super::damage::{Sort, Wrong};
use super::damage_of_poses::{self as of_poses, PoseLog};
use super::damage_of_signals::{self as of_signals, SignalLog};
use super::robots::{Which, diagnosed};
use super::{Bench, arms, robots::Robots, table};

/// Logs of every sort.
#[derive(Serialize, Deserialize)]
pub(crate) struct Damages {
    /// Of each sort.
    pub(super) logs: u64,
    pub(super) first_seed: u64,
    /// Whether a line is printed for every log, as it comes, with what was answered.
    #[serde(skip)]
    pub(super) messages: bool,
}

/// Which measurement is damaged, and in which way.
enum Kind {
    Poses(Sort<PoseLog>),
    Signals(Which, Sort<SignalLog>),
}

/// What was answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
enum Answer {
    /// An error, with its reason.
    Refused,
    /// The verdict that the model or the log is wrong.
    Recognised,
    /// Another verdict that names no effect.
    NoName,
    /// An effect.
    Named,
}

/// What came of one log.
#[derive(Serialize, Deserialize)]
pub(crate) struct Outcome {
    sort: String,
    wrong: Wrong,
    answer: Answer,
}

impl Kind {
    fn all() -> Vec<Self> {
        let poses = of_poses::WRONG.into_iter().chain(of_poses::UNUSABLE).map(Self::Poses);
        let torques = of_signals::WRONG_TORQUES.into_iter().chain(of_signals::UNUSABLE_TORQUES);
        let torques = torques.map(|sort| Self::Signals(Which::Serial, sort));
        let wrenches = of_signals::WRONG_WRENCHES.into_iter().map(|sort| Self::Signals(Which::Floating, sort));
        poses.chain(torques).chain(wrenches).collect()
    }

    fn name(&self) -> String {
        match self {
            Self::Poses(sort) => format!("poses: {}", sort.name),
            Self::Signals(Which::Serial, sort) => format!("torques: {}", sort.name),
            Self::Signals(Which::Floating, sort) => format!("wrench: {}", sort.name),
        }
    }

    fn wrong(&self) -> Wrong {
        match self {
            Self::Poses(sort) => sort.wrong,
            Self::Signals(_, sort) => sort.wrong,
        }
    }
}

impl items::Job for Damages {
    const COMMAND: &'static str = "blind --damages";
    type Bench = Bench;
    type Outcome = Outcome;

    fn items(&self) -> Result<Vec<String>> {
        let of = |kind: &Kind| (0..self.logs).map(|k| format!("{} {}", kind.name(), self.first_seed + k)).collect();
        Ok(Kind::all().iter().flat_map(|kind| -> Vec<String> { of(kind) }).collect())
    }

    fn bench(&self, _: Shard) -> Result<Bench> {
        Ok(Bench { subjects: arms::subjects()?, robots: Robots::read()? })
    }

    fn run(&self, bench: &Bench, item: usize) -> Result<Outcome> {
        let kind = Kind::all().swap_remove(item / self.logs as usize);
        let seed = self.first_seed + item as u64 % self.logs;
        let (sort, wrong) = (kind.name(), kind.wrong());
        let (answer, text) = answer(bench, &kind, seed).with_context(|| format!("{sort}, seed {seed}"))?;
        if self.messages {
            println!("{sort}, seed {seed}: {answer:?}: {text}");
        }
        Ok(Outcome { sort, wrong, answer })
    }

    fn figures(&self, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
        by_sort(outcomes);
        figures(outcomes)
    }

    fn seed(&self) -> u64 {
        self.first_seed
    }
}

/// Draws a log, damages and diagnoses it; what was answered, and that in words. Every second log has a missing effect as well.
fn answer(bench: &Bench, kind: &Kind, seed: u64) -> Result<(Answer, String)> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xda3a_6e00);
    let class = [Class::Clean, Class::One][seed as usize % 2];
    let diagnosis = match kind {
        Kind::Poses(sort) => {
            let subject = &bench.subjects[seed as usize / 2 % 3];
            let blind = case::draw_from(subject, subject.steps(seed), (class, seed), |_| true)?;
            let mut log = PoseLog { arm: subject.arm.clone(), cells: Cells::of(&write_text(blind.measured())) };
            (sort.change)(&mut log, &mut rng);
            diagnosis_of_poses(&log)
        }
        Kind::Signals(which, sort) => {
            let (robot, cells) = bench.robots.log(*which, class, &mut rng)?;
            let mut log = SignalLog { robot, other: bench.robots.other().clone(), cells };
            (sort.change)(&mut log, &mut rng);
            log.cells.table().and_then(|table| diagnosed(*which, which.what(log.robot), &table, seed))
        }
    };
    Ok(match diagnosis {
        Err(error) => (Answer::Refused, format!("{error:#}")),
        Ok(diagnosis) => {
            let answer = match diagnosis.verdict {
                Verdict::WrongModelOrLog => Answer::Recognised,
                _ if diagnosis.effects.is_empty() => Answer::NoName,
                _ => Answer::Named,
            };
            (answer, diagnosis.plain.join(" "))
        }
    })
}

fn diagnosis_of_poses(log: &PoseLog) -> Result<Diagnosis> {
    let (run, _) = poses::of_table(&log.cells.table()?, &Rows::default())?;
    if run.samples.is_empty() {
        anyhow::bail!("no row is left");
    }
    let outcome: Result<_, DiagnoseError> = diagnose(&log.arm, &run, &diagnosis::PoseOptions::default());
    Ok(outcome?.diagnosis)
}

/// Prints how many logs of each sort were answered in which way.
fn by_sort(outcomes: &[Outcome]) {
    let mut sorts: BTreeMap<(Wrong, &str), BTreeMap<Answer, usize>> = BTreeMap::new();
    for outcome in outcomes {
        *sorts.entry((outcome.wrong, &outcome.sort)).or_default().entry(outcome.answer).or_default() += 1;
    }
    println!("{:60} {:>8} {:>10} {:>8} {:>6}", "log", "refused", "recognised", "no name", "named");
    for ((_, sort), answers) in sorts {
        let [refused, recognised, no_name, named] =
            [Answer::Refused, Answer::Recognised, Answer::NoName, Answer::Named].map(|a| answers.get(&a).unwrap_or(&0));
        println!("{sort:60} {refused:>8} {recognised:>10} {no_name:>8} {named:>6}");
    }
}

fn figures(outcomes: &[Outcome]) -> Result<Vec<Figure>> {
    let rate = |name: &str, wrong: Wrong, so: fn(Answer) -> bool| {
        let of = outcomes.iter().filter(|outcome| outcome.wrong == wrong);
        let [hits, n] = of.fold([0, 0], |[hits, n], o| [hits + usize::from(so(o.answer)), n + 1]);
        table::rate(name, hits, n)
    };
    Ok(vec![
        rate("wrong model or log: recognised or refused", Wrong::ModelOrLog, |answer| {
            matches!(answer, Answer::Recognised | Answer::Refused)
        })?,
        rate("wrong model or log: taken for an effect", Wrong::ModelOrLog, |answer| answer == Answer::Named)?,
        rate("unusable log: taken for an effect", Wrong::Unusable, |answer| answer == Answer::Named)?,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seeds of the planar arm, clean and with an effect.
    const SEEDS: [u64; 2] = [9_000_000, 9_000_001];

    fn bench() -> Bench {
        Bench { subjects: arms::subjects().unwrap(), robots: Robots::read().unwrap() }
    }

    #[test]
    fn no_effect_is_named_in_poses_of_any_sort_of_damage() {
        let bench = bench();
        let poses = Kind::all().into_iter().filter(|kind| matches!(kind, Kind::Poses(_)));
        for (k, kind) in poses.enumerate() {
            let seed = SEEDS[k % 2];
            let (answer, text) = answer(&bench, &kind, seed).unwrap();
            assert_ne!(answer, Answer::Named, "{}, seed {seed}: {text}", kind.name());
        }
    }

    /// Changed masses of all links explain the torques of another robot, most of which cannot be identified; one effect explains
    /// fifteen rows.
    #[test]
    fn no_effect_is_named_in_torques_of_another_robot_or_of_few_rows() {
        let bench = bench();
        for (name, seed) in [("the model of another robot", 1_000_002), ("twenty rows", 1_000_003)] {
            let name = format!("torques: {name}");
            let kind = Kind::all().into_iter().find(|kind| kind.name() == name).unwrap();
            let (answer, text) = answer(&bench, &kind, seed).unwrap();
            assert_ne!(answer, Answer::Named, "{name}, seed {seed}: {text}");
        }
    }
}
