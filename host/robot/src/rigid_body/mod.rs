//! Rigid bodies on moving links: motion, the regressor of their wrenches, and their inertial parameters.

pub mod cone;
pub mod inertia;
pub mod regressor;
pub mod solid;
