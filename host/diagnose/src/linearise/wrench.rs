//! Contact wrench and centre of pressure of a body on a plate: predicted by inverse dynamics on a moving base.
//!
//! The axes are the centre of pressure first, which is linear in the masses when it is divided by the measured force:
//! (−M_y − x·F_z)/F_z and (M_x − y·F_z)/F_z with predicted moments and force above, measured x, y and F_z; then the
//! forces and the moment about z. The plate's frame is the world: z up, moments about its origin; what it is off by is the
//! law `sensor-frame`: with d where its origin is and θ how it is turned, F' = F − θ×F and M' = M − d×F − θ×M, to first order
//! and of the measured wrench.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::Body;
use nalgebra::{Quaternion, UnitQuaternion};

use crate::effect::{LawName, Place, Site};
use crate::linearise::bodies::candidate;
use crate::linearise::experiment::{Axis, Candidate, CandidateValue, Curvature, Experiment};
use crate::measured::Measured;
use crate::prepare::signals::{PrepareError, Prepared};
use darm_robot::rigid_body::regressor::{BodyMotion, link_motions, wrench_regressor};
use darm_robot::robot::{Robot, RobotJoint};

/// Components of the wrench as they are named in a table: moment, then force.
pub(crate) const WRENCH: [&str; 6] = ["Mx", "My", "Mz", "Fx", "Fy", "Fz"];
/// The force along z among them.
const FZ: usize = 5;

/// The experiment of a robot whose base moves as in the table.
pub(crate) fn experiment(data: &Prepared, robot: &Robot) -> Result<Experiment, PrepareError> {
    let base = base(data, &robot.gravity)?;
    let mut joints = [Vec::new(), Vec::new(), Vec::new()];
    for joint in &robot.joints {
        data.motion(&joint.name, true)?.into_iter().zip(&mut joints).for_each(|(channel, all)| all.push(channel));
    }
    let mut measured = Vec::new();
    for name in WRENCH {
        measured.push(data.channel(name)?);
    }
    if let Some(row) = measured[FZ].iter().position(|force| *force <= 0.0) {
        let what =
            "the ground does not push (Fz is not above 0); give what the ground exerts on the robot, z up".into();
        return Err(PrepareError::Row { line: data.rows[row].line, what });
    }
    let loads = loads(data, robot, &base, &joints);
    let tens: Vec<[f64; 10]> = std::iter::once(&robot.base)
        .chain(robot.joints.iter().map(|joint| &joint.joint.inertia))
        .map(|inertia| Body::from(inertia).parameters())
        .collect();
    let axes = Axes { measured: &measured };
    let of_joint = |(k, joint): (usize, &RobotJoint)| Site::new(Place::Link(k), &joint.link);
    let sites =
        std::iter::once(Site::new(Place::Base, "the base")).chain(robot.joints.iter().enumerate().map(of_joint));
    let robot_kg = robot.mass() + if robot.floating { 0.0 } else { robot.base.mass };
    let mut residuals = axes.column(|row, k| -measured[k][row]);
    let (mut candidates, mut bodies) = (Vec::new(), Vec::new());
    for ((site, ten), load) in sites.zip(&tens).zip(&loads).filter(|((_, ten), _)| ten[0] > 0.0) {
        let columns: [Vec<f64>; 10] = std::array::from_fn(|k| axes.column(|row, part| load[k][part][row]));
        for (column, size) in columns.iter().zip(ten) {
            residuals.iter_mut().zip(column).for_each(|(residual, slope)| *residual += slope * size);
        }
        let (candidate, body) = candidate(candidates.len(), site, ten, robot_kg, columns);
        candidates.push(candidate);
        bodies.push(body);
    }
    candidates.push(sensor_frame(&measured, &axes));
    Ok(Experiment {
        kind: Measured::ContactWrench,
        axes: AXES.iter().map(|(name, unit)| Axis::new(*name, unit)).collect(),
        n_norm: 2,
        rows: data.rows.clone(),
        residuals,
        measured: Some(axes.measured()),
        candidates,
        channels: channels(data, robot, joints),
        bodies,
        findings: Vec::new(),
        curvature: Curvature::None,
    })
}

const AXES: [(&str, &str); 6] = [("cop x", "m"), ("cop y", "m"), ("Fx", "N"), ("Fy", "N"), ("Fz", "N"), ("Mz", "N·m")];

fn channels(data: &Prepared, robot: &Robot, joints: [Vec<Vec<f64>>; 3]) -> Vec<(String, Vec<f64>)> {
    let [positions, ..] = joints;
    let named = robot.joints.iter().map(|joint| joint.name.clone()).zip(positions);
    std::iter::once(("time".to_string(), data.time_s.clone())).chain(named).collect()
}

struct Axes<'a> {
    measured: &'a [Vec<f64>],
}

impl Axes<'_> {
    /// What was measured on each axis: rows × 6.
    fn measured(&self) -> Vec<f64> {
        let [mx, my, mz, fx, fy, fz] = self.measured else { return Vec::new() };
        let row = |row: usize| [-my[row] / fz[row], mx[row] / fz[row], fx[row], fy[row], fz[row], mz[row]];
        (0..fz.len()).flat_map(row).collect()
    }

    /// The axes of a wrench: rows × 6. `wrench` gives a component in a row.
    fn column(&self, wrench: impl Fn(usize, usize) -> f64) -> Vec<f64> {
        let [mx, my, _, _, _, fz] = self.measured else { return Vec::new() };
        let row = |row: usize| {
            let (x, y) = (-my[row] / fz[row], mx[row] / fz[row]);
            let w = |k: usize| wrench(row, k);
            [(-w(1) - x * w(FZ)) / fz[row], (w(0) - y * w(FZ)) / fz[row], w(3), w(4), w(FZ), w(2)]
        };
        (0..fz.len()).flat_map(row).collect()
    }
}

