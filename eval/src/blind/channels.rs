//! Arms that are measured by channels: torques of a serial arm in motion, wrench under a floating base in held postures.
//!
//! The nominal torques and weights are those of the model, since that is what is diagnosed; what is added has equations of
//! its own:
//!
//! | mechanism | equation |
//! | --- | --- |
//! | dry friction | c·v/√(v² + v₀²) |
//! | thick grease | d·v/(1 + 0.1·\|v\|/v_max) |
//! | a hose that pulls | c |
//! | a cable that winds up | k·q |
//! | a heavy motor | J·a |
//! | a lump bolted to a link | m·(p̈ − g) by virtual work, p̈ by differences of the forward kinematics |
//! | cogging | c·sin(7·q) |
//! | a hose that another joint pulls taut, outside the list | c·max(q of the other less the middle of its range, 0)² |
//! | a backpack on a link, held postures | weight of a point, by statics |
//! | a plate that drifts, outside the list | Δ(cop x) = c·sin(2πt/P) |

use std::path::Path;

use anyhow::Result;
use darm_diagnose::diagnosis::{SignalOptions, diagnose_table};
use darm_diagnose::linearise::model::{Model, What};
use darm_diagnose::measurement::root_mean_square;
use darm_diagnose::measurement::table::{Names, Table};
use darm_diagnose::outcome::{Diagnosis, Verdict};
use darm_diagnose::prepare::signals::Preparation;
use darm_robot::robot::Robot;
use darm_robot::urdf::{self, Locks};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::case::Class;
use super::floating::floating;
use super::judge::{Mark, right};
use super::serial::serial;
use super::sets::{self, Elsewhere};
use xtask::setup;

/// Outliers: share of the rows, in units of the noise.
const OUTLIERS: f64 = 0.02;
const OUTLIER_NOISES: f64 = 60.0;
/// Size of a mechanism on its axis, in units of the noise.
const TIMES_NOISE: std::ops::Range<f64> = 8.0..32.0;
/// Postures and motions reach so far from the middle of each joint's range, rad.
pub(super) const SWING_RAD: f64 = 0.7;
/// Error of a gear, as a sine, a cosine or both.
pub(super) const PERIODIC: &str = "gear-periodic";

/// A robot that is measured by channels.
pub(super) struct Robots {
    serial: Robot,
    floating: Robot,
}

/// Which of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Which {
    Serial,
    Floating,
}

/// What was added, and where; `law` is empty where none is right.
pub(super) struct Added {
    pub(super) law: &'static str,
    pub(super) place: String,
    /// What the residual depends on where no law is right.
    variable: String,
    /// What it adds on each axis.
    pub(super) shape: Vec<Vec<f64>>,
}

impl Robots {
    pub(super) fn read() -> Result<Self> {
        let read = |name: &str| urdf::read(&setup::root().join("tests/data/measured").join(name), &Locks::new());
        Ok(Self { serial: read("tx40.urdf")?, floating: Robot { floating: true, ..read("human.urdf")? } })
    }

    /// Draws, measures, diagnoses and marks one seed; the truth in words.
    pub(super) fn run(&self, which: Which, class: Class, seed: u64) -> Result<(Mark, String)> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xc4a1_0000);
        let (what, mut bench) = match which {
            Which::Serial => (What::Torque(self.serial.clone(), None), serial(&self.serial, class, &mut rng)?),
            Which::Floating => (What::Wrench(self.floating.clone()), floating(&self.floating, class, &mut rng)?),
        };
        let model = Model::from(what);
        bench.spoil(&mut rng);
        let table = bench.table()?;
        let within = if which == Which::Floating { vec!["posture".to_string()] } else { Vec::new() };
        let preparation = Preparation { within, ..Preparation::default() };
        let diagnosis =
            diagnose_table(&model, &table, &SignalOptions { preparation, always: Vec::new(), seed })?.diagnosis;
        Ok((bench.mark(class, &diagnosis)?, bench.truth()))
    }
}

