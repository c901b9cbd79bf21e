//! Joint torques along motions: predicted by inverse dynamics of the robot, beside the motors' torque at the joints.

use darm_core::tree::Body;
use nalgebra::DMatrix;

use super::bodies::{Moving, candidate, links, load, of_joint};
use super::experiment::{Axis, Candidate, Experiment, Mass};
use super::laws::{Coordinate, Law};
use super::prepared::{PrepareError, Prepared};
use crate::robot::Robot;

/// How the motors drive the joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Transmission {
    /// N with motor angles = N·(joint angles − offset) and joint torques = Nᵀ·motor torques.
    pub matrix: DMatrix<f64>,
    /// Joint angles where the motors are at zero, rad.
    pub offset: Vec<f64>,
}

/// Positions, velocities, accelerations and torques of all joints, by joint.
struct Motion {
    q: Vec<Vec<f64>>,
    v: Vec<Vec<f64>>,
    a: Vec<Vec<f64>>,
    tau: Vec<Vec<f64>>,
}

/// The experiment of a robot on a fixed base.
pub(super) fn experiment(
    data: &Prepared,
    robot: &Robot,
    transmission: Option<&Transmission>,
) -> Result<Experiment, PrepareError> {
    let n = robot.joints.len();
    let motion = match transmission {
        Some(transmission) => of_motors(data, transmission, n)?,
        None => of_joints(data, n)?,
    };
    let rows = data.rows.len();
    let (nominal, regressor) = regressor(robot, &motion, rows);
    let residuals = (0..rows * n).map(|k| nominal[k] - motion.tau[k % n][k / n]).collect();
    let whole_kg = robot.mass();
    let (mut candidates, mut masses): (Vec<Candidate>, Vec<Mass>) = (Vec::new(), Vec::new());
    for (joint, columns) in robot.joints.iter().zip(regressor) {
        let ten = Body::from(&joint.joint.inertia).parameters();
        let (candidate, mass) = candidate(candidates.len(), &joint.link, &ten, whole_kg, columns);
        candidates.push(candidate);
        masses.push(mass);
    }
    for joint in 0..n {
        let at = |k: &usize| nominal[k * n + joint].abs();
        let size: Vec<f64> = (0..rows).map(|row| at(&row)).collect();
        let place = format!("joint {} ({})", joint + 1, robot.joints[joint].name);
        candidates.extend(of_joint_laws(data, &motion, joint, size).iter().map(|law| law.on_axis(&place, joint, n)));
    }
    candidates.extend(couplings(data, &motion, n, transmission));
    let channel = |name: &str, of: &[Vec<f64>]| -> Vec<(String, Vec<f64>)> {
        of.iter().enumerate().map(|(k, values)| (format!("{name} of joint {}", k + 1), values.clone())).collect()
    };
    let channels = [channel("position", &motion.q), channel("velocity", &motion.v), channel("acceleration", &motion.a)];
    Ok(Experiment {
        kind: "joint-torque",
        axes: (1..=n).map(|k| Axis { name: format!("joint {k}"), unit: "N·m" }).collect(),
        n_norm: n,
        rows: data.rows.clone(),
        residuals,
        candidates,
        channels: channels.concat(),
        masses,
        relinearise: None,
    })
}

fn of_joints(data: &Prepared, n: usize) -> Result<Motion, PrepareError> {
    let mut motion = Motion { q: Vec::new(), v: Vec::new(), a: Vec::new(), tau: Vec::new() };
    for k in 1..=n {
        let [q, v, a] = data.motion(&format!("q{k}"), false)?;
        let v = data.optional(&format!("v{k}")).unwrap_or(v);
        motion.a.push(data.optional(&format!("a{k}")).unwrap_or(a));
        motion.q.push(q);
        motion.v.push(v);
        motion.tau.push(data.channel(&format!("tau{k}"))?);
    }
    Ok(motion)
}

fn of_motors(data: &Prepared, transmission: &Transmission, n: usize) -> Result<Motion, PrepareError> {
    let inverse = transmission.matrix.clone().try_inverse();
    let inverse = inverse.filter(|inverse| inverse.nrows() == n).ok_or_else(|| {
        PrepareError::Nothing(format!("the transmission must be an invertible matrix of {n} rows and columns"))
    })?;
    let mut motors = Vec::new();
    let mut torques = Vec::new();
    for k in 1..=n {
        let name = format!("qm{k}");
        let raw = data.raw(&name).map(|numbers| data.full(numbers, false));
        motors.push(raw.map_or_else(|| data.channel(&name), Ok)?);
        torques.push(data.channel(&format!("taum{k}"))?);
    }
    let mixed = |row: &dyn Fn(usize) -> f64, of: &[Vec<f64>]| -> Vec<f64> {
        let length = of.first().map_or(0, Vec::len);
        (0..length).map(|at| of.iter().enumerate().map(|(k, channel)| row(k) * channel[at]).sum()).collect()
    };
    let mut motion = Motion { q: Vec::new(), v: Vec::new(), a: Vec::new(), tau: Vec::new() };
    for joint in 0..n {
        let offset = transmission.offset.get(joint).copied().unwrap_or(0.0);
        let position = mixed(&|k| inverse[(joint, k)], &motors).iter().map(|q| q + offset).collect();
        let [q, v, a] = data.rates(position);
        motion.q.push(q);
        motion.v.push(v);
        motion.a.push(a);
        motion.tau.push(mixed(&|k| transmission.matrix[(k, joint)], &torques));
    }
    Ok(motion)
}

