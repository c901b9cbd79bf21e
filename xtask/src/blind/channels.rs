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
//! | cogging, outside the list | c·sin(7·q) |
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
use super::judge::{Mark, right};
use crate::setup;

/// Rows a second of the serial arm, and how long it moves.
const RATE_HZ: f64 = 20.0;
const MOTION_S: f64 = 40.0;
/// Held postures of the floating base, and rows of each.
const POSTURES: usize = 64;
const HELD: usize = 6;
/// Noise: share of the root mean square of a torque; shift of the centre of pressure, m; forces, N; moments, N·m.
const TORQUE_NOISE: f64 = 0.02;
const COP_NOISE_M: f64 = 0.2e-3;
const FORCE_NOISE_N: f64 = 0.3;
/// Outliers: share of the rows, in units of the noise.
const OUTLIERS: f64 = 0.02;
const OUTLIER_NOISES: f64 = 60.0;
/// Size of a mechanism on its axis, in units of the noise.
const TIMES_NOISE: std::ops::Range<f64> = 8.0..32.0;
/// Step of the differences, s.
const STEP_S: f64 = 1e-3;
/// Postures and motions reach so far from the middle of each joint's range, rad.
const SWING_RAD: f64 = 0.7;
/// Speed below which dry friction falls, rad/s.
const CREEP_RAD_S: f64 = 0.02;

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
struct Added {
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
        Ok((bench.mark(class, &diagnosis), bench.truth()))
    }
}

/// One measurement that is being made.
struct Bench {
    /// Columns of the table that are not measured with noise.
    names: Vec<String>,
    given: Vec<Vec<f64>>,
    /// Those that are, with their noise.
    axes: Vec<String>,
    measured: Vec<Vec<f64>>,
    noise: Vec<f64>,
    spoiled: Vec<usize>,
    added: Vec<Added>,
    /// Axes of the diagnosis that make the norm, and their noise.
    norm_noise: Vec<f64>,
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
    fn add(&mut self, law: &'static str, place: String, variable: String, shape: Vec<Vec<f64>>, rng: &mut ChaCha8Rng) {
        let noises = shape.iter().zip(&self.noise).map(|(column, noise)| rms(column) / noise);
        let largest = noises.fold(f64::MIN_POSITIVE, f64::max);
        let size = rng.random_range(TIMES_NOISE) / largest;
        for (channel, column) in self.measured.iter_mut().zip(&shape) {
            channel.iter_mut().zip(column).for_each(|(value, more)| *value += size * more);
        }
        self.added.push(Added { law, place, variable });
    }

