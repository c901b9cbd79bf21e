//! Stage 2: the residuals of the model as it is, and how each value of each candidate effect moves them.
//!
//! A new kind of measurement is one file here that makes an [`experiment::Experiment`] and names the laws that can act on
//! what it observes, and its line in the list of kinds below.

pub mod arm_candidates;
pub mod bodies;
pub mod experiment;
pub mod force;
pub mod laws;
pub mod model;
pub mod model_effects;
pub mod model_error;
pub mod point_contact;
pub mod position;
pub mod ripple;
pub mod sensitivity;
pub mod torque;
pub mod wrench;

use crate::error::DiagnoseError;
use crate::prepare::signals::Prepared;
use experiment::Experiment;
use model::{Model, What};

/// The experiment of each kind of measurement: a new kind is a variant of [`What`] and its line here.
///
/// # Errors
///
/// A table without the columns of its kind, and an effect of the model that has no place in it.
pub(crate) fn linearise(model: &Model, data: &mut Prepared) -> Result<Experiment, DiagnoseError> {
    let known = &model.effects;
    let mut experiment = match &model.what {
        What::Cylinder { bore_m } => force::experiment(data, *bore_m, known)?,
        What::Servo => position::experiment(data, known)?,
        What::Torque(robot, transmission) => torque::experiment(data, robot, transmission.as_ref(), known)?,
        What::Wrench(robot) => wrench::experiment(data, robot)?,
        What::Closure(robot, points) => point_contact::experiment(data, robot, points)?,
        What::Any(robot) if data.raw("fz").is_some() => wrench::experiment(data, robot)?,
        What::Any(robot) => torque::experiment(data, robot, None, known)?,
    };
    model_effects::apply(&mut experiment, known)?;
    Ok(experiment)
}
