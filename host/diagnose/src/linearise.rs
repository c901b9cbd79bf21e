//! Stage 2: the residuals of the model as it is, and how each value of each candidate effect moves them.
//!
//! A new kind of measurement is one file here that makes an [`experiment::Experiment`] and names the laws that can act on
//! what it observes, and its line in the list of kinds in [`model`].

pub mod arm_candidates;
pub mod bodies;
pub mod calibrated;
pub mod experiment;
#[cfg(test)]
mod faulty_robot_cases;
pub mod force;
pub mod laws;
pub mod measured_tool;
pub mod model;
pub mod model_effects;
pub mod point_contact;
pub mod position;
pub mod ripple;
pub mod sensitivity;
mod serial_chain;
pub mod torque;
pub mod wrench;

use crate::error::DiagnoseError;
use crate::prepare::signals::Prepared;
use crate::progress::Progress;
use darm_robot::robot::Robot;
use experiment::{Experiment, Moving, TableColumns};
use model::{Model, Predictor};
use torque::Near;

/// The experiment of each kind of measurement: a new kind is a variant of [`Predictor`] and its line here.
///
/// # Errors
///
/// A table without the columns of its kind, and an effect of the model that has no place in it.
pub(crate) fn linearise(model: &Model, data: &Prepared) -> Result<Experiment, DiagnoseError> {
    linearise_near(model, data, None, &Progress::default())
}

/// The experiment near a model that a search found: `near` gives the constants of the laws and the point at which columns are
/// taken.
///
/// # Errors
///
/// As [`linearise`], or the diagnosis was given up.
pub(crate) fn linearise_near(
    model: &Model,
    data: &Prepared,
    near: Option<Near>,
    progress: &Progress,
) -> Result<Experiment, DiagnoseError> {
    progress.check()?;
    let known = &model.effects;
    let mut experiment = match &model.what {
        Predictor::Cylinder { bore_m } => force::experiment(data, *bore_m, known)?,
        Predictor::Servo => position::experiment(data, known)?,
        Predictor::Torque(robot, transmission) => {
            torque::experiment(data, robot, transmission.as_ref(), known, near, progress)?
        }
        Predictor::Wrench(robot) => wrench::experiment(data, robot)?,
        Predictor::PointContact(robot, points) => point_contact::experiment(data, robot, points)?,
        Predictor::Tool(robot, how) => measured_tool::experiment(data, robot, how)?,
        Predictor::Any(robot) if is_wrench(data) => wrench::experiment(data, robot)?,
        Predictor::Any(robot) => torque::experiment(data, robot, None, known, near, progress)?,
    };
    model_effects::apply(&mut experiment, known)?;
    Ok(experiment)
}

/// Whether a table of a robot has the wrench of a force plate; else torques.
fn is_wrench(data: &Prepared) -> bool {
    data.raw("fz").is_some()
}

/// The columns that [`linearise`] reads, whose log may have them exchanged or in another unit.
pub(crate) fn columns(model: &Model, data: &Prepared) -> TableColumns {
    let named = |names: &[&str]| names.iter().map(|name| name.to_string()).collect::<Vec<_>>();
    let of_wrench = |robot: &Robot| TableColumns {
        measured: (0..3).map(|axis| named(&[wrench::WRENCH[axis], wrench::WRENCH[axis + 3]])).collect(),
        moving: robot.joints.iter().map(|joint| Moving::of(joint, vec![joint.name.clone()])).collect(),
    };
    match &model.what {
        Predictor::Cylinder { .. } => {
            let moving = Moving { columns: named(&["position", "velocity"]), turns: false };
            TableColumns { measured: vec![named(&["force"])], moving: vec![moving] }
        }
        Predictor::Servo => TableColumns { measured: vec![named(&["position"])], moving: Vec::new() },
        Predictor::PointContact(..) => TableColumns { measured: Vec::new(), moving: Vec::new() },
        Predictor::Tool(robot, how) => measured_tool::columns(data, robot, how),
        Predictor::Wrench(robot) => of_wrench(robot),
        Predictor::Any(robot) if is_wrench(data) => of_wrench(robot),
        Predictor::Torque(robot, transmission) => torque::columns(data, robot, transmission.as_ref()),
        Predictor::Any(robot) => torque::columns(data, robot, None),
    }
}
