//! Robots from MJCF, the robot description of MuJoCo: bodies, joints, limits and inertias into a [`Robot`].
//!
//! | in the file | here |
//! | --- | --- |
//! | `hinge`, `slide` | a joint; several joints of one body follow each other |
//! | `free` | the base floats, when no other body on the world moves; a root that is named reads one tree of several |
//! | `ball` | refused, with what to write in its place |
//! | body without joint | merged: its inertia goes to the body that moves it, its frame keeps its name |
//! | `site` with a name | a frame; where a body has the same name, it is called `site:NAME` |
//! | `inertial`, `geom` | inertia as MuJoCo compiles it, by `compiler` (`inertiafromgeom`, `inertiagrouprange`, `boundmass`, `boundinertia`, `balanceinertia`, `settotalmass`) |
//! | `mesh` of STL, OBJ, MSH, or with vertices and faces | read where a body has no `inertial`; inertia `exact` and `legacy`; others refused |
//! | `default`, `childclass`, `include`, `frame` | resolved |
//! | `armature` of a joint | adds to the diagonal of the mass matrix, of a free joint on all six axes of the base; of a tendon or actuator refused |
//! | `equality` of two joints, by a straight line | the first follows the second; it is no coordinate |
//! | other `equality`, `gravcomp`, `mocap` | not computed; the warnings say which, and where |
//! | an attribute that its element does not have | not read; the robot's `ignored` says which, and where |
//! | `replicate`, `composite`, `flexcomp`, `attach` | refused |
//! | `geom` with a `contype` or `conaffinity` | a shape that collides, read by [`parse_shapes`] alone; `exclude` is not read |
//! | actuators, tendons, sensors, contacts, springs, visuals | not read |
//!
//! Joints are numbered as MuJoCo numbers them, without those that a free joint has. Positions are those of MuJoCo's `qpos`:
//! a joint is at its `ref` where the body has the pose of the file.
//! Source: <https://mujoco.readthedocs.io/en/stable/XMLreference.html>.

mod attributes;
mod bodies;
mod build;
mod classes;
mod collision;
mod equality;
mod fault;
mod files;
mod frame;
mod geom;
mod inertial;
mod mesh;
mod settings;

use std::path::Path;

use crate::assembly::{Locks, Selection};
use crate::robot::Robot;
use crate::shape::LinkShape;
use crate::source::{FileError, Source};

pub use build::SITE;
pub use fault::MjcfFault;

/// Why a file gives no robot.
pub type MjcfError = FileError<MjcfFault>;

/// Reads a robot from an MJCF file and what it includes, with some of its joints locked.
///
/// # Errors
///
/// The file cannot be read; or as [`parse`].
pub fn read(path: &Path, locks: &Locks) -> Result<Robot, MjcfError> {
    of_source(&Source::read(path)?, &locks.into())
}

/// The robot that `text` describes; `path` serves messages, and its folder what the text includes.
///
/// # Errors
///
/// The text is not MJCF; a file that it includes cannot be read; it has something that changes motion or mass and is
/// not computed, or a name or number that cannot be; or `locks` names a joint that it does not have. The error names
/// file, line and column.
pub fn parse(path: &Path, text: &str, locks: &Locks) -> Result<Robot, MjcfError> {
    of_source(&Source::of_text(path, text), &locks.into())
}

/// The shapes that collide in the model that `text` describes; `path` as in [`parse`].
///
/// # Errors
///
/// The text is not MJCF, a file that it includes or a mesh cannot be read, or a shape has a size that cannot be.
pub fn parse_shapes(path: &Path, text: &str) -> Result<Vec<LinkShape>, MjcfError> {
    shapes_of(&Source::of_text(path, text))
}

/// The shapes that collide in what was read already.
pub(crate) fn shapes_of(source: &Source) -> Result<Vec<LinkShape>, MjcfError> {
    let files = files::Files::read(source.clone())?;
    collision::shapes(&files).map_err(|wrong| files.error(wrong))
}

/// The robot of what was read already.
pub(crate) fn of_source(source: &Source, selection: &Selection) -> Result<Robot, MjcfError> {
    let files = files::Files::read(source.clone())?;
    build::robot(&files, selection).map_err(|wrong| files.error(wrong))
}

#[cfg(test)]
mod tests;
