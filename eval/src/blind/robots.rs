//! Robots that are measured by signals: drawn, measured, diagnosed and marked.

use anyhow::Result;
use darm_diagnose::diagnosis::{SignalOptions, diagnose_table};
use darm_diagnose::linearise::model::{Model, Predictor};
use darm_diagnose::outcome::{Dependence, Diagnosis, Regressor, Verdict};
use darm_diagnose::prepare::signals::Preparation;
use darm_measure::table::Table;
use darm_robot::robot::Robot;
use darm_robot::urdf::{self, Locks};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use xtask::setup;

use super::case::Class;
use super::cells::Cells;
use super::floating::floating;
use super::judge::{Answer, Mark, Named, right};
use super::layout::Layout;
use super::serial::serial;
use super::sets;
use super::signals::{Bench, Cause, PERIODIC, law_of};

/// A robot that is measured by signals.
pub(super) struct Robots {
    serial: Robot,
    floating: Robot,
    /// A robot that is never measured, with as many joints as the serial one.
    other: Robot,
}

/// Which of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Which {
    Serial,
    Floating,
}

impl Which {
    /// The model of a robot that is measured in this way.
    pub(super) fn what(self, robot: Robot) -> Predictor {
        match self {
            Self::Serial => Predictor::Torque(robot, None),
            Self::Floating => Predictor::Wrench(robot),
        }
    }
}

impl Robots {
    pub(super) fn read() -> Result<Self> {
        let read = |name: &str| urdf::read(&setup::root().join("tests/data").join(name), &Locks::new());
        let floating = Robot { floating: true, ..read("measured/human.urdf")? };
        Ok(Self { serial: read("measured/tx40.urdf")?, floating, other: read("urdf/ur10.urdf")? })
    }

    /// Draws, measures, diagnoses and marks one seed; the truth in words.
    pub(super) fn run(&self, which: Which, class: Class, seed: u64) -> Result<(Mark, String)> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xc4a1_0000);
        let (what, mut bench) = self.drawn(which, class, &mut rng)?;
        bench.spoil(&mut rng);
        let table = bench.table()?;
        let diagnosis = diagnosed(which, what, &table, seed)?;
        Ok((mark(&bench, class, &diagnosis)?, bench.truth()))
    }

    /// The same in another layout, without speeds and accelerations in the table; the answer, and the truth in words.
    pub(super) fn in_layout(
        &self,
        which: Which,
        layout: Layout,
        class: Class,
        seed: u64,
    ) -> Result<(Mark, Answer, String)> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x1a70_5160);
        let (what, mut bench) = self.drawn(which, class, &mut rng)?;
        bench.spoil(&mut rng);
        let kept = layout.change_stamps(&mut bench.given[0], &mut rng);
        let mut table = bench.table()?;
        table.retain(&kept);
        table.columns.retain(|column| !column.name.starts_with(['v', 'a']));
        let diagnosis = diagnosed(which, what, &table, seed)?;
        let mark = mark(&bench, class, &diagnosis)?;
        let named = named(&diagnosis);
        let is_clean = class == Class::Clean;
        let answer = if mark.named && (mark.placed || is_clean) {
            Answer::Right
        } else if diagnosis.verdict == Verdict::NotIdentifiable
            && sets::are_indistinct(&bench, &named, &diagnosis, &kept)?
        {
            Answer::Indistinct
        } else {
            Answer::of(is_clean, diagnosis.verdict, &truth(&bench), &named)
        };
        Ok((mark, answer, bench.truth()))
    }

    /// A log of a robot with noise and outliers, beside the robot.
    pub(super) fn log(&self, which: Which, class: Class, rng: &mut ChaCha8Rng) -> Result<(Robot, Cells)> {
        let (_, mut bench) = self.drawn(which, class, rng)?;
        bench.spoil(rng);
        let robot = if which == Which::Serial { &self.serial } else { &self.floating };
        Ok((robot.clone(), Cells::of(&bench.text())))
    }

    /// A robot that is never measured, with as many joints as the serial one.
    pub(super) fn other(&self) -> &Robot {
        &self.other
    }

    /// What the model of a robot is, and a measurement of it without noise.
    pub(super) fn drawn(&self, which: Which, class: Class, rng: &mut ChaCha8Rng) -> Result<(Predictor, Bench)> {
        Ok(match which {
            Which::Serial => (which.what(self.serial.clone()), serial(&self.serial, class, rng)?),
            Which::Floating => (which.what(self.floating.clone()), floating(&self.floating, class, rng)?),
        })
    }
}

