//! Measurements of signals without any effect: torques, a wrench, a measured tool, a cylinder, a joint that holds its target.

use std::f64::consts::{FRAC_PI_4, TAU};

use anyhow::{Context as _, Result};
use darm_core::real::Vec3;
use darm_core::se::rotation_exp;
use darm_diagnose::linearise::measured_tool::MeasuredTool;
use darm_diagnose::linearise::model::Predictor;
use darm_measure::root_mean_square;
use darm_robot::robot::Robot;
use nalgebra::{Rotation3, UnitQuaternion};
use rand::RngExt;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;

use super::super::case::Class;
use super::super::robots::{Robots, Which};
use super::super::signals::{Bench, Channels};
use super::numbers::normal;
use super::signals::Seen;

/// Postures in which a tool is measured; of some of them how many, and how often each of these.
const POSTURES: usize = 200;
const REPEATED: usize = 12;
const REPEATS: usize = 5;
/// Noise of what measures a tool.
const TOOL_M: f64 = 1e-4;
const TOOL_RAD: f64 = 1e-4;
/// Rows a second of a cylinder, and its seconds; its bore, stroke and noise.
const RATE_HZ: f64 = 20.0;
const MOTION_S: f64 = 60.0;
pub(super) const BORE_M: f64 = 0.025;
const STROKE_M: f64 = 0.1;
const FORCE_N: f64 = 1.0;
/// Targets of a joint, how often it comes to each, and its noise, deg.
const TARGETS: usize = 40;
const TIMES: usize = 8;
const SERVO_NOISE_DEG: f64 = 0.02;

/// How the rows of a tool are repeated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Repeats {
    InPlace,
    Scattered,
    None,
}

/// A bench, its model, and what a generator sees of the axes that it may change; which measured channels these are, with the share
/// of each.
pub(super) struct Drawn {
    pub(super) what: Predictor,
    pub(super) bench: Bench,
    pub(super) seen: Seen,
    pub(super) on: Vec<(usize, f64)>,
}

/// A robot in motion, or a floating base at rest.
pub(super) fn robot(robots: &Robots, which: Which, rng: &mut ChaCha8Rng) -> Result<Drawn> {
    let (what, bench) = robots.drawn(which, Class::Clean, rng)?;
    let joints = what.robot().context("a bench without a robot")?.joints.clone();
    let n = joints.len();
    let [joint, other] = two(n, rng);
    let channel = |k: usize| bench.given[k].clone();
    let (seen, on) = match which {
        Which::Serial => {
            let name = |what: &str, joint: usize| format!("{what} of joint {}", joint + 1);
            let seen = Seen {
                times: channel(0),
                own: (name("position", joint), channel(1 + joint)),
                rate: Some((name("velocity", joint), channel(1 + n + joint))),
                other: Some((name("position", other), channel(1 + other))),
                loads: Some([joint, other].map(|of| bench.nominal[of].clone())),
            };
            (seen, joint)
        }
        Which::Floating => {
            let of = |joint: usize| (joints[joint].name.clone(), channel(9 + joint));
            let seen = Seen { times: channel(0), own: of(joint), rate: None, other: Some(of(other)), loads: None };
            // Moments about x and y move the centre of pressure.
            (seen, rng.random_range(3..5))
        }
    };
    Ok(Drawn { what, bench, seen, on: vec![(on, 1.0)] })
}

/// Two different numbers below `n`.
fn two(n: usize, rng: &mut ChaCha8Rng) -> [usize; 2] {
    let first = rng.random_range(0..n);
    [first, (first + rng.random_range(1..n)) % n]
}

/// The tool of a robot, from outside.
pub(super) fn tool(robot: &Robot, oriented: bool, repeats: Repeats, rng: &mut ChaCha8Rng) -> Result<Drawn> {
    let frame = robot.tool().context("a robot without a tool")?;
    let n = robot.joints.len();
    let mut postures: Vec<Vec<f64>> =
        (0..POSTURES).map(|_| (0..n).map(|_| rng.random_range(-2.0..2.0)).collect()).collect();
    match repeats {
        Repeats::None => {}
        Repeats::InPlace => {
            let often = |(k, posture): (usize, Vec<f64>)| {
                std::iter::repeat_n(posture, if k % (POSTURES / REPEATED) == 0 { REPEATS } else { 1 })
            };
            postures = postures.into_iter().enumerate().flat_map(often).collect();
        }
        Repeats::Scattered => {
            let again: Vec<Vec<f64>> = postures.iter().take(REPEATED * (REPEATS - 1)).cloned().collect();
            postures.extend(again);
            postures.shuffle(rng);
        }
    }
    let mut given = vec![Vec::new(); 1 + n + if oriented { 4 } else { 0 }];
    let mut positions = vec![Vec::new(); 3];
    for (k, q) in postures.iter().enumerate() {
        let pose = robot.kinematics(frame, q)?.pose_base_frame;
        let mut all = vec![8.0 * k as f64];
        all.extend(q);
        if oriented {
            let seen = rotation_exp(&Vec3::from_fn(|_, _| TOOL_RAD * normal(rng))) * pose.rotation;
            let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(seen));
            all.extend([turn.i, turn.j, turn.k, turn.w]);
        }
        given.iter_mut().zip(all).for_each(|(channel, number)| channel.push(number));
        positions.iter_mut().zip(pose.position.iter()).for_each(|(channel, number)| channel.push(*number));
    }
    let mut names = vec!["time_s".to_string()];
    names.extend((1..=n).map(|k| format!("q{k}_rad")));
    names.extend(["qx", "qy", "qz", "qw"].into_iter().take(if oriented { 4 } else { 0 }).map(str::to_string));
    let axes = ["x_m", "y_m", "z_m"].map(str::to_string).to_vec();
    let [joint, other] = two(n - 1, rng);
    let of = |joint: usize| (format!("position of joint {}", joint + 1), given[1 + joint].clone());
    let seen = Seen { times: given[0].clone(), own: of(joint), rate: None, other: Some(of(other)), loads: None };
    let (noise, norm_noise) = (vec![TOOL_M; 3], vec![TOOL_M; 3]);
    let bench =
        Bench::new(Channels { names, values: given }, Channels { names: axes, values: positions }, noise, norm_noise);
    let way = Vec3::from_fn(|_, _| normal(rng)).normalize();
    // The noise of the norm is √3 times that of an axis.
    let on = (0..3).map(|axis| (axis, 3f64.sqrt() * way[axis])).collect();
    let how = MeasuredTool { tool: None, oriented, in_base_frame: true };
    Ok(Drawn { what: Predictor::Tool(robot.clone(), how), bench, seen, on })
}

