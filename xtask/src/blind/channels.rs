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

use std::f64::consts::TAU;
use std::path::Path;

use anyhow::{Context, Result};
use darm::diagnose::channels::model::{Model, What};
use darm::diagnose::channels::outcome::Diagnosis;
use darm::diagnose::channels::prepared::{HoldOut, Preparation};
use darm::diagnose::channels::{Options, diagnose_table};
use darm::diagnose::outcome::Verdict;
use darm::measurement::table::{Names, Table};
use darm::robot::{Motion, Robot};
use darm::urdf::{self, Locks};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::case::Class;
use super::floating::{Postures, floating};
use super::judge::{Mark, right};
use crate::setup;

/// Rows a second of the serial arm, and how long it moves.
const RATE_HZ: f64 = 20.0;
const MOTION_S: f64 = 40.0;
/// Noise: share of the root mean square of a torque.
const TORQUE_NOISE: f64 = 0.02;
/// Outliers: share of the rows, in units of the noise.
const OUTLIERS: f64 = 0.02;
const OUTLIER_NOISES: f64 = 60.0;
/// Size of a mechanism on its axis, in units of the noise.
const TIMES_NOISE: std::ops::Range<f64> = 8.0..32.0;
/// Step of the differences, s.
const STEP_S: f64 = 1e-3;
/// Postures and motions reach so far from the middle of each joint's range, rad.
pub(super) const SWING_RAD: f64 = 0.7;
/// Speed below which dry friction falls, rad/s.
const CREEP_RAD_S: f64 = 0.02;
/// Mechanisms of a serial arm inside the list, the lump among them.
const MECHANISMS: usize = 7;
const LUMP: usize = 5;
/// Error of a gear, as a sine, a cosine or both.
const PERIODIC: &str = "gear-periodic";

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
    law: &'static str,
    place: String,
    /// What the residual depends on where no law is right.
    variable: String,
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
        let preparation = Preparation {
            keep: None,
            hold_out: HoldOut::Own,
            within,
            rate_hz: None,
            thin_hz: None,
            lowpass_hz: None,
            interpolate: None,
            settled_s: None,
        };
        let diagnosis = diagnose_table(&model, &table, &Options { preparation, always: Vec::new(), seed })?;
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
    /// Of a floating base: where it stood.
    pub(super) postures: Option<Postures>,
}

