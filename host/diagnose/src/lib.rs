//! Measurements, and the physical effects that they show and a model lacks.

pub mod diagnose;
pub mod measurement;
pub mod truth;
