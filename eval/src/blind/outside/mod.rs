//! Effects that the list of laws does not have, in every kind of measurement: what the verdict says of them.
//!
//! An effect outside the list is planted at 1.5 to 12 times the noise. Right is a verdict that says that something is left, with
//! what it depends on where that was recorded. Wrong is `no-effect`, and `effect-found` with whatever name: it says that the named
//! effect is all there is.

mod benches;
mod numbers;
mod poses;
mod signals;

use anyhow::{Context as _, Result};
use darm_diagnose::diagnosis::{self, diagnose};
use darm_diagnose::outcome::{Dependence, Diagnosis, Regressor, Verdict};
use darm_diagnose::truth::Blind;
use darm_figures::figure::Figure;
use darm_figures::items;
use darm_figures::shard::Shard;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use self::benches::{Drawn, Repeats};
use super::layout::{Layout, MORE_OUTLIERS};
use super::robots::{Robots, Which, diagnosed};
use super::signals::Cause;
use super::{Bench, arms, table};

/// What is planted is as many times the noise.
const TIMES: std::ops::Range<f64> = 1.5..12.0;

/// Logs of every setting.
#[derive(Serialize, Deserialize)]
pub(crate) struct Outside {
    /// Of each setting.
    pub(super) logs: u64,
    pub(super) first_seed: u64,
    /// Settings whose names contain this; all without it.
    pub(super) only: Option<String>,
    /// Whether nothing is planted: how often a clean log of a setting gets `no-effect`.
    pub(super) clean: bool,
    /// Whether a line is printed for every log that is answered wrongly, as it comes.
    #[serde(skip)]
    pub(super) wrong: bool,
}

/// Whether something that the residual may depend on is what was planted.
type Right = Box<dyn Fn(&Regressor) -> bool>;

/// What was planted, sealed until the verdict is written.
struct Secret {
    /// The generator.
    world: &'static str,
    /// Whether something that the residual may depend on is the right one; `None` where nothing that was recorded shows it.
    is_right: Option<Right>,
}

/// What came of one log.
#[derive(Serialize, Deserialize)]
pub(crate) struct Outcome {
    setting: String,
    world: String,
    times: f64,
    answer: Answer,
    /// Whether the variable that is listed first is the right one, and whether any is; `None` where nothing that was recorded shows it.
    variable: Option<[bool; 2]>,
}

/// What a verdict says of an effect that no law has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Answer {
    NoEffect,
    EffectFound,
    Partly,
    Unexplained,
    NotIdentifiable,
    TooLittle,
    WrongModel,
    Error,
}

/// A kind of measurement in a layout.
#[derive(Clone, Copy, Debug)]
enum Setting {
    /// Poses of one of the arms of words.
    Poses(usize, Layout),
    Robot(Which, Layout),
    Tool(bool, Repeats),
    Cylinder(Layout),
    ServoPosition,
}

const ARMS: [&str; 3] = ["planar", "spatial", "hybrid"];
const OF_POSES: [Layout; 9] = [
    Layout::Plan,
    Layout::NoHeldOut,
    Layout::Scattered,
    Layout::ScatteredNoHeldOut,
    Layout::NoRepeats,
    Layout::NothingToCompare,
    Layout::FewRepeats,
    Layout::Short,
    Layout::Outliers,
];
const OF_MOTIONS: [Layout; 3] = [Layout::Plan, Layout::Jitter, Layout::LostRows];

fn settings() -> Vec<Setting> {
    let poses = OF_POSES.into_iter().flat_map(|layout| (0..ARMS.len()).map(move |arm| Setting::Poses(arm, layout)));
    let tools = [Repeats::InPlace, Repeats::Scattered, Repeats::None];
    let tools = tools.into_iter().flat_map(|repeats| [false, true].map(|oriented| Setting::Tool(oriented, repeats)));
    let motions =
        OF_MOTIONS.into_iter().flat_map(|layout| [Setting::Robot(Which::Serial, layout), Setting::Cylinder(layout)]);
    poses
        .chain(tools)
        .chain(motions)
        .chain([Setting::Robot(Which::Floating, Layout::Plan), Setting::ServoPosition])
        .collect()
}