/// The plate is displaced or rotated.
fn sensor_frame(measured: &[Vec<f64>], axes: &Axes) -> Candidate {
    let value = |(k, (name, unit)): (usize, (&str, &str))| {
        let column = axes.column(|row, part| wrench_of_frame(measured, k, row, part));
        CandidateValue { name: name.into(), unit: unit.into(), prior: f64::INFINITY, min: f64::NEG_INFINITY, column }
    };
    let names =
        [("x", "m"), ("y", "m"), ("z", "m"), ("turn about x", "rad"), ("turn about y", "rad"), ("turn about z", "rad")];
    let values = names.into_iter().enumerate().map(value).collect();
    let site = Site::new(Place::ForcePlate, "the plate");
    Candidate { law: LawName::SensorFrame, site, shape: None, values }
}

/// What 1 m or 1 rad of the error `k` of the plate's frame adds to a part of the wrench in a row, N or N·m.
fn wrench_of_frame(measured: &[Vec<f64>], k: usize, row: usize, part: usize) -> f64 {
    let about = Vec3::ith(k % 3, 1.0);
    let turned = |first: usize| about.cross(&Vec3::from_fn(|axis, _| measured[first + axis][row]))[part % 3];
    let (is_moved, is_moment) = (k < 3, part < 3);
    match (is_moved, is_moment) {
        (true, false) => 0.0,
        (true, true) | (false, false) => -turned(3),
        (false, true) => -turned(0),
    }
}

/// Each body's load per parameter and component of the wrench, along the rows: the base first.
fn loads(data: &Prepared, robot: &Robot, base: &[BodyMotion], joints: &[Vec<Vec<f64>>; 3]) -> Vec<Vec<Vec<Vec<f64>>>> {
    let n = robot.joints.len() + 1;
    let mut all = vec![vec![vec![vec![0.0; base.len()]; 6]; 10]; n];
    for (row, base) in base.iter().enumerate() {
        let at = |of: &[Vec<f64>]| -> Vec<f64> { of.iter().map(|channel| channel[row]).collect() };
        let [q, v, a] = [at(&joints[0]), at(&joints[1]), at(&joints[2])];
        let moving = link_motions(robot, base, [&q, &v, &a]);
        for (body, moving) in std::iter::once(base).chain(&moving).enumerate() {
            let wrench = wrench_regressor(moving);
            for (k, parts) in all[body].iter_mut().enumerate() {
                parts.iter_mut().enumerate().for_each(|(part, channel)| channel[row] = wrench[(part, k)]);
            }
        }
    }
    for channel in all.iter_mut().flatten().flatten() {
        data.again(channel);
    }
    all
}

/// How the base moves in the world at each row; `gravity`, m/s² in the world, is subtracted from its acceleration.
///
/// # Errors
///
/// One of the columns `px`, `py`, `pz`, `qx`, `qy`, `qz` and `qw` is missing.
pub fn base(data: &Prepared, gravity: &Vec3<f64>) -> Result<Vec<BodyMotion>, PrepareError> {
    let place = [data.motion("px", true)?, data.motion("py", true)?, data.motion("pz", true)?];
    let mut turn = Vec::new();
    for name in ["qx", "qy", "qz", "qw"] {
        let none = || {
            PrepareError::Nothing(format!("no column {name}: the base's orientation is a quaternion qx, qy, qz, qw"))
        };
        turn.push(data.raw(name).ok_or_else(none)?.to_vec());
    }
    one_sign(&mut turn);
    let turn: Vec<[Vec<f64>; 3]> = turn.iter().map(|part| data.rates(data.full(part, true))).collect();
    let quaternion = |row: usize| {
        let [x, y, z, w] = std::array::from_fn(|k| turn[k][0][row]);
        UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
    };
    // ω = 2·q̇·q*, and ω̇ = 2·q̈·q* but for a real part, since q̇·q̇* is real.
    let angular = |order: usize, row: usize| {
        let [x, y, z, w] = std::array::from_fn(|k| turn[k][order][row]);
        let spin = Quaternion::new(w, x, y, z) * quaternion(row).conjugate().into_inner() * 2.0;
        Vec3::new(spin.i, spin.j, spin.k)
    };
    let moving = |row: usize| {
        let vector = |order: usize| Vec3::new(place[0][order][row], place[1][order][row], place[2][order][row]);
        let pose = Pose { rotation: quaternion(row).to_rotation_matrix().into_inner(), position: vector(0) };
        let acceleration = vector(2) - gravity;
        BodyMotion { pose, omega: angular(1, row), alpha: angular(2, row), acceleration }
    };
    Ok((0..data.rows.len()).map(moving).collect())
}

/// q and −q are the same turn: each row takes the sign that is nearer to the row before.
fn one_sign(turn: &mut [Vec<f64>]) {
    let rows = turn.first().map_or(0, Vec::len);
    for row in 1..rows {
        let along: f64 = turn.iter().map(|part| part[row] * part[row - 1]).sum();
        if along < 0.0 {
            turn.iter_mut().for_each(|part| part[row] = -part[row]);
        }
    }
}
