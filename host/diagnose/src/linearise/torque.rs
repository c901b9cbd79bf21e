//! Joint torques along motions: predicted by inverse dynamics of the robot, beside the motors' torque at the joints.

mod couplings;
mod near;
mod payload;
mod placement;
#[cfg(test)]
mod tests;

use darm_core::effect::basis::Law;
use darm_core::tree::Body;
use nalgebra::DMatrix;

use self::couplings::{Clock, common_delay, couplings};
pub(crate) use self::near::{Near, is_ripple};
use self::placement::{Misplaced, Placement};
use crate::effect::{Place, Site};
use crate::error::DiagnoseError;
use crate::linearise::bodies;
use crate::linearise::experiment::{
    Axis, BodyCandidate, Candidate, CandidateValue, Curvature, Experiment, Moving, TableColumns,
};
use crate::linearise::laws::Coordinate;
use crate::linearise::model_effects::{self, ModelEffect};
use crate::linearise::ripple::periods_a_turn;
use crate::linearise::serial_chain::site_of_joint;
use crate::measured::Measured;
use crate::prepare::groups::SignalRow;
use crate::prepare::signals::{PrepareError, Prepared};
use crate::progress::Progress;
use darm_measure::{Finding, FindingKind};
use darm_robot::rigid_body::regressor::{BodyMotion, joint_regressor, link_motions, wrench_regressor};
use darm_robot::robot::{Robot, RobotJoint};

/// A torque constant is not off by more than half of it.
const MIN_GAIN: f64 = -0.5;
/// Ripples of a torque that are tried.
const RIPPLES: usize = 2;

/// How the motors drive the joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Transmission {
    /// N with motor angles = N·(joint angles − offset) and joint torques = Nᵀ·motor torques.
    pub matrix: DMatrix<f64>,
    /// Joint angles where the motors are at zero, rad.
    pub offset: Vec<f64>,
}

/// Positions, velocities, accelerations and torques of all joints, by joint.
#[derive(Default)]
struct Motion {
    q: Vec<Vec<f64>>,
    v: Vec<Vec<f64>>,
    a: Vec<Vec<f64>>,
    tau: Vec<Vec<f64>>,
    /// The number of what the tool carries in each row, 0 nothing.
    payload: Vec<u32>,
    /// Whether it is a part of a log, whose readings are compared: no ripples then, whose periods take most of the time, and
    /// offsets as far as they are linear.
    is_sample: bool,
    /// Where what changes with the model is taken; `None`: at the model as it is.
    near: Option<Near>,
}

impl Motion {
    /// The motion of joints that are not where their encoders show them.
    fn placed(&self, placement: &Placement) -> Self {
        let of_joint = |(shown, offset): (&Vec<f64>, &f64)| shown.iter().map(|q| q + offset).collect();
        let q = self.q.iter().zip(&placement.offsets).map(of_joint).collect();
        Self { q, v: self.v.clone(), a: self.a.clone(), ..Self::default() }
    }
}

/// The experiment of a robot on a fixed base.
pub(crate) fn experiment(
    data: &Prepared,
    robot: &Robot,
    transmission: Option<&Transmission>,
    known: &[ModelEffect],
    near: Option<Near>,
    progress: &Progress,
) -> Result<Experiment, DiagnoseError> {
    let n = robot.joints.len();
    let motion = match transmission {
        Some(transmission) if data.raw("qm1").is_some() => of_motors(data, transmission, n)?,
        _ => of_joints(data, robot)?,
    };
    let motion = Motion { payload: payload::carried(data)?, is_sample: data.is_sample(), near, ..motion };
    let mut experiment = of_motion(data.rows.clone(), robot, transmission, known, &motion, progress)?;
    experiment.findings.extend(other_joints(data, n));
    Ok(experiment)
}

/// Joints that the log has, and the model of `n` joints has not.
fn other_joints(data: &Prepared, n: usize) -> Option<Finding> {
    let has = |joint: &usize| ["q", "tau"].iter().all(|letter| data.raw(&format!("{letter}{joint}")).is_some());
    let last = (n + 1..).take_while(has).last()?;
    let joints = if last == n + 1 { format!("joint {last}") } else { format!("joints {} to {last}", n + 1) };
    let text = format!(
        "the log has {joints}, the model has {n} joints: torques that the others cause are missing in the prediction, and an \
         effect may be named for them; give the model of the complete robot"
    );
    Some(Finding::note(FindingKind::MissingJoints, text))
}