/// A cylinder beside a load cell.
pub(super) fn cylinder(rng: &mut ChaCha8Rng) -> Drawn {
    let times: Vec<f64> = (0..(RATE_HZ * MOTION_S) as usize).map(|row| row as f64 / RATE_HZ).collect();
    let mut waves = |slowest: f64| -> Vec<[f64; 3]> {
        let wave = |k: i32| [rng.random_range(0.3..1.0), TAU * slowest * f64::from(k), rng.random_range(0.0..TAU)];
        (1..=3).map(wave).collect()
    };
    let (of_stroke, of_pressure) = (waves(0.06), waves(0.041));
    let sum = |waves: &[[f64; 3]], time_s: f64, rate: bool| -> f64 {
        let one = |[size, pulse, phase]: &[f64; 3]| {
            let turn = pulse * time_s + phase;
            if rate { size * pulse * turn.cos() } else { size * turn.sin() }
        };
        waves.iter().map(one).sum::<f64>() / 3.0
    };
    let along = |of: &dyn Fn(f64) -> f64| times.iter().map(|&time_s| of(time_s)).collect::<Vec<f64>>();
    let position = along(&|t| 0.5 * STROKE_M * (1.0 + sum(&of_stroke, t, false)));
    let velocity = along(&|t| 0.5 * STROKE_M * sum(&of_stroke, t, true));
    let pressure = along(&|t| 4e5 + 1.5e5 * sum(&of_pressure, t, false));
    let force: Vec<f64> = pressure.iter().map(|p| p * FRAC_PI_4 * BORE_M * BORE_M).collect();
    let seen = Seen {
        times: times.clone(),
        own: ("position".into(), position.clone()),
        rate: Some(("velocity".into(), velocity)),
        other: Some(("pressure".into(), pressure.clone())),
        loads: None,
    };
    let names = ["time_s", "pressure_pa", "position_m"].map(str::to_string).to_vec();
    let bench = Bench::new(
        Channels { names, values: vec![times, pressure, position] },
        Channels { names: vec!["force_n".into()], values: vec![force] },
        vec![FORCE_N],
        vec![FORCE_N],
    );
    Drawn { what: Predictor::Cylinder { bore_m: BORE_M }, bench, seen, on: vec![(0, 1.0)] }
}

/// A joint that holds one target after the other.
pub(super) fn position_of_servo(rng: &mut ChaCha8Rng) -> Drawn {
    let targets: Vec<f64> = (0..TARGETS).map(|_| f64::from(rng.random_range(-600..600)) * 0.1).collect();
    let mut order: Vec<usize> = (0..TARGETS * TIMES).map(|k| k % TARGETS).collect();
    order.shuffle(rng);
    let target: Vec<f64> = order.iter().map(|&k| targets[k]).collect();
    let times: Vec<f64> = (0..target.len()).map(|k| 2.0 * k as f64).collect();
    let seen =
        Seen { times: times.clone(), own: ("target".into(), target.clone()), rate: None, other: None, loads: None };
    let names = ["time_s", "target_deg"].map(str::to_string).to_vec();
    let bench = Bench::new(
        Channels { names, values: vec![times, target.clone()] },
        Channels { names: vec!["position_deg".into()], values: vec![target] },
        vec![SERVO_NOISE_DEG],
        vec![SERVO_NOISE_DEG],
    );
    Drawn { what: Predictor::Servo, bench, seen, on: vec![(0, 1.0)] }
}

impl Drawn {
    /// The noise that the size of what is planted is counted in.
    pub(super) fn noise(&self) -> f64 {
        root_mean_square(&self.on.iter().map(|(axis, _)| self.bench.noise[*axis]).collect::<Vec<_>>())
    }
}
