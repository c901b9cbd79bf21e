//! Robots from URDF, the robot description of ROS: joints, links, limits and inertias into a [`Robot`].
//!
//! | in the file | here |
//! | --- | --- |
//! | `revolute`, `continuous`, `prismatic` | a joint; a continuous one has no limits |
//! | `fixed` | merged: the child's inertia goes to the link that moves it, its frame keeps its name |
//! | `floating` | the base floats, when the joint stands on the root and nothing else does; refused elsewhere |
//! | `planar`, `spherical` | refused, with what to write in their place |
//! | `mimic` | a joint that moves on its own; [`Robot::warnings`] says so |
//! | `<inertial>` missing | no mass; the warnings say which |
//! | `<limit>` missing, or 0 to 0 | no limits; the warnings say which |
//! | `<visual>`, `<collision>`, `<transmission>` | not read |
//!
//! Joints stand in the order in which a walk from the root meets them, branch by branch, children in the order of the file.
//! Roll, pitch and yaw are angles about the fixed x, y and z: R = Rot_z(y)·Rot_y(p)·Rot_x(r).
//! Source: <https://wiki.ros.org/urdf/XML>.

mod build;
mod fault;

use std::collections::BTreeMap;
use std::path::Path;

use crate::robot::Robot;
use crate::source::Source;
use crate::source::{Fault, FileError};
pub use fault::UrdfFault;

/// Why a file gives no robot.
pub type UrdfError = FileError<UrdfFault>;

/// Joints by name that are held at a position (rad or m) as if they were fixed.
pub type Locks = BTreeMap<String, f64>;

/// Reads a robot from a URDF file, with some of its joints locked.
pub fn read(path: &Path, locks: &Locks) -> Result<Robot, UrdfError> {
    robot(&Source::read(path)?, locks)
}

/// The robot that `text` describes; `path` only serves messages.
pub fn parse(path: &Path, text: &str, locks: &Locks) -> Result<Robot, UrdfError> {
    robot(&Source::of_text(path, text), locks)
}

fn robot(source: &Source, locks: &Locks) -> Result<Robot, UrdfError> {
    let syntax = |error: urdf_rs::UrdfError| source.error(None, Fault::Syntax(error.to_string()));
    let file = urdf_rs::read_from_string(source.text()).map_err(syntax)?;
    build::robot(&file, locks).map_err(|(element, fault)| {
        let span = element.and_then(|element| element.span(source.text()));
        source.error(span, Fault::Content(Box::new(fault)))
    })
}

#[cfg(test)]
mod tests;
