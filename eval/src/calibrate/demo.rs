//! The arm of the demo with each of its effects: visits to the verdict, beside one measurement plan on the same arm.

use anyhow::{Context as _, Result};
use darm_arm::arm::Arm;
use darm_arm::arm::frames::DesiredFrame;
use darm_diagnose::calibrate::{CalibrateOptions, Task};
use darm_diagnose::diagnosis::{self, diagnose};
use darm_diagnose::measurement_plan::{self, plan};
use darm_diagnose::outcome::Diagnosis;
use darm_diagnose::truth::{Blind, Kind};
use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::shard::Shard;
use darm_measure::median;
use serde::{Deserialize, Serialize};

use super::{Simulated, calibrate};
use darm_demo::ArmKind;

/// Effects of the demo, each with seeds from a first one on.
#[derive(Serialize, Deserialize)]
pub(crate) struct Effects {
    pub(super) seeds: u64,
    pub(super) first_seed: u64,
}

/// What came of one effect and seed.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Course {
    line: String,
    /// Visits at the end of the loop with its own goal.
    visits: usize,
    is_right: bool,
    is_false: bool,
    /// Visits until the same effect is named with an interval as narrow as that of the plan; `None`: never.
    visits_as_narrow: Option<usize>,
    plan_visits: usize,
    is_right_by_plan: bool,
    /// Interval of the loop at its end over that of the plan, the widest value.
    width: Option<f64>,
}

/// The arm of the demo as its synthesis leaves it.
pub(crate) struct Bench {
    arm: Arm,
    frames: Vec<DesiredFrame>,
}

impl Effects {
    fn kind_and_seed(&self, item: usize) -> (Kind, u64) {
        let kinds = Kind::EFFECTS;
        (kinds[item % kinds.len()], self.first_seed + (item / kinds.len()) as u64)
    }
}

impl Job for Effects {
    const COMMAND: &'static str = "calibrate";
    type Bench = Bench;
    type Outcome = Course;

    fn items(&self) -> Result<Vec<String>> {
        let n = self.seeds as usize * Kind::EFFECTS.len();
        Ok((0..n).map(|item| self.kind_and_seed(item)).map(|(kind, seed)| format!("{kind}, seed {seed}")).collect())
    }

    fn bench(&self, _: Shard) -> Result<Bench> {
        let design = ArmKind::Planar.task(self.first_seed, None)?.design()?;
        Ok(Bench { arm: design.arm, frames: design.wanted })
    }

    fn run(&self, bench: &Bench, item: usize) -> Result<Course> {
        let (kind, seed) = self.kind_and_seed(item);
        let steps = plan(&bench.arm, &measurement_plan::PlanOptions { seed, ..Default::default() });
        let truth = Blind::draw(&bench.arm, &steps, &[kind], seed)?;
        let planned = truth.measure(&bench.arm, &steps, 0, !seed)?;
        let by_plan = diagnose(&bench.arm, &planned, &diagnosis::PoseOptions { seed, ..Default::default() })?.diagnosis;
        // The goal of the loop, without its end: the looks after it say when the interval is as narrow as that of the plan.
        let options = CalibrateOptions { seed, goal_m: Some(0.0), ..CalibrateOptions::default() };
        let task = Task { arm: &bench.arm, frames: &bench.frames, options: &options };
        let (mut end, mut as_narrow) = (None, None);
        let mut last = None;
        calibrate(&task, &mut Simulated::new(&bench.arm, &truth, seed), |look, visits| {
            let found = &look.outcome.diagnosis;
            if end.is_none() && look.end_at(CalibrateOptions::default().goal_after(found)).is_some() {
                end = Some((found.clone(), visits));
            }
            if as_narrow.is_none() && width(found, &by_plan).is_some_and(|width| width <= 1.0) {
                as_narrow = Some(visits);
            }
            last = Some((found.clone(), visits));
            end.is_none() || as_narrow.is_none()
        })?;
        let (found, visits) = end.or(last).context("a loop has a look")?;
        let is_right = |found: &Diagnosis| is_right(found, &truth);
        let width = width(&found, &by_plan);
        let line = format!(
            "{seed:4}  {:15} {:22}  {visits:4}  {:>4}  {:>5}  {:22} {}",
            kind.name(),
            truth.unseal()[0].place,
            as_narrow.map_or("-".into(), |visits| visits.to_string()),
            width.map_or("-".into(), |width| format!("{width:.2}")),
            found.verdict.to_string(),
            names(&found),
        );
        Ok(Course {
            line,
            visits,
            is_right: is_right(&found),
            is_false: found.verdict.names_effects() && !is_right(&found),
            visits_as_narrow: as_narrow,
            plan_visits: steps.len(),
            is_right_by_plan: is_right(&by_plan),
            width,
        })
    }

