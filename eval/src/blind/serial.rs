//! A serial arm in motion: torques of its joints, and what is added to them.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use anyhow::{Context, Result};
use darm_core::effect::basis::Law;
use darm_core::effect::law_name::LawName;
use darm_core::real::Vec3;
use darm_core::se::rotation_exp;
use darm_diagnose::effect::{Place, Site};
use darm_diagnose::linearise::model_effects::ModelEffect;
use darm_diagnose::linearise::torque;
use darm_measure::root_mean_square;
use darm_robot::rigid_body::inertia::INERTIAL_PARAMETERS;
use darm_robot::robot::{Motion, Robot};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::case::Class;
use super::signals::{Bench, Cause, Channels, Elsewhere, PERIODIC, SWING_RAD, middle};

/// Rows a second, and how long the arm moves.
const RATE_HZ: f64 = 20.0;
const MOTION_S: f64 = 40.0;
/// Noise: share of the root mean square of a torque.
const TORQUE_NOISE: f64 = 0.02;
/// Step of the differences, s.
const STEP_S: f64 = 1e-3;
/// Speed below which dry friction falls, rad/s.
const CREEP_RAD_S: f64 = 0.02;
/// Mechanisms inside the list, the lump among them.
const MECHANISMS: usize = 11;
const LUMP: usize = 5;
/// Where a lump is in the frame of its link.
const LUMP_OFF_M: Vec3<f64> = Vec3::new(0.1, 0.05, 0.08);
/// From here on mechanisms of the entire robot, which have sizes of their own.
const ENTIRE: usize = 7;
/// A joint beside its encoder, and a base that is not level.
const MISPLACED: [usize; 2] = [ENTIRE, ENTIRE + 1];
/// Size of what is misplaced, rad; of a delay, s; of a payload, kg, and how far off the last link's origin it is, m.
const MISPLACED_RAD: std::ops::Range<f64> = 0.03..0.1;
const DELAY_S: std::ops::Range<f64> = 0.01..0.04;
const PAYLOAD_KG: std::ops::Range<f64> = 0.5..2.0;
const PAYLOAD_OFF_M: std::ops::Range<f64> = 0.05..0.15;

/// Measures one serial arm; the mechanisms are not yet spoiled by noise.
pub(super) fn serial(robot: &Robot, class: Class, rng: &mut ChaCha8Rng) -> Result<Bench> {
    let n = robot.joints.len();
    let motion = Swings::draw(robot, rng);
    let times = times_s();
    let mut given = vec![times.clone()];
    let mut nominal = vec![Vec::new(); n];
    let mut channels = vec![Vec::new(); 3 * n];
    for &time_s in &times {
        let [q, v, a] = motion.at(time_s);
        let torque = robot.dynamics(&Motion { state: [&q, &v, &a], load: None })?.torque;
        nominal.iter_mut().zip(torque).for_each(|(channel, torque)| channel.push(torque));
        let all = q.into_iter().chain(v).chain(a);
        channels.iter_mut().zip(all).for_each(|(channel, number)| channel.push(number));
    }
    given.extend(channels);
    let named = |what: &str, unit: &str| (1..=n).map(|k| format!("{what}{k}{unit}")).collect::<Vec<_>>();
    let names = [vec!["time_s".to_string()], named("q", "_rad"), named("v", "_rad/s"), named("a", "")].concat();
    let noise: Vec<f64> = nominal.iter().map(|channel| TORQUE_NOISE * root_mean_square(channel).max(1.0)).collect();
    let norm_noise = noise.clone();
    let mut bench = Bench::new(
        Channels { names, values: given },
        Channels { names: named("tau", "_nm"), values: nominal },
        noise,
        norm_noise,
    );
    let mut mechanisms: Vec<usize> = match class {
        Class::Clean => Vec::new(),
        Class::Outside => {
            let pulled = rng.random_range(0..n);
            let puller = (pulled + rng.random_range(1..n)) % n;
            let middle = middle(robot.joints[puller].limits);
            let mut shape = vec![vec![0.0; times.len()]; n];
            shape[pulled] = bench.given[1 + puller].iter().map(|q| (q - middle).max(0.0).powi(2)).collect();
            bench.add(Cause::Variable(format!("position of joint {}", puller + 1)), shape, rng);
            Vec::new()
        }
        Class::One => vec![rng.random_range(0..MECHANISMS)],
        Class::Two => {
            let first = rng.random_range(0..MECHANISMS);
            vec![first, (first + rng.random_range(1..MECHANISMS)) % MECHANISMS]
        }
    };
    let mut changed = Changed::new(robot, &motion, &times);
    // What is misplaced comes first: a body that is added hangs on a robot that is so.
    mechanisms.sort_by_key(|mechanism| !MISPLACED.contains(mechanism));
    for mechanism in mechanisms {
        add(&mut bench, mechanism, &mut changed, rng)?;
    }
    let elsewhere = Swings::draw(robot, &mut ChaCha8Rng::seed_from_u64(rng.random()));
    bench.elsewhere = Some(Box::new(Motions { robot: robot.clone(), run: motion, elsewhere }));
    Ok(bench)
}

