//! Every layout of measurements with the same number of clean and changed arms: false alarms, false names, names, refusals.

use anyhow::{Context as _, Result};
use clap::ValueEnum as _;
use darm_core::effect::Place as Part;
use darm_diagnose::diagnosis;
use darm_diagnose::diagnosis::diagnose;
use darm_diagnose::effect::{Detail, LawName, Place};
use darm_figures::figure::Figure;
use darm_figures::items;
use darm_figures::shard::Shard;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::case::{self, Class};
use super::judge::{self, Answer, Named};
use super::layout::{Layout, MORE_OUTLIERS};
use super::robots::Which;
use super::{Bench, arms, robots::Robots, table};

/// Arms of every layout.
#[derive(Serialize, Deserialize)]
pub(crate) struct Layouts {
    /// Of each layout: how many clean arms, and as many changed ones.
    pub(super) arms: u64,
    pub(super) first_seed: u64,
    /// These layouts only; without any all of them.
    pub(super) layouts: Vec<Layout>,
    /// Whether a line is printed for every wrong answer, as it comes.
    #[serde(skip)]
    pub(super) wrong: bool,
}

/// What came of one arm.
#[derive(Serialize, Deserialize)]
pub(crate) struct Outcome {
    layout: Layout,
    class: Class,
    pub(super) answer: Answer,
    /// Intervals that hold the true value, of how many.
    covered: [usize; 2],
}

impl Layouts {
    fn layouts(&self) -> Vec<Layout> {
        if self.layouts.is_empty() { Layout::value_variants().to_vec() } else { self.layouts.clone() }
    }

    /// Layout, class and seed of an item.
    fn item(&self, item: usize) -> (Layout, Class, u64) {
        let per_layout = 2 * self.arms as usize;
        let number = item % per_layout;
        let class = [Class::Clean, Class::One, Class::Clean, Class::Two][number % 4];
        (self.layouts()[item / per_layout], class, self.first_seed + number as u64)
    }
}

impl items::Job for Layouts {
    const COMMAND: &'static str = "blind --layouts";
    type Bench = Bench;
    type Outcome = Outcome;

    fn items(&self) -> Result<Vec<String>> {
        let name = |layout: &Layout| layout.to_possible_value().map(|value| value.get_name().to_string());
        let numbers = 0..2 * self.arms;
        let of = |layout: &Layout| {
            let name = name(layout).context("a layout without a name")?;
            Ok(numbers.clone().map(move |k| format!("{name} {}", self.first_seed + k)).collect::<Vec<_>>())
        };
        Ok(self.layouts().iter().map(of).collect::<Result<Vec<_>>>()?.concat())
    }

    fn bench(&self, _: Shard) -> Result<Bench> {
        Ok(Bench { subjects: arms::subjects()?, robots: Robots::read()? })
    }

    fn run(&self, bench: &Bench, item: usize) -> Result<Outcome> {
        let (layout, class, seed) = self.item(item);
        let outcome = run(bench, layout, class, seed).with_context(|| format!("{layout:?}, seed {seed}"))?;
        if self.wrong && outcome.0.answer.is_wrong() {
            println!("{layout:?} {seed} {:?} {}", outcome.0.answer, outcome.1);
        }
        Ok(outcome.0)
    }

    fn figures(&self, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
        // Those of other runs may be among the outcomes.
        let is_drawn = |layout: &Layout| outcomes.iter().any(|outcome| outcome.layout == *layout);
        let layouts: Vec<Layout> = Layout::value_variants().iter().copied().filter(is_drawn).collect();
        by_layout(outcomes, &layouts);
        figures(outcomes, &layouts)
    }

    fn seed(&self) -> u64 {
        self.first_seed
    }
}

