//! Samples of a robot from a table: postures, torques and contact wrenches.
//!
//! | column | holds |
//! | --- | --- |
//! | `JOINT` or `q1`… (`_rad`, `_deg`, `_m`, `_mm`) | position of a joint |
//! | `tau_JOINT` or `tau1`… (`_nm`, `_n`) | its torque; a joint without one gives no row |
//! | `Fx` … `Mz` (`_n`, `_nm`) | what the ground exerts on the base, in the world about its origin; what is missing gives no row |
//! | `LINK_Fx` … `LINK_Mz` | the same on another link, for several contacts |
//! | `px` `py` `pz` `qx` `qy` `qz` `qw` | pose of the base in the world; without them it is at the origin |
//! | `t`, `fresh`, `held_out` | as for a diagnosis |

use std::path::Path;

use darm_core::real::Vec3;
use darm_core::se::Wrench;

use super::equations::{Rows, WRENCH_COMPONENTS};
use super::{Contact, Kind, Sample};
use darm_diagnose::linearise::wrench;
use darm_diagnose::prepare::signals::{Preparation, PrepareError, Prepared};
use darm_measure::ReadError;
use darm_measure::table::{Names, Table};
use darm_robot::rigid_body::regressor::BodyMotion;
use darm_robot::robot::Robot;

/// A table as samples.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// Row by row.
    pub samples: Vec<Sample>,
    /// Which components are measured.
    pub rows: Rows,
    /// Rows that the table holds out.
    pub held_out: Vec<usize>,
    /// What the owner of the data should know.
    pub findings: Vec<String>,
}

/// Why a table gives no samples.
#[derive(Debug, thiserror::Error)]
pub enum ReadSamplesError {
    /// The table cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A column is missing, or no row is left.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// Nobody measured a contact.
    #[error("{path}: no contact wrench; add at least the columns Fx, Fz and My (ground on robot, N and N·m, world)")]
    NoWrench {
        /// The file.
        path: String,
    },
}

/// Reads the samples of a robot. At rest velocities count as zero; of a motion the channels are low-passed at `lowpass_hz`.
///
/// # Errors
///
/// The file is not a table, a column of a joint or of the base is missing, no contact with the ground was measured, or
/// as [`Prepared::new`].
pub fn read(path: &Path, robot: &Robot, kind: Kind, lowpass_hz: Option<f64>) -> Result<Measurement, ReadSamplesError> {
    let (table, findings) = Table::read(path, &Names::new())?;
    let interpolate = table.quantity("fresh").map(|column| column.name.clone());
    let preparation = Preparation { lowpass_hz, interpolate, ..Preparation::default() };
    let names_own = table.quantity("held_out").is_some();
    let data = Prepared::new(table, &preparation, None)?;
    let motion = |own: String, numbered: String| {
        let name = if data.raw(&own).is_some() { own } else { numbered };
        data.motion(&name, true)
    };
    let mut joints = Vec::new();
    for (k, joint) in robot.joints.iter().enumerate() {
        joints.push(motion(joint.name.clone(), format!("q{}", k + 1))?);
    }
    let torques: Vec<Option<Vec<f64>>> = robot
        .joints
        .iter()
        .enumerate()
        .map(|(k, joint)| {
            data.optional(&format!("tau_{}", joint.name)).or_else(|| data.optional(&format!("tau{}", k + 1)))
        })
        .collect();
    let contacts = contacts(&data, robot);
    let any = |part: usize| contacts.iter().any(|(_, wrench)| wrench[part].is_some());
    let rows = Rows { wrench: std::array::from_fn(any), torque: torques.iter().map(Option::is_some).collect() };
    if !rows.wrench[5] {
        return Err(ReadSamplesError::NoWrench { path: path.display().to_string() });
    }
    let base = base(&data, robot, kind)?;
    let mut samples = Vec::with_capacity(data.rows.len());
    for row in 0..data.rows.len() {
        let at = |joint: &[Vec<f64>; 3], order: usize| {
            if order > 0 && kind == Kind::Static { 0.0 } else { joint[order][row] }
        };
        let contact = |(joint, wrench): &(_, _)| Contact { joint: *joint, wrench: wrench_at(wrench, row) };
        samples.push(Sample {
            line: data.rows[row].line,
            base: base[row],
            state: std::array::from_fn(|order| joints.iter().map(|joint| at(joint, order)).collect()),
            torque: torques.iter().map(|torque| torque.as_ref().map_or(0.0, |torque| torque[row])).collect(),
            contacts: contacts.iter().map(contact).collect(),
        });
    }
    let held_out = (0..data.rows.len()).filter(|&row| names_own && data.rows[row].held_out).collect();
    let findings = findings.iter().chain(&data.findings).map(ToString::to_string).collect();
    Ok(Measurement { samples, rows, held_out, findings })
}

type Channels = [Option<Vec<f64>>; 6];

/// The contacts that the table has columns of: on the base without a name before them, on any link with its name.
fn contacts(data: &Prepared, robot: &Robot) -> Vec<(Option<usize>, Channels)> {
    let named = robot.frames.iter().map(|frame| (frame.joint, format!("{}_", frame.name)));
    let all = std::iter::once((None, String::new())).chain(named);
    let channels = |(joint, name): (Option<usize>, String)| -> (Option<usize>, Channels) {
        (joint, WRENCH_COMPONENTS.map(|part| data.optional(&format!("{name}{}", part.to_lowercase()))))
    };
    all.map(channels).filter(|(_, wrench)| wrench.iter().any(Option::is_some)).collect()
}

fn wrench_at(channels: &Channels, row: usize) -> Wrench<f64> {
    let at = |part: usize| channels[part].as_ref().map_or(0.0, |channel| channel[row]);
    Wrench { moment: Vec3::new(at(0), at(1), at(2)), force: Vec3::new(at(3), at(4), at(5)) }
}

fn base(data: &Prepared, robot: &Robot, kind: Kind) -> Result<Vec<BodyMotion>, PrepareError> {
    let resting = BodyMotion::resting(&robot.gravity);
    if data.raw("px").is_none() {
        return Ok(vec![resting; data.rows.len()]);
    }
    let moving = wrench::base(data, &robot.gravity)?;
    Ok(match kind {
        Kind::Static => moving.into_iter().map(|at| BodyMotion { pose: at.pose, ..resting }).collect(),
        Kind::Moving => moving,
    })
}
