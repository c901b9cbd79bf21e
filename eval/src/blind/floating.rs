//! A floating base in held postures: what is measured under it, and links that carry a weight alike.

use std::f64::consts::TAU;

use anyhow::{Context, Result};
use darm_core::real::Vec3;
use darm_core::se::{Pose, rotation_exp};
use darm_diagnose::effect::{LawName, Place, Site};
use darm_robot::robot::{Robot, RobotFrame};
use nalgebra::DMatrix;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::case::Class;
use super::signals::{Bench, Cause, Channels, Elsewhere, SWING_RAD, middle};

/// Held postures, and rows of each.
const POSTURES: usize = 64;
const ROWS_PER_POSTURE: usize = 6;
/// Noise: shift of the centre of pressure, m; forces, N.
const COP_NOISE_M: f64 = 0.2e-3;
const FORCE_NOISE_N: f64 = 0.3;
/// Other postures.
const ELSEWHERE: usize = 500;
/// Chance that the one mechanism is in the plate, and the turn that it is drawn with before it is sized, rad.
const ASKEW: f64 = 0.25;
const ASKEW_RAD: f64 = 0.01;
/// What a link carries: its mass and its first moment.
const VALUES: usize = 4;

/// Where a floating base stood, and where else it could.
struct Postures {
    robot: Robot,
    postures: Vec<Vec<f64>>,
    elsewhere: Vec<Vec<f64>>,
}

/// Measures one floating base; the mechanism is not yet spoiled by noise.
pub(super) fn floating(robot: &Robot, class: Class, rng: &mut ChaCha8Rng) -> Result<Bench> {
    let n = robot.joints.len();
    let heavy: Vec<usize> = (0..n).filter(|&k| robot.joints[k].joint.inertia.mass > 1.0).collect();
    let carrier = heavy[rng.random_range(0..heavy.len())];
    let carrier_frame = frame(robot, &robot.joints[carrier].link)?;
    let postures: Vec<Vec<f64>> = (0..POSTURES).map(|_| posture(robot, rng)).collect();
    let (mut given, mut wrench, mut backpack) = (vec![Vec::new(); 9 + n], vec![Vec::new(); 6], vec![Vec::new(); 6]);
    for (posture, q) in postures.iter().enumerate() {
        let com = robot.com(q)?;
        let body = of_point(robot, &com.position).map(|part| com.mass_kg * part);
        let lump = of_point(robot, &robot.kinematics(carrier_frame, q)?.pose_base_frame.position);
        for k in 0..ROWS_PER_POSTURE {
            let time_s = (posture * ROWS_PER_POSTURE + k) as f64 * 0.1;
            let base = [time_s, posture as f64, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
            let all = base.into_iter().chain(q.iter().copied());
            given.iter_mut().zip(all).for_each(|(channel, number)| channel.push(number));
            wrench.iter_mut().zip(body).for_each(|(channel, part)| channel.push(part));
            backpack.iter_mut().zip(lump).for_each(|(channel, part)| channel.push(part));
        }
    }
    let fixed = ["time_s", "posture", "px_m", "py_m", "pz_m", "qx", "qy", "qz", "qw"].map(str::to_string);
    let moment = COP_NOISE_M * robot.mass() * robot.gravity.norm();
    let names: Vec<String> =
        fixed.into_iter().chain(robot.joints.iter().map(|joint| format!("{}_rad", joint.name))).collect();
    let axes = ["Fx_n", "Fy_n", "Fz_n", "Mx_nm", "My_nm", "Mz_nm"].map(str::to_string).to_vec();
    let noise = vec![FORCE_NOISE_N, FORCE_NOISE_N, FORCE_NOISE_N, moment, moment, moment];
    let mut bench = Bench::new(
        Channels { names, values: given },
        Channels { names: axes, values: wrench },
        noise,
        vec![COP_NOISE_M, COP_NOISE_M],
    );
    match class {
        Class::Clean => {}
        Class::One | Class::Two => {
            let askew = class == Class::Two || rng.random_bool(ASKEW);
            if class == Class::Two || !askew {
                bench.add(Cause::Law(LawName::MassDistribution, Place::Link(carrier)), backpack, rng);
            }
            if askew {
                let shape = seen_askew(&bench.measured, rng);
                bench.add(Cause::Law(LawName::SensorFrame, Place::ForcePlate), shape, rng);
            }
        }
        Class::Outside => {
            let rows = POSTURES * ROWS_PER_POSTURE;
            let wave = |row: usize| (TAU * 3.0 * row as f64 / rows as f64).sin();
            let mut shape = vec![vec![0.0; rows]; 6];
            shape[4] = (0..rows).map(wave).collect();
            bench.add(Cause::Variable("time".into()), shape, rng);
        }
    }
    let elsewhere = (0..ELSEWHERE).map(|_| posture(robot, rng)).collect();
    bench.elsewhere = Some(Box::new(Postures { robot: robot.clone(), postures, elsewhere }));
    Ok(bench)
}

/// What a plate that is tilted about its middle measures beyond one that is level: force and moment in its own axes.
fn seen_askew(wrench: &[Vec<f64>], rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
    let turn = Vec3::from_fn(|_, _| rng.random_range(-1.0..=1.0)).normalize() * ASKEW_RAD;
    let to_plate = rotation_exp(&turn).transpose();
    let mut shape = wrench.to_vec();
    for part in shape.chunks_exact_mut(3) {
        for row in 0..part[0].len() {
            let seen = Vec3::from_fn(|axis, _| part[axis][row]);
            let more = to_plate * seen - seen;
            (0..3).for_each(|axis| part[axis][row] = more[axis]);
        }
    }
    shape
}

/// Joint angles within their limits, rad.
fn posture(robot: &Robot, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut joint = |limits: Option<[f64; 2]>| {
        let half = limits.map_or(SWING_RAD, |[low, high]| (0.4 * (high - low)).min(SWING_RAD));
        middle(limits) + rng.random_range(-half..=half)
    };
    robot.joints.iter().map(|of| joint(of.limits)).collect()
}

/// Force and moment that hold a mass of 1 kg at a point, N and N·m.
fn of_point(robot: &Robot, at: &Vec3<f64>) -> [f64; 6] {
    let force = -robot.gravity;
    let moment = at.cross(&force);
    [force.x, force.y, force.z, moment.x, moment.y, moment.z]
}

fn frame<'r>(robot: &'r Robot, link: &str) -> Result<&'r RobotFrame> {
    robot.frame(link).context("a link without a frame")
}

