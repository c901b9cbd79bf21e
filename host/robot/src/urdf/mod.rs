//! Robots from URDF, the robot description of ROS: joints, links, limits and inertias into a [`Robot`].
//!
//! | in the file | here |
//! | --- | --- |
//! | `revolute`, `continuous`, `prismatic` | a joint; a continuous one has no limits |
//! | `fixed` | merged: the child's inertia goes to the link that moves it, its frame keeps its name |
//! | `floating` | the base floats, when the joint is on the root and nothing else is; refused elsewhere |
//! | `planar`, `spherical` | refused, with what to write in their place |
//! | `mimic` | follows the joint that it names, through any number of others; it is no coordinate |
//! | `<inertial>` missing | no mass; the warnings say which |
//! | `<limit>` missing, or 0 to 0 | no limits; the warnings say which |
//! | `<collision>` | read by [`parse_shapes`] alone |
//! | `xacro:…`, `${…}`, `$(arg …)` | refused, with the command that expands it |
//! | an attribute or element that its element does not have, a second element where there is one | not read; the robot's `ignored` says which, and where |
//! | elements beside links and joints | not read, and not checked |
//!
//! Joints are in the order in which a walk from the root meets them, branch by branch, children in the order of the file.
//! An `<origin>` has its rotation as `rpy` or as `quat_xyzw`. Roll, pitch and yaw are angles about the fixed x, y and z: R = Rot_z(y)·Rot_y(p)·Rot_x(r).
//! Source: <https://wiki.ros.org/urdf/XML>.

mod attributes;
mod build;
mod collision;
mod elements;
mod fault;
mod hierarchy;

use std::path::Path;

use crate::robot::Robot;
use crate::shape::LinkShape;
use crate::source::{Fault, FileError, Source};
use crate::xml::{Attribute, Document, NotXml};

pub use crate::assembly::{Locks, Selection};
pub use fault::UrdfFault;

/// Why a file gives no robot.
pub type UrdfError = FileError<UrdfFault>;

/// Reads a robot from a URDF file, with some of its joints locked.
///
/// # Errors
///
/// The file cannot be read; or as [`parse`].
pub fn read(path: &Path, locks: &Locks) -> Result<Robot, UrdfError> {
    of_source(&Source::read(path)?, locks)
}

/// The robot that `text` describes; `path` only serves messages.
///
/// # Errors
///
/// The text is not XML of a URDF; its links and joints do not form one tree, a name or number cannot be, or something
/// is missing; or `locks` names a joint that it does not have. The error names line and column.
pub fn parse(path: &Path, text: &str, locks: &Locks) -> Result<Robot, UrdfError> {
    of_source(&Source::of_text(path, text), locks)
}

/// The shapes that collide in the URDF that `text` is; `path` serves messages, and its folder the files of meshes.
///
/// # Errors
///
/// The text is not XML of a URDF, the file of a mesh cannot be read, or a shape is missing or has a size that is not
/// above 0.
pub fn parse_shapes(path: &Path, text: &str) -> Result<Vec<LinkShape>, UrdfError> {
    let source = Source::of_text(path, text);
    shapes_of(&source, Document::parse(&source))
}

/// The shapes that collide in what was read already.
pub(crate) fn shapes_of(source: &Source, parsed: Result<Document, NotXml>) -> Result<Vec<LinkShape>, UrdfError> {
    collision::shapes(document(source, parsed)?.root(), source).map_err(|(span, fault)| source.wrong(span, fault))
}

fn of_source(source: &Source, locks: &Locks) -> Result<Robot, UrdfError> {
    of_parsed(source, Document::parse(source), &locks.into())
}

/// The robot of what was read and parsed already.
pub(crate) fn of_parsed(
    source: &Source,
    parsed: Result<Document, NotXml>,
    selection: &Selection,
) -> Result<Robot, UrdfError> {
    let document = document(source, parsed)?;
    let mut robot = build::robot(document.root(), selection).map_err(|(span, fault)| source.wrong(span, fault))?;
    robot.ignored = attributes::unread(document.root(), source);
    Ok(robot)
}

/// The elements, unless they have to be expanded by `xacro` first.
fn document(source: &Source, parsed: Result<Document, NotXml>) -> Result<Document, UrdfError> {
    let document = parsed.map_err(|wrong| source.error(Some(wrong.span), Fault::Syntax(wrong.reason)))?;
    // The prefix of the namespace is up to the file.
    let is_declared = |prefix: &str| {
        let declares =
            |own: &&Attribute| own.name.strip_prefix("xmlns:") == Some(prefix) && own.value.contains("xacro");
        prefix == "xacro" || document.root().attributes().iter().any(|own| declares(&own))
    };
    let found = document.elements().find_map(|element| {
        let tag = element.tag().split_once(':').filter(|(prefix, _)| is_declared(prefix));
        let by_value =
            || element.attributes().iter().find(|own| own.value.contains("${") || own.value.contains("$(arg"));
        let what =
            tag.map(|_| format!("<{}>", element.tag())).or_else(|| by_value().map(|own| format!("`{}`", own.value)));
        Some((element.span(), what?))
    });
    if let Some((span, what)) = found {
        return Err(source.wrong(span, UrdfFault::Xacro { what, file: source.path().display().to_string() }));
    }
    Ok(document)
}

#[cfg(test)]
mod tests;