/// What effects add to the torques of a robot along a motion, N·m or N: for each row of it one number a joint.
///
/// `states` has positions, velocities and accelerations of each row, rad or m; what remembers its way begins with the first.
///
/// # Errors
///
/// An effect that the robot has no place for.
pub fn added(
    robot: &Robot,
    transmission: Option<&Transmission>,
    known: &[ModelEffect],
    states: &[[&[f64]; 3]],
    times_s: &[f64],
) -> Result<Vec<Vec<f64>>, DiagnoseError> {
    let n = robot.joints.len();
    let [q, v, a] = [0, 1, 2].map(|order| {
        let channel = |joint: usize| states.iter().map(|state| state[order][joint]).collect();
        (0..n).map(channel).collect()
    });
    let row = |(k, &time_s): (usize, &f64)| SignalRow {
        line: k + 1,
        time_s,
        series: 0,
        motion: 0,
        key: None,
        held_out: false,
    };
    let rows: Vec<SignalRow> = times_s.iter().enumerate().map(row).collect();
    let (tau, payload) = (vec![vec![0.0; rows.len()]; n], vec![0; rows.len()]);
    let motion = Motion { q, v, a, tau, payload, is_sample: false, near: None };
    let mut experiment = of_motion(rows, robot, transmission, known, &motion, &Progress::default())?;
    let nominal = experiment.residuals.clone();
    model_effects::apply(&mut experiment, known)?;
    let more: Vec<f64> = experiment.residuals.iter().zip(&nominal).map(|(with, without)| with - without).collect();
    Ok(more.chunks(n.max(1)).map(<[f64]>::to_vec).collect())
}

/// The experiment of a motion, unless it is given up between two joints.
fn of_motion(
    rows: Vec<SignalRow>,
    robot: &Robot,
    transmission: Option<&Transmission>,
    known: &[ModelEffect],
    motion: &Motion,
    progress: &Progress,
) -> Result<Experiment, DiagnoseError> {
    let n = robot.joints.len();
    let clock = Clock::new(&rows);
    let ripples = if motion.is_sample { 0 } else { RIPPLES };
    let sites: Vec<Site> = (0..n).map(|joint| site_of_joint(robot, joint, joint)).collect();
    let near = motion.near.as_ref();
    let found = model_effects::merge(known, near.map_or_else(Vec::new, |near| near.effects.clone()));
    let placement = Placement::of(robot, &sites, &found);
    let (nominal, columns) = regressor_at(robot, motion, &placement, rows.len());
    let measured: Vec<f64> = (0..rows.len() * n).map(|k| motion.tau[k % n][k / n]).collect();
    let residuals: Vec<f64> = nominal.iter().zip(&measured).map(|(nominal, measured)| nominal - measured).collect();
    let left = near.map_or(&residuals, |near| &near.residuals);
    progress.check()?;
    let bodies = all_bodies(robot, motion, known, columns)?;
    let misplaced = misplaced(robot, motion, &bodies, placement, &found)?;
    let (mut candidates, bodies) = bodies.into_iter().unzip::<_, _, Vec<_>, Vec<_>>();
    for (joint, site) in sites.iter().enumerate() {
        progress.check()?;
        let load: Vec<f64> = (0..rows.len()).map(|row| nominal[row * n + joint]).collect();
        let shares: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k == joint))).collect();
        let [q, v, a] = [&motion.q, &motion.v, &motion.a].map(|channels| &channels[joint][..]);
        let coordinate = clock.coordinate([q, v, a], Some(&load));
        let periods = match transmission {
            Some(transmission) => vec![transmission.matrix[(joint, joint)].abs()],
            None => {
                let own: Vec<f64> = left.iter().skip(joint).step_by(n).copied().collect();
                periods_a_turn(&coordinate, &own, |row| !rows[row].held_out, ripples)
            }
        };
        let distances = near.map_or_else(Vec::new, |near| near.distances(site));
        let laws = of_joint_laws(&coordinate, &periods, distances);
        candidates.extend(coordinate.candidates(laws, site, &shares, known));
    }
    candidates.extend(couplings(&clock, motion, transmission, known));
    candidates.push(common_delay(&clock, &nominal, n));
    candidates.iter_mut().for_each(bound);
    candidates.extend(misplaced.candidates(robot, &sites));
    let mut channels = channels(motion);
    channels.extend((0..n).map(|joint| {
        let predicted = nominal.iter().skip(joint).step_by(n).copied().collect();
        (format!("predicted torque of joint {}", joint + 1), predicted)
    }));
    channels.push(("time".into(), rows.iter().map(|row| row.time_s).collect()));
    Ok(Experiment {
        kind: Measured::JointTorque,
        axes: (1..=n).map(|k| Axis::new(format!("joint {k}"), "N·m")).collect(),
        n_norm: n,
        rows,
        residuals,
        measured: Some(measured),
        candidates,
        channels,
        bodies,
        findings: Vec::new(),
        curvature: match motion.is_sample {
            true => Curvature::None,
            false => Curvature::Beyond(Box::new(move |values| misplaced.beyond(values))),
        },
    })
}

