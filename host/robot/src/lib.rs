//! Robots at run-time size: URDF and tables of Denavit and Hartenberg, kinematics, dynamics, inverse kinematics.

pub mod dh;
pub mod ik;
pub mod literal;
pub mod rigid_body;
pub mod robot;
pub mod source;
pub mod tree;
pub mod urdf;