/// One arm in one layout, and in words what was true and what was answered.
fn run(bench: &Bench, layout: Layout, class: Class, seed: u64) -> Result<(Outcome, String)> {
    if layout.is_of_signals() {
        let which = [Which::Serial, Which::Floating][seed as usize / 4 % 2];
        let (mark, answer, truth) = bench.robots.in_layout(which, layout, class, seed)?;
        return Ok((Outcome { layout, class, answer, covered: [0, 0] }, format!("{truth}  ->  {}", mark.answer)));
    }
    let subject = &bench.subjects[seed as usize / 4 % 3];
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x1a70_0000);
    let steps = layout.steps(subject.steps(seed), &mut rng);
    let mut blind = case::draw_from(subject, &steps, (class, seed), |kind| layout.allows(kind))?;
    if layout == Layout::Outliers {
        blind.spoil(&subject.arm, MORE_OUTLIERS, &mut rng);
    }
    let scatter_m = blind.scatter_m();
    layout.change(blind.measured_mut(), scatter_m, &mut rng);
    let truth: Vec<String> =
        blind.unseal().iter().map(|sealed| format!("{} {}", sealed.effect, sealed.place)).collect();
    let outcome = match diagnose(&subject.arm, blind.measured(), &diagnosis::PoseOptions::default()) {
        Ok(outcome) => outcome,
        Err(error) => {
            let answer = Answer::Refused;
            return Ok((Outcome { layout, class, answer, covered: [0, 0] }, error.to_string()));
        }
    };
    let mark = judge::mark(&subject.arm, class, &blind, &outcome)?;
    let found = &outcome.diagnosis;
    let named: Vec<Named> = found.effects.iter().map(judge::law_and_part).collect();
    let mut right = judge::pairs(blind.unseal());
    let is_clean = blind.unseal().is_empty() && layout != Layout::CameraDrift;
    right.extend((layout == Layout::CameraDrift).then_some((LawName::BaseDrift, Place::Arm(Part::Base, Detail::All))));
    let is_right = match layout {
        Layout::CameraDrift => found.verdict.names_effects() && judge::right(&right, &named).1,
        _ => mark.named && (mark.placed || class == Class::Clean),
    };
    let answer = if is_right { Answer::Right } else { Answer::of(is_clean, found.verdict, &right, &named) };
    let outcome = Outcome { layout, class, answer, covered: mark.covered };
    Ok((outcome, format!("{}  ->  {}", truth.join(" + "), mark.answer)))
}

/// Of the outcomes of a layout, how many clean (or changed) arms had this answer, of how many.
fn count(outcomes: &[Outcome], layout: Option<Layout>, clean: bool, so: impl Fn(&Answer) -> bool) -> [usize; 2] {
    let chosen = outcomes.iter().filter(|o| layout.is_none_or(|l| l == o.layout) && (o.class == Class::Clean) == clean);
    chosen.fold([0, 0], |[hits, n], outcome| [hits + usize::from(so(&outcome.answer)), n + 1])
}

/// Prints hits and tries of each layout.
fn by_layout(outcomes: &[Outcome], layouts: &[Layout]) {
    let titles = ["false alarms", "right", "indistinct", "refused", "missed", "false names"];
    println!("{:22} {}", "layout", titles.map(|title| format!("{title:>13}")).join(" "));
    for layout in layouts {
        let cell = |clean: bool, answer: fn(&Answer) -> bool| {
            let [hits, n] = count(outcomes, Some(*layout), clean, answer);
            format!("{:>13}", format!("{hits} of {n}"))
        };
        let cells = [
            cell(true, Answer::is_wrong),
            cell(false, |answer| *answer == Answer::Right),
            cell(false, |answer| *answer == Answer::Indistinct),
            cell(false, |answer| *answer == Answer::Refused),
            cell(false, |answer| *answer == Answer::Missed),
            cell(false, |answer| *answer == Answer::FalseName),
        ];
        println!("{:22} {}", format!("{layout:?}"), cells.join(" "));
    }
}

fn figures(outcomes: &[Outcome], layouts: &[Layout]) -> Result<Vec<Figure>> {
    let rate = |name: String, [hits, n]: [usize; 2]| table::rate(&name, hits, n);
    let mut figures = Vec::new();
    for layout in layouts {
        let name = layout.to_possible_value().context("a layout without a name")?.get_name().to_string();
        let of = |clean, so: fn(&Answer) -> bool| count(outcomes, Some(*layout), clean, so);
        figures.push(rate(format!("layout {name}: false alarms"), of(true, Answer::is_wrong))?);
        figures.push(rate(format!("layout {name}: false names"), of(false, |answer| *answer == Answer::FalseName))?);
        if layout.suffices() {
            // Rows that do not distinguish an effect from others do not suffice for its name.
            let [n_indistinct, _] = of(false, |answer| *answer == Answer::Indistinct);
            let [right, n] = of(false, |answer| *answer == Answer::Right);
            figures.push(rate(format!("layout {name}: named rightly"), [right, n - n_indistinct])?);
            figures.push(rate(format!("layout {name}: indistinct from others"), [n_indistinct, n])?);
        }
        figures.push(rate(format!("layout {name}: refused"), of(false, |answer| *answer == Answer::Refused))?);
    }
    let pooled = |clean, so: fn(&Answer) -> bool| count(outcomes, None, clean, so);
    figures.push(rate("layouts: false alarms".into(), pooled(true, Answer::is_wrong))?);
    figures.push(rate("layouts: false names".into(), pooled(false, |answer| *answer == Answer::FalseName))?);
    let covered = outcomes.iter().fold([0, 0], |[hits, n], o| [hits + o.covered[0], n + o.covered[1]]);
    figures.push(rate("layouts: intervals that hold the true value".into(), covered)?);
    Ok(figures)
}