pub(super) fn diagnosed(which: Which, what: Predictor, table: &Table, seed: u64) -> Result<Diagnosis> {
    let segment_by = if which == Which::Floating { vec!["posture".to_string()] } else { Vec::new() };
    let preparation = Preparation { segment_by, ..Preparation::default() };
    let options = SignalOptions { preparation, seed, ..SignalOptions::default() };
    Ok(diagnose_table(&Model::from(what), table, &options)?.diagnosis)
}

/// The laws and places that are named, a periodic one once.
fn named(diagnosis: &Diagnosis) -> Vec<Named> {
    let mut named: Vec<Named> = diagnosis.effects.iter().map(|e| (law_of(e.law), e.site.place)).collect();
    named.sort_unstable();
    named.dedup_by(|a, b| a == b && a.0 == PERIODIC);
    named
}

/// The laws and places that are right.
fn truth(bench: &Bench) -> Vec<Named> {
    bench.added.iter().filter_map(|added| added.cause.named()).collect()
}

/// Whether the answer is right, by the rules of [`rules`](super::rules).
fn mark(bench: &Bench, class: Class, diagnosis: &Diagnosis) -> Result<Mark> {
    let mut mark = Mark { ratio: ratio(bench, diagnosis), answer: answer(diagnosis), ..Mark::default() };
    let (named, truth) = (named(diagnosis), truth(bench));
    match class {
        Class::Clean => mark.named = diagnosis.verdict == Verdict::NoEffect,
        Class::Outside => {
            mark.named = diagnosis.verdict == Verdict::UnexplainedStructure && diagnosis.effects.is_empty();
            let first = diagnosis.remaining.depends_on.first();
            let is_right = |term: &Dependence| match &bench.added[0].cause {
                Cause::Variable(name) => {
                    matches!(&term.regressor, Regressor::Signals(names) if names.contains(name))
                }
                Cause::Law(..) => false,
            };
            mark.variable = mark.named && first.is_some_and(is_right);
        }
        Class::One | Class::Two => {
            (mark.named, mark.placed) = match diagnosis.verdict {
                verdict if verdict.names_effects() => right(&truth, &named),
                Verdict::NotIdentifiable => {
                    let are_sets = sets::are_right(bench, &named, diagnosis)?;
                    (are_sets, are_sets)
                }
                _ => (false, false),
            };
        }
    }
    Ok(mark)
}

/// Held-out error on rows that were not spoiled, over the noise that was put in.
fn ratio(bench: &Bench, diagnosis: &Diagnosis) -> f64 {
    let spoiled: Vec<f64> = bench.spoiled.iter().map(|&row| bench.given[0][row]).collect();
    let near = |time_s: f64| spoiled.iter().any(|other| (other - time_s).abs() < 1e-6);
    let good = diagnosis.points.iter().filter(|point| point.held_out && !near(point.time_s));
    let squares: Vec<f64> = good
        .map(|point| point.after.iter().zip(&bench.norm_noise).map(|(r, noise)| (r / noise).powi(2)).sum::<f64>())
        .collect();
    (squares.iter().sum::<f64>() / (squares.len() * bench.norm_noise.len()).max(1) as f64).sqrt()
}

fn answer(diagnosis: &Diagnosis) -> String {
    let effects = diagnosis.effects.iter().map(|found| format!("{} {}", found.law, found.site));
    let others = diagnosis.alternatives.iter().map(|o| format!("({}) {} {}", o.instead_of, o.law, o.site));
    let terms = diagnosis.remaining.depends_on.iter();
    let terms = terms.map(|term| format!("[{}: {term}]", term.axis.as_deref().unwrap_or_default()));
    let reading = diagnosis.other_reading.iter().map(|other| other.misreading.to_string());
    format!(
        "{}: {}",
        diagnosis.verdict,
        effects.chain(others).chain(terms).chain(reading).collect::<Vec<_>>().join(" + ")
    )
}