impl Setting {
    fn kind(self) -> String {
        match self {
            Self::Poses(arm, _) => format!("poses of the {} arm", ARMS[arm]),
            Self::Robot(Which::Serial, _) => "torques".into(),
            Self::Robot(Which::Floating, _) => "wrench".into(),
            Self::Tool(false, _) => "tool positions".into(),
            Self::Tool(true, _) => "tool poses".into(),
            Self::Cylinder(_) => "force".into(),
            Self::ServoPosition => "held positions".into(),
        }
    }

    fn name(self) -> String {
        match self {
            Self::Poses(_, layout) | Self::Robot(_, layout) | Self::Cylinder(layout) => {
                format!("{}, {layout:?}", self.kind())
            }
            Self::Tool(_, repeats) => format!("{}, repeats {repeats:?}", self.kind()),
            Self::ServoPosition => self.kind(),
        }
    }
}

impl Outside {
    fn settings(&self) -> Vec<Setting> {
        let is_chosen = |setting: &Setting| self.only.as_ref().is_none_or(|only| setting.name().contains(only));
        settings().into_iter().filter(is_chosen).collect()
    }
}

impl items::Job for Outside {
    const COMMAND: &'static str = "blind --outside";
    type Bench = Bench;
    type Outcome = Outcome;

    fn items(&self) -> Result<Vec<String>> {
        let of = |setting: Setting| (0..self.logs).map(move |k| format!("{} {}", setting.name(), self.first_seed + k));
        Ok(self.settings().into_iter().flat_map(of).collect())
    }

    fn bench(&self, _: Shard) -> Result<Bench> {
        Ok(Bench { subjects: arms::subjects()?, robots: Robots::read()? })
    }

    fn run(&self, bench: &Bench, item: usize) -> Result<Outcome> {
        let setting = self.settings()[item / self.logs as usize];
        let seed = self.first_seed + item as u64 % self.logs;
        let (outcome, answer) =
            run(bench, setting, seed, self.clean).with_context(|| format!("{}, seed {seed}", setting.name()))?;
        let is_wrong = match self.clean {
            true => outcome.answer != Answer::NoEffect,
            false => {
                matches!(outcome.answer, Answer::NoEffect | Answer::EffectFound)
                    || outcome.variable.is_some_and(|[_, any]| !any)
            }
        };
        if self.wrong && is_wrong {
            println!("{} {seed}: {} ({:.1})  ->  {answer}", outcome.setting, outcome.world, outcome.times);
        }
        Ok(outcome)
    }

    fn figures(&self, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
        print(outcomes, "setting", |outcome| &outcome.setting);
        print(outcomes, "generator", |outcome| &outcome.world);
        figures(outcomes, self.clean)
    }

    fn seed(&self) -> u64 {
        self.first_seed
    }
}

