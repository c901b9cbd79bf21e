//! Stage 2: the residuals of the model as it is, and how each value of each candidate effect moves them.
//!
//! A new kind of measurement is one file here that makes an [`experiment::Experiment`]; it names the laws that can act on
//! what it observes.

pub mod arm_candidates;
pub mod bodies;
pub mod experiment;
pub mod force;
pub mod laws;
pub mod model;
pub mod model_effects;
pub mod point_contact;
pub mod position;
pub mod ripple;
pub mod sensitivity;
pub mod torque;
pub mod wrench;