/// Adds a mechanism inside the list at a place that is drawn.
fn add(bench: &mut Bench, mechanism: usize, changed: &mut Changed<'_>, rng: &mut ChaCha8Rng) -> Result<()> {
    let n = changed.robot.joints.len();
    if mechanism >= ENTIRE {
        return add_of_entire_robot(bench, mechanism, changed, rng);
    }
    if mechanism == LUMP {
        // On the first link, whose axis is upright, a lump is a heavy motor.
        let joint = rng.random_range(1..n);
        let shape = changed.point_mass(joint, LUMP_OFF_M)?;
        bench.add(Cause::Law(LawName::MassDistribution, Place::Link(joint)), shape, rng);
        return Ok(());
    }
    let joint = rng.random_range(0..n);
    let (law, column) = of_joint(mechanism, joint, n, &bench.given);
    let mut shape = vec![vec![0.0; column.len()]; n];
    shape[joint] = column;
    bench.add(Cause::Law(law, Place::Joint(joint)), shape, rng);
    Ok(())
}

/// A robot in motion whose torques something changes.
struct Changed<'a> {
    /// As its model has it.
    robot: &'a Robot,
    motion: &'a Swings,
    times: &'a [f64],
    /// As it hangs, and how far its joints are beside their encoders, rad.
    tilted: Robot,
    offsets_rad: Vec<f64>,
}

impl<'a> Changed<'a> {
    fn new(robot: &'a Robot, motion: &'a Swings, times: &'a [f64]) -> Self {
        Self { robot, motion, times, tilted: robot.clone(), offsets_rad: vec![0.0; robot.joints.len()] }
    }

    /// Where the robot really is, and how it moves.
    fn state(&self, time_s: f64) -> [Vec<f64>; 3] {
        let [mut q, v, a] = self.motion.at(time_s);
        q.iter_mut().zip(&self.offsets_rad).for_each(|(q, offset)| *q += offset);
        [q, v, a]
    }

    /// Torques of a mass of 1 kg bolted to a joint's link, `off_m` in its frame.
    fn point_mass(&self, joint: usize, off_m: Vec3<f64>) -> Result<Vec<Vec<f64>>> {
        point_mass(&self.tilted, (joint, off_m), self.times, &|time_s| self.state(time_s))
    }

    /// What the torques are more once this has changed, joint by joint.
    fn by(&mut self, change: impl FnOnce(&mut Self)) -> Result<Vec<Vec<f64>>> {
        let before = self.torques()?;
        change(self);
        Ok(difference(&self.torques()?, &before))
    }

    /// Torques of all rows.
    fn torques(&self) -> Result<Vec<Vec<f64>>> {
        self.times.iter().map(|&time_s| torques(&self.tilted, self.state(time_s))).collect()
    }
}

/// What torques are more than others, joint by joint; both row by row.
fn difference(with: &[Vec<f64>], without: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let rows = || with.iter().zip(without);
    (0..with[0].len()).map(|joint| rows().map(|(with, without)| with[joint] - without[joint]).collect()).collect()
}

fn torques(robot: &Robot, [q, v, a]: [Vec<f64>; 3]) -> Result<Vec<f64>> {
    Ok(robot.dynamics(&Motion { state: [&q, &v, &a], load: None })?.torque)
}

/// Adds a joint that is not where its encoder shows it, a base that is not level, a delay of all torques, or a payload.
fn add_of_entire_robot(
    bench: &mut Bench,
    mechanism: usize,
    changed: &mut Changed<'_>,
    rng: &mut ChaCha8Rng,
) -> Result<()> {
    let Changed { robot, motion, times, .. } = *changed;
    let n = robot.joints.len();
    let angle_rad = rng.random_range(MISPLACED_RAD) * [-1.0, 1.0][rng.random_range(0..2)];
    let (cause, shape) = match mechanism - ENTIRE {
        0 => {
            // The first axis is upright, and the last link even about its own: their offsets change no torque.
            loop {
                let joint = rng.random_range(1..n - 1);
                let shape = changed.by(|changed| changed.offsets_rad[joint] = angle_rad)?;
                if bench.shows(&shape) {
                    break (Cause::Law(LawName::JointOffset, Place::Joint(joint)), shape);
                }
                changed.offsets_rad[joint] = 0.0;
            }
        }
        1 => {
            let (sin, cos) = rng.random_range(0.0..TAU).sin_cos();
            let turn = rotation_exp(&(Vec3::new(cos, sin, 0.0) * angle_rad));
            let shape = changed.by(|changed| changed.tilted.gravity = turn.transpose() * robot.gravity)?;
            (Cause::Law(LawName::BaseTilt, Place::Base), shape)
        }
        2 => {
            let late_s = rng.random_range(DELAY_S);
            let at = |late_s: f64| times.iter().map(|time_s| torques(robot, motion.at(time_s - late_s))).collect();
            let [late, on_time]: [Result<Vec<Vec<f64>>>; 2] = [late_s, 0.0].map(at);
            let shape = difference(&late?, &on_time?);
            (Cause::Law(LawName::Delay, Place::AllJoints), shape)
        }
        _ => {
            let place = Vec3::new(0.0, rng.random_range(PAYLOAD_OFF_M), rng.random_range(PAYLOAD_OFF_M));
            let of_one_kg = changed.point_mass(n - 1, place)?;
            let (kg, from) = (rng.random_range(PAYLOAD_KG), times.len() / 2);
            let in_half = |torques: Vec<f64>| {
                let of_row = |(row, torque): (usize, f64)| if row < from { 0.0 } else { kg * torque };
                torques.into_iter().enumerate().map(of_row).collect()
            };
            bench.names.push("payload".into());
            bench.given.push((0..times.len()).map(|row| if row < from { 0.0 } else { 1.0 }).collect());
            (Cause::Law(LawName::MassDistribution, Place::Payload(1)), of_one_kg.into_iter().map(in_half).collect())
        }
    };
    bench.add_as_it_is(cause, shape);
    Ok(())
}