/// Position, velocity and acceleration of each joint, by names for people.
fn channels(motion: &Motion) -> Vec<(String, Vec<f64>)> {
    let channel = |name: &str, of: &[Vec<f64>]| -> Vec<(String, Vec<f64>)> {
        of.iter().enumerate().map(|(k, values)| (format!("{name} of joint {}", k + 1), values.clone())).collect()
    };
    [channel("position", &motion.q), channel("velocity", &motion.v), channel("acceleration", &motion.a)].concat()
}

/// The links and what the tool carries, as candidates numbered from 0.
fn all_bodies(
    robot: &Robot,
    motion: &Motion,
    known: &[ModelEffect],
    columns: Vec<[Vec<f64>; 10]>,
) -> Result<Vec<(Candidate, BodyCandidate)>, PrepareError> {
    let carried = payload::candidates(robot, motion, known, &columns)?;
    let with_tool = robot.tool().and_then(|tool| tool.joint);
    let of_link = |(link, (joint, columns)): (usize, (&RobotJoint, [Vec<f64>; 10]))| {
        let ten = Body::from(&joint.joint.inertia).parameters();
        let site = Site::new(Place::Link(link), &joint.link);
        let of_body = if Some(link) == with_tool { bodies::carrying } else { bodies::candidate };
        of_body(link, site, &ten, robot.mass(), columns)
    };
    let links = robot.joints.iter().zip(columns).enumerate().map(of_link);
    Ok(links.chain(carried).collect())
}

/// Joints and a base that are not where the model has them; `bodies` are those of the experiment, `found` the effects that a
/// model has beside a placement.
fn misplaced(
    robot: &Robot,
    motion: &Motion,
    bodies: &[(Candidate, BodyCandidate)],
    placement: Placement,
    found: &[ModelEffect],
) -> Result<Misplaced, PrepareError> {
    let state =
        |row: usize| [&motion.q, &motion.v, &motion.a].map(|of| of.iter().map(|channel| channel[row]).collect());
    let states = (0..motion.payload.len()).map(state).collect();
    let link = robot.tool().and_then(|tool| tool.joint);
    let carried = |number: &u32| {
        let body = bodies.iter().position(|(candidate, _)| candidate.site.place == Place::Payload(*number))?;
        Some((body, link?))
    };
    let carried = motion.payload.iter().map(carried).collect();
    let off = |(candidate, _): &(Candidate, BodyCandidate)| {
        let is_own = |effect: &&ModelEffect| effect.law == candidate.law && effect.place == candidate.site.code;
        let own = found.iter().find(is_own);
        let size =
            move |value: &CandidateValue| own.and_then(|own| own.values.get(&value.name)).copied().unwrap_or_default();
        candidate.values.iter().map(size).collect::<Vec<f64>>()
    };
    let off: Vec<f64> = bodies.iter().flat_map(off).collect();
    Misplaced::new(robot, states, carried, placement, &off).map_err(|error| PrepareError::Nothing(error.to_string()))
}

/// Bounds the values of a law: the torques are those of the motors, so what takes power never lowers them.
fn bound(candidate: &mut Candidate) {
    let law = Law::named(candidate.law, candidate.shape.as_ref().map(|(_, constant, _)| *constant));
    let min = match law {
        Some(Law::Gain) => MIN_GAIN,
        Some(law) if law.takes_power() => 0.0,
        _ => return,
    };
    candidate.values.iter_mut().for_each(|value| value.min = min);
}

/// The columns of position, velocity, acceleration and torque of each joint, by its name, or by its number where there is none
/// of that name.
fn columns_of_joints(data: &Prepared, robot: &Robot) -> Vec<[String; 4]> {
    let of_joint = |(k, joint): (usize, &RobotJoint)| {
        [("", "q"), ("v_", "v"), ("a_", "a"), ("tau_", "tau")].map(|(beginning, letter)| {
            let named = format!("{beginning}{}", joint.name);
            if data.raw(&named).is_some() { named } else { format!("{letter}{}", k + 1) }
        })
    };
    robot.joints.iter().enumerate().map(of_joint).collect()
}