impl Bench {
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
        let noises = shape.iter().zip(&self.noise).map(|(column, noise)| rms(column) / noise);
        let largest = noises.fold(f64::MIN_POSITIVE, f64::max);
        let size = rng.random_range(TIMES_NOISE) / largest;
        for (channel, column) in self.measured.iter_mut().zip(&shape) {
            channel.iter_mut().zip(column).for_each(|(value, more)| *value += size * more);
        }
        self.added.push(Added { law, place, variable });
    }

    fn mark(&self, class: Class, diagnosis: &Diagnosis) -> Result<Mark> {
        let mut mark = Mark { ratio: self.ratio(diagnosis), answer: answer(diagnosis), ..Mark::default() };
        let mut named: Vec<(&str, &str)> =
            diagnosis.effects.iter().map(|e| (law_of(e.law), joint_of(&e.place))).collect();
        named.sort_unstable();
        named.dedup_by(|a, b| a == b && a.0 == PERIODIC);
        let truth: Vec<(&str, &str)> = self.added.iter().map(|added| (added.law, added.place.as_str())).collect();
        match class {
            Class::Clean => mark.named = diagnosis.verdict == Verdict::NoEffect,
            Class::Outside => {
                mark.named = diagnosis.verdict == Verdict::UnexplainedStructure && diagnosis.effects.is_empty();
                let first = diagnosis.remaining.first();
                mark.variable = mark.named && first.is_some_and(|term| term.term.contains(&self.added[0].variable));
            }
            Class::One | Class::Two => {
                (mark.named, mark.placed) = match (diagnosis.verdict, &self.postures) {
                    (Verdict::EffectFound, _) => right(&truth, &named),
                    (Verdict::NotIdentifiable, Some(postures)) => {
                        let is_set = postures.is_set(self, &truth, diagnosis)?;
                        (is_set, is_set)
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
fn law_of(name: &'static str) -> &'static str {
    if name.starts_with(PERIODIC) { PERIODIC } else { name }
}

/// `joint 3` of `joint 3 (joint_3)`.
fn joint_of(place: &str) -> &str {
    place.split(" (").next().unwrap_or(place)
}

fn answer(diagnosis: &Diagnosis) -> String {
    let effects = diagnosis.effects.iter().map(|found| format!("{} {}", found.law, found.place));
    let others = diagnosis.alternatives.iter().map(|o| format!("({}) {} {}", o.instead_of, o.law, o.place));
    let terms = diagnosis.remaining.iter().map(|term| format!("[{}: {}]", term.axis, term.term));
    format!("{}: {}", diagnosis.verdict, effects.chain(others).chain(terms).collect::<Vec<_>>().join(" + "))
}

pub(super) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
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

/// A smooth motion of one joint: position, velocity, acceleration.
struct Swing {
    middle: f64,
    waves: Vec<[f64; 3]>,
}

impl Swing {
    fn draw(limits: Option<[f64; 2]>, rng: &mut ChaCha8Rng) -> Self {
        let waves = (1..=4).map(|k| {
            let pulse = TAU * 0.07 * f64::from(k) * rng.random_range(0.8..1.2);
            [SWING_RAD / 2.0 * rng.random_range(0.3..1.0), pulse, rng.random_range(0.0..TAU)]
        });
        Self { middle: middle(limits), waves: waves.collect() }
    }

    fn at(&self, time_s: f64) -> [f64; 3] {
        let mut sums = [self.middle, 0.0, 0.0];
        for [size, pulse, phase] in &self.waves {
            let (sin, cos) = (pulse * time_s + phase).sin_cos();
            sums[0] += size * sin;
            sums[1] += size * pulse * cos;
            sums[2] -= size * pulse * pulse * sin;
        }
        sums
    }
}

pub(super) fn middle(limits: Option<[f64; 2]>) -> f64 {
    limits.map_or(0.0, |[low, high]| 0.5 * (low + high))
}

fn serial(robot: &Robot, class: Class, rng: &mut ChaCha8Rng) -> Result<Bench> {
    let n = robot.joints.len();
    let swings: Vec<Swing> = robot.joints.iter().map(|joint| Swing::draw(joint.limits, rng)).collect();
    let times: Vec<f64> = (0..(RATE_HZ * MOTION_S) as usize).map(|row| row as f64 / RATE_HZ).collect();
    let state = |time_s: f64| -> [Vec<f64>; 3] {
        let all: Vec<[f64; 3]> = swings.iter().map(|swing| swing.at(time_s)).collect();
        [0, 1, 2].map(|order| all.iter().map(|joint| joint[order]).collect())
    };
    let mut given = vec![times.clone()];
    let mut measured = vec![Vec::new(); n];
    let mut channels = vec![Vec::new(); 3 * n];
    for &time_s in &times {
        let [q, v, a] = state(time_s);
        let torque = robot.dynamics(&Motion { state: [&q, &v, &a], load: None })?.torque;
        measured.iter_mut().zip(torque).for_each(|(channel, torque)| channel.push(torque));
        let all = q.into_iter().chain(v).chain(a);
        channels.iter_mut().zip(all).for_each(|(channel, number)| channel.push(number));
    }
    given.extend(channels);
    let named = |what: &str, unit: &str| (1..=n).map(|k| format!("{what}{k}{unit}")).collect::<Vec<_>>();
    let names = [vec!["time_s".to_string()], named("q", "_rad"), named("v", "_rad/s"), named("a", "")].concat();
    let noise: Vec<f64> = measured.iter().map(|channel| TORQUE_NOISE * rms(channel).max(1.0)).collect();
    let (norm_noise, axes) = (noise.clone(), named("tau", "_nm"));
    let (spoiled, added) = (Vec::new(), Vec::new());
    let mut bench = Bench { names, given, axes, measured, noise, spoiled, added, norm_noise, postures: None };
    let mechanisms: Vec<usize> = match class {
        Class::Clean => Vec::new(),
        Class::Outside => {
            let pulled = rng.random_range(0..n);
            let puller = (pulled + rng.random_range(1..n)) % n;
            let middle = middle(robot.joints[puller].limits);
            let mut shape = vec![vec![0.0; times.len()]; n];
            shape[pulled] = bench.given[1 + puller].iter().map(|q| (q - middle).max(0.0).powi(2)).collect();
            bench.add("", String::new(), format!("position of joint {}", puller + 1), shape, rng);
            Vec::new()
        }
        Class::One => vec![rng.random_range(0..MECHANISMS)],
        Class::Two => {
            let first = rng.random_range(0..MECHANISMS);
            vec![first, (first + rng.random_range(1..MECHANISMS)) % MECHANISMS]
        }
    };
    for mechanism in mechanisms {
        if mechanism == LUMP {
            // On the first link, whose axis is upright, a lump is a heavy motor.
            let joint = rng.random_range(1..n);
            let shape = lump(robot, joint, &times, &state)?;
            bench.add("mass-distribution", robot.joints[joint].link.clone(), String::new(), shape, rng);
            continue;
        }
        let joint = rng.random_range(0..n);
        let (law, column) = of_joint(mechanism, joint, n, &bench.given);
        let mut shape = vec![vec![0.0; times.len()]; n];
        shape[joint] = column;
        bench.add(law, format!("joint {}", joint + 1), String::new(), shape, rng);
    }
    Ok(bench)
}

/// The law that is right, and the shape of a mechanism at one joint.
fn of_joint(mechanism: usize, joint: usize, n: usize, given: &[Vec<f64>]) -> (&'static str, Vec<f64>) {
    let [q, v, a] = [0, 1, 2].map(|order| &given[1 + order * n + joint]);
    let fastest = v.iter().fold(1e-9, |most: f64, v| most.max(v.abs()));
    let of = |channel: &[f64], shape: &dyn Fn(f64) -> f64| channel.iter().map(|&x| shape(x)).collect::<Vec<f64>>();
    match mechanism {
        0 => ("coulomb-friction", of(v, &|v| v / (v * v + CREEP_RAD_S.powi(2)).sqrt())),
        1 => ("viscous-friction", of(v, &|v| v / (1.0 + 0.1 * v.abs() / fastest))),
        2 => ("offset", of(v, &|_| 1.0)),
        3 => ("spring", of(q, &|q| q)),
        4 => ("rotor-inertia", of(a, &|a| a)),
        _ => (PERIODIC, of(q, &|q| (7.0 * q).sin())),
    }
}

/// Torques of a mass of 1 kg bolted to the frame of a joint's link, 0.1 m off its origin.
fn lump(robot: &Robot, joint: usize, times: &[f64], state: &dyn Fn(f64) -> [Vec<f64>; 3]) -> Result<Vec<Vec<f64>>> {
    let n = robot.joints.len();
    let link = &robot.joints[joint].link;
    let frame = robot.frame(link).context("a link without a frame")?;
    let off = darm_core::real::Vec3::new(0.1, 0.05, 0.08);
    let point = |q: &[f64]| robot.kinematics(frame, q).map(|k| k.pose_base_frame * off);
    let mut torques = vec![Vec::new(); n];
    for &time_s in times {
        let at = |time_s: f64| point(&state(time_s)[0]);
        let (before, now, after) = (at(time_s - STEP_S)?, at(time_s)?, at(time_s + STEP_S)?);
        let force = (after - now * 2.0 + before) / STEP_S.powi(2) - robot.gravity;
        let q = &state(time_s)[0];
        for (k, torque) in torques.iter_mut().enumerate() {
            let mut moved = q.clone();
            moved[k] += STEP_S;
            torque.push(force.dot(&(point(&moved)? - now)) / STEP_S);
        }
    }
    Ok(torques)
}