    fn mark(&self, class: Class, diagnosis: &Diagnosis) -> Mark {
        let mut mark = Mark { ratio: self.ratio(diagnosis), answer: answer(diagnosis), ..Mark::default() };
        let named: Vec<(&str, &str)> = diagnosis.effects.iter().map(|e| (e.law, joint_of(&e.place))).collect();
        let truth: Vec<(&str, &str)> = self.added.iter().map(|added| (added.law, added.place.as_str())).collect();
        let found = diagnosis.verdict == Verdict::EffectFound;
        match class {
            Class::Clean => mark.named = diagnosis.verdict == Verdict::NoEffect,
            Class::Outside => {
                mark.named = diagnosis.verdict == Verdict::UnexplainedStructure && diagnosis.effects.is_empty();
                let first = diagnosis.remaining.first();
                mark.variable = mark.named && first.is_some_and(|term| term.term.contains(&self.added[0].variable));
            }
            Class::One | Class::Two => {
                let (laws, places) = right(&truth, &named);
                (mark.named, mark.placed) = (found && laws, found && places);
            }
        }
        mark
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

/// `joint 3` of `joint 3 (joint_3)`.
fn joint_of(place: &str) -> &str {
    place.split(" (").next().unwrap_or(place)
}

fn answer(diagnosis: &Diagnosis) -> String {
    let effects = diagnosis.effects.iter().map(|found| format!("{} {}", found.law, found.place));
    let terms = diagnosis.remaining.iter().map(|term| format!("[{}: {}]", term.axis, term.term));
    format!("{}: {}", diagnosis.verdict, effects.chain(terms).collect::<Vec<_>>().join(" + "))
}

fn rms(values: &[f64]) -> f64 {
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

fn middle(limits: Option<[f64; 2]>) -> f64 {
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
    let mut bench = Bench { names, given, axes, measured, noise, spoiled: Vec::new(), added: Vec::new(), norm_noise };
    let mechanisms: Vec<usize> = match class {
        Class::Clean => Vec::new(),
        Class::Outside => vec![6],
        Class::One => vec![rng.random_range(0..6)],
        Class::Two => {
            let first = rng.random_range(0..6);
            vec![first, (first + rng.random_range(1..6)) % 6]
        }
    };
    for mechanism in mechanisms {
        if mechanism == 5 {
            // On the first link, whose axis is upright, a lump is a heavy motor.
            let joint = rng.random_range(1..n);
            let shape = lump(robot, joint, &times, &state)?;
            bench.add("mass-distribution", robot.joints[joint].link.clone(), String::new(), shape, rng);
            continue;
        }
        let joint = rng.random_range(0..n);
        let (law, variable, column) = of_joint(mechanism, joint, n, &bench.given);
        let mut shape = vec![vec![0.0; times.len()]; n];
        shape[joint] = column;
        let place = if variable.is_empty() { format!("joint {}", joint + 1) } else { String::new() };
        bench.add(law, place, variable, shape, rng);
    }
    Ok(bench)
}

/// The law that is right, the variable where none is, and the shape of a mechanism at one joint.
fn of_joint(mechanism: usize, joint: usize, n: usize, given: &[Vec<f64>]) -> (&'static str, String, Vec<f64>) {
    let [q, v, a] = [0, 1, 2].map(|order| &given[1 + order * n + joint]);
    let fastest = v.iter().fold(1e-9, |most: f64, v| most.max(v.abs()));
    let of = |channel: &[f64], shape: &dyn Fn(f64) -> f64| channel.iter().map(|&x| shape(x)).collect::<Vec<f64>>();
    let law = |name, column| (name, String::new(), column);
    match mechanism {
        0 => law("coulomb-friction", of(v, &|v| v / (v * v + CREEP_RAD_S.powi(2)).sqrt())),
        1 => law("viscous-friction", of(v, &|v| v / (1.0 + 0.1 * v.abs() / fastest))),
        2 => law("offset", of(v, &|_| 1.0)),
        3 => law("spring", of(q, &|q| q)),
        4 => law("rotor-inertia", of(a, &|a| a)),
        _ => ("", format!("position of joint {}", joint + 1), of(q, &|q| (7.0 * q).sin())),
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

fn floating(robot: &Robot, class: Class, rng: &mut ChaCha8Rng) -> Result<Bench> {
    let n = robot.joints.len();
    let rows = POSTURES * HELD;
    let mut given = vec![Vec::new(); 9 + n];
    let mut wrench = vec![Vec::new(); 6];
    let heavy: Vec<usize> = (0..n).filter(|&k| robot.joints[k].joint.inertia.mass > 1.0).collect();
    let carrier = heavy[rng.random_range(0..heavy.len())];
    let frame = robot.frame(&robot.joints[carrier].link).context("a link without a frame")?;
    let mut backpack = vec![Vec::new(); 6];
    for row in 0..rows {
        if row % HELD == 0 {
            let joint = |k: usize, rng: &mut ChaCha8Rng| {
                let limits = robot.joints[k].limits;
                let half = limits.map_or(SWING_RAD, |[low, high]| (0.4 * (high - low)).min(SWING_RAD));
                middle(limits) + rng.random_range(-half..=half)
            };
            let q: Vec<f64> = (0..n).map(|k| joint(k, rng)).collect();
            let com = robot.com(&q)?;
            let of_point = |mass: f64, at: darm_core::real::Vec3<f64>| {
                let force = -robot.gravity * mass;
                let moment = at.cross(&force);
                [force.x, force.y, force.z, moment.x, moment.y, moment.z]
            };
            let body = of_point(com.mass_kg, com.position);
            let lump = of_point(1.0, robot.kinematics(frame, &q)?.pose_base_frame.position);
            for _ in 0..HELD {
                let number = given[0].len() as f64;
                let base = [number * 0.1, (number / HELD as f64).floor(), 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
                let all = base.into_iter().chain(q.iter().copied());
                given.iter_mut().zip(all).for_each(|(channel, number)| channel.push(number));
                wrench.iter_mut().zip(body).for_each(|(channel, part)| channel.push(part));
                backpack.iter_mut().zip(lump).for_each(|(channel, part)| channel.push(part));
            }
        }
    }
    let fixed = ["time_s", "posture", "px_m", "py_m", "pz_m", "qx", "qy", "qz", "qw"].map(str::to_string);
    let names = fixed.into_iter().chain(robot.joints.iter().map(|joint| format!("{}_rad", joint.name))).collect();
    let axes = ["Fx_n", "Fy_n", "Fz_n", "Mx_nm", "My_nm", "Mz_nm"].map(str::to_string).to_vec();
    let weight_n = robot.mass() * robot.gravity.norm();
    let moment = COP_NOISE_M * weight_n;
    let noise = vec![FORCE_NOISE_N, FORCE_NOISE_N, FORCE_NOISE_N, moment, moment, moment];
    let norm_noise = vec![COP_NOISE_M, COP_NOISE_M];
    let mut bench =
        Bench { names, given, axes, measured: wrench, noise, spoiled: Vec::new(), added: Vec::new(), norm_noise };
    match class {
        Class::Clean => {}
        Class::One | Class::Two => {
            let place = robot.joints[carrier].link.clone();
            bench.add("mass-distribution", place, String::new(), backpack, rng);
        }
        Class::Outside => {
            let wave = |row: usize| (TAU * 3.0 * row as f64 / rows as f64).sin();
            let mut shape = vec![vec![0.0; rows]; 6];
            shape[4] = (0..rows).map(wave).collect();
            bench.add("", String::new(), "time".into(), shape, rng);
        }
    }
    Ok(bench)
}