/// Torques of the model, and the columns of each link's parameters: rows × joints.
fn regressor(robot: &Robot, motion: &Motion, rows: usize) -> (Vec<f64>, Vec<[Vec<f64>; 10]>) {
    let n = robot.joints.len();
    let mut columns: Vec<[Vec<f64>; 10]> = (0..n).map(|_| std::array::from_fn(|_| vec![0.0; rows * n])).collect();
    let mut nominal = vec![0.0; rows * n];
    let tens: Vec<[f64; 10]> = robot.joints.iter().map(|joint| Body::from(&joint.joint.inertia).parameters()).collect();
    let base = Moving::resting(&robot.gravity);
    for row in 0..rows {
        let at = |of: &[Vec<f64>]| -> Vec<f64> { of.iter().map(|channel| channel[row]).collect() };
        let (q, v, a) = (at(&motion.q), at(&motion.v), at(&motion.a));
        let moving = links(robot, &base, [&q, &v, &a]);
        for link in 0..n {
            let load = load(&moving[link]);
            let mut joint = Some(link);
            while let Some(carrier) = joint {
                let ten = of_joint(robot, carrier, &moving[carrier], &load);
                for k in 0..10 {
                    columns[link][k][row * n + carrier] = ten[k];
                    nominal[row * n + carrier] += ten[k] * tens[link][k];
                }
                joint = robot.joints[carrier].joint.parent;
            }
        }
    }
    (nominal, columns)
}

/// Friction, the motor's own inertia, springs and offsets of one joint.
fn of_joint_laws(data: &Prepared, motion: &Motion, joint: usize, load: Vec<f64>) -> Vec<Law> {
    let coordinate = Coordinate {
        position: &motion.q[joint],
        velocity: &motion.v[joint],
        time_s: &data.time_s,
        series: &data.series,
        units: ("rad", "N·m"),
    };
    let mut laws = coordinate.friction(&[("per torque", "(N·m)", load)]);
    laws.retain(|law| law.name != "position-dependent-friction");
    laws.extend(coordinate.others());
    laws.push(Law::new("rotor-inertia", "inertia", "kg·m²".into(), motion.a[joint].clone()));
    laws
}

/// Friction and inertia of a motor that turns with a sum of neighbouring joints: by the transmission where it is known,
/// else the sum and the difference of each two.
fn couplings(data: &Prepared, motion: &Motion, n: usize, transmission: Option<&Transmission>) -> Vec<Candidate> {
    let mut candidates = Vec::new();
    let mixes: Vec<(String, Vec<f64>)> = match transmission {
        Some(transmission) => {
            let row = |k: usize| -> Vec<f64> {
                let largest = transmission.matrix.row(k).amax().max(f64::MIN_POSITIVE);
                (0..n).map(|joint| transmission.matrix[(k, joint)] / largest).collect()
            };
            let several = (0..n).map(|k| (format!("motor {}", k + 1), row(k)));
            several.filter(|(_, mix)| mix.iter().filter(|share| **share != 0.0).count() > 1).collect()
        }
        None => (1..n)
            .flat_map(|k| {
                [(1.0, "with"), (-1.0, "against")].map(|(sign, word)| {
                    let mix = (0..n).map(|j| if j == k - 1 { 1.0 } else if j == k { sign } else { 0.0 }).collect();
                    (format!("joint {} {word} joint {k}", k + 1), mix)
                })
            })
            .collect(),
    };
    for (place, mix) in mixes {
        let sum = |of: &[Vec<f64>]| -> Vec<f64> {
            (0..data.rows.len()).map(|row| mix.iter().zip(of).map(|(share, channel)| share * channel[row]).sum()).collect()
        };
        let (q, v, a) = (sum(&motion.q), sum(&motion.v), sum(&motion.a));
        let coordinate = Coordinate { position: &q, velocity: &v, time_s: &data.time_s, series: &data.series, units: ("rad", "N·m") };
        let mut laws = coordinate.friction(&[]);
        laws.retain(|law| ["coulomb-friction", "viscous-friction"].contains(&law.name));
        laws.push(Law::new("rotor-inertia", "inertia", "kg·m²".into(), a));
        candidates.extend(laws.iter().map(|law| law.on_axes(&place, &mix)));
    }
    candidates
}