/// One measurement that is being made.
pub(super) struct Bench {
    /// Columns of the table that are not measured with noise.
    pub(super) names: Vec<String>,
    pub(super) given: Vec<Vec<f64>>,
    /// Those that are, with their noise.
    pub(super) axes: Vec<String>,
    pub(super) measured: Vec<Vec<f64>>,
    pub(super) noise: Vec<f64>,
    pub(super) spoiled: Vec<usize>,
    pub(super) added: Vec<Added>,
    /// Axes of the diagnosis that make the norm, and their noise.
    pub(super) norm_noise: Vec<f64>,
    /// What the model predicts.
    pub(super) nominal: Vec<Vec<f64>>,
    /// What laws add under other conditions.
    pub(super) elsewhere: Option<Box<dyn Elsewhere>>,
}

impl Bench {
    /// A bench on which nothing is added yet: names and numbers of what is given, of what the model predicts, its noise,
    /// and that of the axes that make the norm.
    pub(super) fn new(
        (names, given): (Vec<String>, Vec<Vec<f64>>),
        (axes, nominal): (Vec<String>, Vec<Vec<f64>>),
        noise: Vec<f64>,
        norm_noise: Vec<f64>,
    ) -> Self {
        let (measured, spoiled, added) = (nominal.clone(), Vec::new(), Vec::new());
        Self { names, given, axes, measured, noise, spoiled, added, norm_noise, nominal, elsewhere: None }
    }

    fn rows(&self) -> usize {
        self.given.first().map_or(0, Vec::len)
    }

    /// Adds noise and outliers.
    fn spoil(&mut self, rng: &mut ChaCha8Rng) {
        let rows = self.rows();
        for (channel, noise) in self.measured.iter_mut().zip(&self.noise) {
            channel.iter_mut().for_each(|value| *value += noise * normal(rng));
        }
        for row in 0..rows {
            if rng.random_bool(OUTLIERS) {
                let axis = rng.random_range(0..self.measured.len());
                self.measured[axis][row] += OUTLIER_NOISES * self.noise[axis] * normal(rng).signum();
                self.spoiled.push(row);
            }
        }
    }

    fn table(&self) -> Result<Table> {
        let mut text = [self.names.join(","), self.axes.join(",")].join(",") + ",temperature_c,supply_v\n";
        for row in 0..self.rows() {
            let numbers = self.given.iter().chain(&self.measured).map(|channel| format!("{:.9}", channel[row]));
            let slow = row as f64 / self.rows() as f64;
            let distractors = [20.0 + 8.0 * slow, 24.0 - (7.0 * slow).sin()].map(|number| format!("{number:.4}"));
            text += &numbers.chain(distractors).collect::<Vec<_>>().join(",");
            text.push('\n');
        }
        Ok(Table::read_text(Path::new("blind.csv"), text.as_bytes(), &Names::new())?.0)
    }

    fn truth(&self) -> String {
        let one = |added: &Added| format!("{} {}{}", added.law, added.place, added.variable);
        self.added.iter().map(one).collect::<Vec<_>>().join(" + ")
    }

    /// Adds a mechanism of a drawn size: `shape` tells it on each axis.
    pub(super) fn add(
        &mut self,
        law: &'static str,
        place: String,
        variable: String,
        shape: Vec<Vec<f64>>,
        rng: &mut ChaCha8Rng,
    ) {
        let noises = shape.iter().zip(&self.noise).map(|(column, noise)| root_mean_square(column) / noise);
        let largest = noises.fold(f64::MIN_POSITIVE, f64::max);
        let size = rng.random_range(TIMES_NOISE) / largest;
        let shape: Vec<Vec<f64>> = shape.into_iter().map(|axis| axis.iter().map(|x| size * x).collect()).collect();
        for (channel, column) in self.measured.iter_mut().zip(&shape) {
            channel.iter_mut().zip(column).for_each(|(value, more)| *value += more);
        }
        self.added.push(Added { law, place, variable, shape });
    }