/// One log: drawn, planted, diagnosed, revealed.
fn run(bench: &Bench, setting: Setting, seed: u64, clean: bool) -> Result<(Outcome, String)> {
    // Other settings have other generators at the same seed.
    let number = settings().iter().position(|other| other.name() == setting.name()).context("unknown setting")? as u64;
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x0075_1de0_0000 ^ number << 48);
    let times = TIMES.start * (TIMES.end / TIMES.start).powf(rng.random_range(0.0..1.0));
    let times = if clean { 0.0 } else { times };
    let (secret, diagnosis) = match setting {
        Setting::Poses(arm, layout) => poses(bench, (arm, layout), (seed, times), &mut rng)?,
        Setting::Robot(which, layout) => {
            let drawn = benches::robot(&bench.robots, which, &mut rng)?;
            of_signals(drawn, (which, layout), (seed, times), &mut rng)?
        }
        Setting::Tool(oriented, repeats) => {
            let drawn = benches::tool(bench.robots.other(), oriented, repeats, &mut rng)?;
            of_signals(drawn, (Which::Serial, Layout::Plan), (seed, times), &mut rng)?
        }
        Setting::Cylinder(layout) => {
            let drawn = benches::cylinder(&mut rng);
            of_signals(drawn, (Which::Serial, layout), (seed, times), &mut rng)?
        }
        Setting::ServoPosition => {
            let drawn = benches::position_of_servo(&mut rng);
            of_signals(drawn, (Which::Serial, Layout::Plan), (seed, times), &mut rng)?
        }
    };
    let (world, is_right) = (secret.world.to_string(), secret.is_right.filter(|_| !clean));
    let Some(diagnosis) = diagnosis else {
        let outcome = Outcome { setting: setting.name(), world, times, answer: Answer::Error, variable: None };
        return Ok((outcome, "an error".into()));
    };
    let depends_on = &diagnosis.remaining.depends_on;
    let variable = is_right.map(|is_right| {
        let is = |term: &Dependence| is_right(&term.regressor);
        [depends_on.first().is_some_and(is), depends_on.iter().any(is)]
    });
    let outcome = Outcome { setting: setting.name(), world, times, answer: Answer::of(diagnosis.verdict), variable };
    Ok((outcome, in_a_line(&diagnosis)))
}

/// An arm without an effect, measured in a layout, with what no law has.
fn poses(
    bench: &Bench,
    (arm, layout): (usize, Layout),
    (seed, times): (u64, f64),
    rng: &mut ChaCha8Rng,
) -> Result<(Secret, Option<Diagnosis>)> {
    let subject = &bench.subjects[arm];
    let steps = layout.steps(subject.steps(seed), rng);
    let mut blind = Blind::draw(&subject.arm, &steps, &[], seed)?;
    if layout == Layout::Outliers {
        blind.spoil(&subject.arm, MORE_OUTLIERS, rng);
    }
    let scatter_m = blind.scatter_m();
    let worlds = poses::of_arm(&subject.arm);
    let world = worlds[rng.random_range(0..worlds.len())];
    let secret = poses::plant(&subject.arm, blind.measured_mut(), world, (times, scatter_m), rng);
    let outcome = diagnose(&subject.arm, blind.measured(), &diagnosis::PoseOptions::default());
    Ok((secret, outcome.ok().map(|outcome| outcome.diagnosis)))
}

/// A log of signals without an effect, with what no law has.
fn of_signals(
    drawn: Drawn,
    (which, layout): (Which, Layout),
    (seed, times): (u64, f64),
    rng: &mut ChaCha8Rng,
) -> Result<(Secret, Option<Diagnosis>)> {
    let worlds: Vec<_> = signals::WORLDS.iter().filter(|world| world.can_act_on(&drawn.seen)).collect();
    let world = worlds[rng.random_range(0..worlds.len())];
    let (column, secret) = world.plant(&drawn.seen, (times, drawn.noise()), rng);
    let Drawn { what, mut bench, on, .. } = drawn;
    let mut shape = vec![vec![0.0; column.len()]; bench.measured.len()];
    for (axis, share) in on {
        shape[axis] = column.iter().map(|number| share * number).collect();
    }
    bench.add_as_it_is(Cause::Variable(world.name.into()), shape);
    bench.spoil(rng);
    let kept = layout.change_stamps(&mut bench.given[0], rng);
    let mut table = bench.table()?;
    table.retain(&kept);
    if layout.is_of_signals() {
        table.columns.retain(|column| !column.name.starts_with(['v', 'a']));
    }
    Ok((secret, diagnosed(which, what, &table, seed).ok()))
}

impl Answer {
    fn of(verdict: Verdict) -> Self {
        match verdict {
            Verdict::NoEffect => Self::NoEffect,
            Verdict::EffectFound => Self::EffectFound,
            Verdict::PartlyExplained => Self::Partly,
            Verdict::UnexplainedStructure => Self::Unexplained,
            Verdict::NotIdentifiable => Self::NotIdentifiable,
            Verdict::TooLittleData => Self::TooLittle,
            Verdict::WrongModelOrLog => Self::WrongModel,
        }
    }
}