impl Postures {
    /// What the weight of the robot is in the frame of a plate that is moved and turned, per m and rad.
    fn of_plate(&self, postures: &[&Vec<f64>]) -> Result<DMatrix<f64>> {
        let mut columns = DMatrix::zeros(6 * postures.len(), 6);
        for (k, q) in postures.iter().enumerate() {
            let com = self.robot.com(q)?;
            let [fx, fy, fz, mx, my, mz] = of_point(&self.robot, &com.position).map(|part| com.mass_kg * part);
            let (force, moment) = (Vec3::new(fx, fy, fz), Vec3::new(mx, my, mz));
            for axis in 0..3 {
                let about = Vec3::ith(axis, 1.0);
                let of_force = -about.cross(&force);
                columns.fixed_view_mut::<3, 1>(6 * k + 3, axis).copy_from(&of_force);
                columns.fixed_view_mut::<3, 1>(6 * k, 3 + axis).copy_from(&of_force);
                columns.fixed_view_mut::<3, 1>(6 * k + 3, 3 + axis).copy_from(&-about.cross(&moment));
            }
        }
        Ok(columns)
    }
}

impl Elsewhere for Postures {
    /// The wrench of 1 kg at the link's frame, and of 1 kg·m along each of its axes; of the plate what the robot's own weight
    /// is where that is moved by 1 m along each axis and turned by 1 rad about each.
    fn columns(&self, law: LawName, site: &Site, elsewhere: bool) -> Result<Option<DMatrix<f64>>> {
        let measured = self.postures.iter().flat_map(|q| std::iter::repeat_n(q, ROWS_PER_POSTURE));
        let postures: Vec<&Vec<f64>> = if elsewhere { self.elsewhere.iter().collect() } else { measured.collect() };
        let link = match (law, site.place) {
            (LawName::MassDistribution, Place::Base) => None,
            (LawName::MassDistribution, Place::Link(k)) => Some(frame(&self.robot, &self.robot.joints[k].link)?),
            (LawName::SensorFrame, Place::ForcePlate) => return self.of_plate(&postures).map(Some),
            _ => return Ok(None),
        };
        let mut columns = DMatrix::zeros(6 * postures.len(), VALUES);
        for (k, q) in postures.iter().enumerate() {
            let pose = match link {
                None => Pose::identity(),
                Some(frame) => self.robot.kinematics(frame, q)?.pose_base_frame,
            };
            let at_frame = of_point(&self.robot, &pose.position);
            for value in 0..VALUES {
                let mut wrench = at_frame;
                if let Some(axis) = value.checked_sub(1) {
                    let further = of_point(&self.robot, &(pose.position + pose.rotation.column(axis)));
                    wrench = std::array::from_fn(|k| further[k] - at_frame[k]);
                }
                (0..6).for_each(|axis| columns[(6 * k + axis, value)] = wrench[axis]);
            }
        }
        Ok(Some(columns))
    }
}
