//! Robots at run-time size: URDF, MJCF and tables of Denavit and Hartenberg, kinematics, dynamics, inverse kinematics.

mod assembly;
pub mod csv_table;
pub mod description;
pub mod dh;
pub mod files;
pub mod ik;
pub mod literal;
mod mesh_file;
pub mod mjcf;
pub mod rigid_body;
pub mod robot;
pub mod shape;
pub mod source;
pub mod svd;
#[cfg(test)]
mod testing;
pub mod tree;
pub mod urdf;
mod xml;