    fn figures(&self, courses: &[Course]) -> Result<Vec<Figure>> {
        println!(
            "seed  effect          place                   visits to the end, to the width of the plan; width over plan"
        );
        courses.iter().for_each(|course| println!("{}", course.line));
        let n = courses.len();
        let count = |name: &str, is: fn(&Course) -> bool| {
            let count = courses.iter().filter(|course| is(course)).count();
            Figure::new(&format!("calibrate: {name}, of {n}"), count as f64, "arms")
        };
        let of = |name: &str, values: &mut dyn Iterator<Item = f64>, unit: &str| {
            Figure::new(&format!("calibrate: {name}"), median_or_nan(values), unit)
        };
        let never = f64::INFINITY;
        let as_narrow = |course: &Course| course.visits_as_narrow.map_or(never, |visits| visits as f64);
        let mut figures = vec![
            count("effects named rightly with their places", |course| course.is_right)?,
            count("the same by one measurement plan", |course| course.is_right_by_plan)?,
            count("false names", |course| course.is_false)?,
            of("visits of one measurement plan", &mut courses.iter().map(|c| c.plan_visits as f64), "visits")?,
            of("visits to the verdict, median", &mut courses.iter().map(|c| c.visits as f64), "visits")?,
            of("interval over that of the plan, median", &mut courses.iter().filter_map(|c| c.width), "times")?,
            of("visits to the verdict and interval of the plan, median", &mut courses.iter().map(as_narrow), "visits")?,
        ];
        for (k, kind) in Kind::EFFECTS.iter().enumerate() {
            let own = courses.iter().skip(k).step_by(Kind::EFFECTS.len());
            let name = format!("{kind}: visits to the verdict and interval of the plan, median");
            figures.push(of(&name, &mut own.map(as_narrow), "visits")?);
        }
        Ok(figures)
    }

    fn seed(&self) -> u64 {
        self.first_seed
    }
}

/// Whether the effect is named at its place, and no other.
fn is_right(found: &Diagnosis, truth: &Blind) -> bool {
    let sealed = &truth.unseal()[0];
    let [effect] = &found.effects[..] else { return false };
    sealed.is_at_part(effect.law, &effect.site.place)
}

/// The widest interval of `found` over that of the same value in `other`; `None` where other effects are named.
fn width(found: &Diagnosis, other: &Diagnosis) -> Option<f64> {
    let same = found.effects.len() == other.effects.len() && !found.effects.is_empty();
    let pairs = found.effects.iter().zip(&other.effects);
    if !same || !pairs.clone().all(|(a, b)| a.law == b.law && a.site.place.part() == b.site.place.part()) {
        return None;
    }
    let width = |ci95: Option<[f64; 2]>| ci95.map(|[low, high]| high - low);
    let ratio = |(a, b): (&darm_diagnose::outcome::EffectValue, &darm_diagnose::outcome::EffectValue)| {
        Some(width(a.ci95)? / width(b.ci95)?)
    };
    pairs.flat_map(|(a, b)| a.values.iter().zip(&b.values)).filter_map(ratio).reduce(f64::max)
}

fn names(found: &Diagnosis) -> String {
    let names: Vec<String> = found.effects.iter().map(|effect| format!("{} {}", effect.law, effect.site)).collect();
    names.join(" + ")
}

/// The middle one; of none NaN.
pub(super) fn median_or_nan(values: impl Iterator<Item = f64>) -> f64 {
    median(values).unwrap_or(f64::NAN)
}