fn in_a_line(diagnosis: &Diagnosis) -> String {
    let effects = diagnosis.effects.iter().map(|found| format!("{} {}", found.law, found.site));
    let terms = diagnosis.remaining.depends_on.iter().map(|term| format!("[{term}]"));
    let reading = diagnosis.other_reading.iter().map(|other| other.misreading.to_string());
    let all: Vec<String> = effects.chain(terms).chain(reading).collect();
    let noise = diagnosis.repeatability.as_ref().map_or(0.0, |noise| noise.norm.value);
    let left = diagnosis.error.after.held_out_or_train().norm.value;
    format!("{} ({:.2}): {}", diagnosis.verdict, left / noise, all.join(" + "))
}

/// Prints the answers to each setting, or to each generator.
fn print(outcomes: &[Outcome], title: &str, of: impl Fn(&Outcome) -> &String) {
    let mut names: Vec<&String> = outcomes.iter().map(&of).collect();
    names.sort_unstable();
    names.dedup();
    let answers = [
        Answer::NoEffect,
        Answer::EffectFound,
        Answer::Partly,
        Answer::Unexplained,
        Answer::NotIdentifiable,
        Answer::TooLittle,
        Answer::WrongModel,
        Answer::Error,
    ];
    let titles = answers.map(|answer| format!("{answer:?}"));
    println!(
        "{title:54} {:>6} {} {:>8} {:>8}",
        "logs",
        titles.map(|t| format!("{t:>15}")).join(" "),
        "first",
        "listed"
    );
    for name in names {
        let own: Vec<&Outcome> = outcomes.iter().filter(|outcome| of(outcome) == name).collect();
        let cells = answers.map(|answer| {
            let n = own.iter().filter(|outcome| outcome.answer == answer).count();
            format!("{n:>15}")
        });
        let variables: Vec<[bool; 2]> = own.iter().filter_map(|outcome| outcome.variable).collect();
        let right = [0, 1].map(|k| {
            let n = variables.iter().filter(|right| right[k]).count();
            format!("{:>8}", format!("{n}/{}", variables.len()))
        });
        println!("{name:54} {:>6} {} {}", own.len(), cells.join(" "), right.join(" "));
    }
}

fn figures(outcomes: &[Outcome], clean: bool) -> Result<Vec<Figure>> {
    let what = if clean { "clean logs of these settings" } else { "outside the list" };
    let mut figures = Vec::new();
    let mut add = |name: &str, of: &[&Outcome]| -> Result<()> {
        let answered = |answers: &[Answer]| of.iter().filter(|outcome| answers.contains(&outcome.answer)).count();
        let mut rate = |title: &str, hits: usize, n: usize| -> Result<()> {
            if n > 0 {
                figures.push(table::rate(&format!("{what}{name}: {title}"), hits, n)?);
            }
            Ok(())
        };
        rate("no-effect", answered(&[Answer::NoEffect]), of.len())?;
        rate("effect-found", answered(&[Answer::EffectFound]), of.len())?;
        rate("more is left, in part or all", answered(&[Answer::Partly, Answer::Unexplained]), of.len())?;
        let variables: Vec<[bool; 2]> = of.iter().filter_map(|outcome| outcome.variable).collect();
        let right = |k: usize| variables.iter().filter(|right| right[k]).count();
        rate("right variable listed first", right(0), variables.len())?;
        rate("right variable listed", right(1), variables.len())
    };
    add("", &outcomes.iter().collect::<Vec<_>>())?;
    let mut kinds: Vec<&str> = outcomes.iter().map(|o| o.setting.split(',').next().unwrap_or_default()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    for kind in kinds {
        let own: Vec<&Outcome> = outcomes.iter().filter(|o| o.setting.split(',').next() == Some(kind)).collect();
        add(&format!(", {kind}"), &own)?;
    }
    Ok(figures)
}