    fn mark(&self, class: Class, diagnosis: &Diagnosis) -> Result<Mark> {
        let mut mark = Mark { ratio: self.ratio(diagnosis), answer: answer(diagnosis), ..Mark::default() };
        let mut named: Vec<(&str, &str)> =
            diagnosis.effects.iter().map(|e| (law_of(e.law.as_str()), joint_of(&e.site.code))).collect();
        named.sort_unstable();
        named.dedup_by(|a, b| a == b && a.0 == PERIODIC);
        let truth: Vec<(&str, &str)> = self.added.iter().map(|added| (added.law, added.place.as_str())).collect();
        match class {
            Class::Clean => mark.named = diagnosis.verdict == Verdict::NoEffect,
            Class::Outside => {
                mark.named = diagnosis.verdict == Verdict::UnexplainedStructure && diagnosis.effects.is_empty();
                let first = diagnosis.remaining.depends_on.first();
                mark.variable =
                    mark.named && first.is_some_and(|term| term.to_string().contains(&self.added[0].variable));
            }
            Class::One | Class::Two => {
                (mark.named, mark.placed) = match diagnosis.verdict {
                    Verdict::EffectFound => right(&truth, &named),
                    Verdict::NotIdentifiable => {
                        let are_sets = sets::are_right(self, &named, diagnosis)?;
                        (are_sets, are_sets)
                    }
                    _ => (false, false),
                };
            }
        }
        Ok(mark)
    }

    /// Held-out error on rows that were not spoiled, over the noise that was put in.
    fn ratio(&self, diagnosis: &Diagnosis) -> f64 {
        let spoiled: Vec<f64> = self.spoiled.iter().map(|&row| self.given[0][row]).collect();
        let near = |time_s: f64| spoiled.iter().any(|other| (other - time_s).abs() < 1e-6);
        let good = diagnosis.points.iter().filter(|point| point.held_out && !near(point.time_s));
        let squares: Vec<f64> = good
            .map(|point| point.after.iter().zip(&self.norm_noise).map(|(r, noise)| (r / noise).powi(2)).sum::<f64>())
            .collect();
        (squares.iter().sum::<f64>() / (squares.len() * self.norm_noise.len()).max(1) as f64).sqrt()
    }
}

/// The law, of whatever phase where it is periodic.
pub(super) fn law_of(name: &'static str) -> &'static str {
    if name.starts_with(PERIODIC) { PERIODIC } else { name }
}

/// `joint 3` of `joint 3 (joint_3)`.
pub(super) fn joint_of(place: &str) -> &str {
    place.split(" (").next().unwrap_or(place)
}

fn answer(diagnosis: &Diagnosis) -> String {
    let effects = diagnosis.effects.iter().map(|found| format!("{} {}", found.law, found.site));
    let others = diagnosis.alternatives.iter().map(|o| format!("({}) {} {}", o.instead_of, o.law, o.site));
    let terms = diagnosis.remaining.depends_on.iter();
    let terms = terms.map(|term| format!("[{}: {term}]", term.axis.as_deref().unwrap_or_default()));
    format!("{}: {}", diagnosis.verdict, effects.chain(others).chain(terms).collect::<Vec<_>>().join(" + "))
}

/// Standard normal, by the polar method.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    loop {
        let (x, y) = (rng.random_range(-1.0..1.0f64), rng.random_range(-1.0..1.0f64));
        let square = x * x + y * y;
        if square > 0.0 && square < 1.0 {
            return x * (-2.0 * square.ln() / square).sqrt();
        }
    }
}

pub(super) fn middle(limits: Option<[f64; 2]>) -> f64 {
    limits.map_or(0.0, |[low, high]| 0.5 * (low + high))
}