/// The columns that the experiment reads.
pub(crate) fn columns(data: &Prepared, robot: &Robot, transmission: Option<&Transmission>) -> TableColumns {
    if transmission.is_some() && data.raw("qm1").is_some() {
        let of_motors = |letters: &str| (1..=robot.joints.len()).map(|k| format!("{letters}{k}")).collect::<Vec<_>>();
        let [measured, positions] = ["taum", "qm"].map(|of| of_motors(of).into_iter().map(|column| vec![column]));
        let moving = positions.map(|columns| Moving { columns, turns: true }).collect();
        return TableColumns { measured: measured.collect(), moving };
    }
    let joints = robot.joints.iter().zip(columns_of_joints(data, robot));
    let (measured, moving) =
        joints.map(|(joint, [q, v, a, tau])| (vec![tau], Moving::of(joint, vec![q, v, a]))).unzip();
    TableColumns { measured, moving }
}

fn of_joints(data: &Prepared, robot: &Robot) -> Result<Motion, PrepareError> {
    if robot.joints.is_empty() {
        let what = "the robot of the model has no moving joint, so it has no torques; give the model of these data";
        return Err(PrepareError::Nothing(what.into()));
    }
    let mut motion = Motion::default();
    for [position, velocity, acceleration, torque] in columns_of_joints(data, robot) {
        let [q, v, a] = data.motion(&position, false)?;
        motion.v.push(data.optional(&velocity).unwrap_or(v));
        motion.a.push(data.optional(&acceleration).unwrap_or(a));
        motion.q.push(q);
        motion.tau.push(data.channel(&torque)?);
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
        let raw = data.raw(&name).map(|numbers| data.full(&numbers, false));
        motors.push(raw.map_or_else(|| data.channel(&name), Ok)?);
        torques.push(data.channel(&format!("taum{k}"))?);
    }
    let mixed = |row: &dyn Fn(usize) -> f64, of: &[Vec<f64>]| -> Vec<f64> {
        let length = of.first().map_or(0, Vec::len);
        (0..length).map(|at| of.iter().enumerate().map(|(k, channel)| row(k) * channel[at]).sum()).collect()
    };
    let mut motion = Motion::default();
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

/// Torques of the model, and the columns of each link's parameters where joints and base are placed so.
fn regressor_at(robot: &Robot, motion: &Motion, placement: &Placement, rows: usize) -> (Vec<f64>, Vec<[Vec<f64>; 10]>) {
    let (nominal, columns) = regressor(robot, motion, rows);
    if placement.is_as_modelled(robot) {
        return (nominal, columns);
    }
    // They are as large as all else together.
    drop(columns);
    let tilted = Robot { gravity: placement.gravity, ..robot.clone() };
    (nominal, regressor(&tilted, &motion.placed(placement), rows).1)
}

/// Torques of the model, and the columns of each link's parameters: rows × joints.
fn regressor(robot: &Robot, motion: &Motion, rows: usize) -> (Vec<f64>, Vec<[Vec<f64>; 10]>) {
    let n = robot.joints.len();
    let mut columns: Vec<[Vec<f64>; 10]> = (0..n).map(|_| std::array::from_fn(|_| vec![0.0; rows * n])).collect();
    let mut nominal = vec![0.0; rows * n];
    let tens: Vec<[f64; 10]> = robot.joints.iter().map(|joint| Body::from(&joint.joint.inertia).parameters()).collect();
    let base = BodyMotion::resting(&robot.gravity);
    for row in 0..rows {
        let at = |of: &[Vec<f64>]| -> Vec<f64> { of.iter().map(|channel| channel[row]).collect() };
        let (q, v, a) = (at(&motion.q), at(&motion.v), at(&motion.a));
        let moving = link_motions(robot, &base, [&q, &v, &a]);
        for (joint, rotor) in robot.joints.iter().map(|joint| joint.armature).enumerate() {
            nominal[row * n + joint] += rotor * a[joint];
        }
        for link in 0..n {
            let wrench = wrench_regressor(&moving[link]);
            let mut joint = Some(link);
            while let Some(carrier) = joint {
                let ten = joint_regressor(robot, carrier, &moving[carrier], &wrench);
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

/// Friction, also at these distances, the motor's own inertia, springs and offsets of one joint.
fn of_joint_laws(coordinate: &Coordinate, periods_a_turn: &[f64], mut distances: Vec<Law<f64>>) -> Vec<Law<f64>> {
    let mut laws = coordinate.friction();
    let of_seals = |law: &Law<f64>| {
        matches!(law, Law::PositionDependentFriction(_) | Law::LoadDependentPresliding(_) | Law::LoadDependentViscosity)
    };
    laws.retain(|law| !of_seals(law));
    laws.extend(coordinate.others());
    laws.extend(coordinate.of_motor(periods_a_turn));
    distances.retain(|law| !laws.contains(law));
    laws.extend(distances);
    laws
}