/// The law that is right, and the shape of a mechanism at one joint.
fn of_joint(mechanism: usize, joint: usize, n: usize, given: &[Vec<f64>]) -> (LawName, Vec<f64>) {
    let [q, v, a] = [0, 1, 2].map(|order| &given[1 + order * n + joint]);
    let fastest = v.iter().fold(1e-9, |largest: f64, v| largest.max(v.abs()));
    let of = |channel: &[f64], shape: &dyn Fn(f64) -> f64| channel.iter().map(|&x| shape(x)).collect::<Vec<f64>>();
    match mechanism {
        0 => (LawName::CoulombFriction, of(v, &|v| v / (v * v + CREEP_RAD_S.powi(2)).sqrt())),
        1 => (LawName::ViscousFriction, of(v, &|v| v / (1.0 + 0.1 * v.abs() / fastest))),
        2 => (LawName::Offset, of(v, &|_| 1.0)),
        3 => (LawName::Spring, of(q, &|q| q)),
        4 => (LawName::RotorInertia, of(a, &|a| a)),
        _ => (PERIODIC, of(q, &|q| (7.0 * q).sin())),
    }
}

/// Torques of a mass of 1 kg bolted to a joint's link, there in its frame: virtual work of its weight and inertia.
fn point_mass(
    robot: &Robot,
    (joint, off): (usize, Vec3<f64>),
    times: &[f64],
    state: &dyn Fn(f64) -> [Vec<f64>; 3],
) -> Result<Vec<Vec<f64>>> {
    let n = robot.joints.len();
    let frame = robot.frame(&robot.joints[joint].link).context("a link without a frame")?;
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

/// Smooth motions of all joints.
struct Swings(Vec<Swing>);

impl Swings {
    fn draw(robot: &Robot, rng: &mut ChaCha8Rng) -> Self {
        Self(robot.joints.iter().map(|joint| Swing::draw(joint.limits, rng)).collect())
    }

    /// Positions, velocities, accelerations.
    fn at(&self, time_s: f64) -> [Vec<f64>; 3] {
        let all: Vec<[f64; 3]> = self.0.iter().map(|swing| swing.at(time_s)).collect();
        [0, 1, 2].map(|order| all.iter().map(|joint| joint[order]).collect())
    }
}

fn times_s() -> Vec<f64> {
    (0..(RATE_HZ * MOTION_S) as usize).map(|row| row as f64 / RATE_HZ).collect()
}

/// How a serial arm moved, and how else it could.
struct Motions {
    robot: Robot,
    run: Swings,
    elsewhere: Swings,
}

impl Elsewhere for Motions {
    fn columns(&self, law: LawName, site: &Site, elsewhere: bool) -> Result<Option<DMatrix<f64>>> {
        let names: Vec<&str> = match (law, Law::named(law, None)) {
            (LawName::JointOffset, _) => vec!["offset"],
            (LawName::BaseTilt, _) => vec!["first turn across", "second turn across"],
            (LawName::MassDistribution, _) => INERTIAL_PARAMETERS.iter().map(|(name, _)| *name).collect(),
            (_, Some(law)) => vec![law.coefficient()],
            // Laws with separate constants are not known elsewhere.
            _ => return Ok(None),
        };
        let (swings, times) = (if elsewhere { &self.elsewhere } else { &self.run }, times_s());
        let motion: Vec<[Vec<f64>; 3]> = times.iter().map(|&time_s| swings.at(time_s)).collect();
        let states: Vec<[&[f64]; 3]> = motion.iter().map(|[q, v, a]| [&q[..], &v[..], &a[..]]).collect();
        let mut columns = Vec::new();
        for name in names {
            let values = BTreeMap::from([(name.to_string(), 1.0)]);
            let one =
                ModelEffect { law, place: site.code.clone(), constant: None, values, along: None, points: Vec::new() };
            columns.push(DVector::from_vec(torque::added(&self.robot, None, &[one], &states, &times)?.concat()));
        }
        Ok(Some(DMatrix::from_columns(&columns)))
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
