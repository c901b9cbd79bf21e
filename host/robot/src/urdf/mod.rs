//! Robots from URDF, the robot description of ROS: joints, links, limits and inertias into a [`Robot`].
//!
//! | in the file | here |
//! | --- | --- |
//! | `revolute`, `continuous`, `prismatic` | a joint; a continuous one has no limits |
//! | `fixed` | merged: the child's inertia goes to the link that moves it, its frame keeps its name |
//! | `floating` | the base floats, when the joint is on the root and nothing else is; refused elsewhere |
//! | `planar`, `spherical` | refused, with what to write in their place |
//! | `mimic` | a joint that moves on its own; [`Robot::warnings`] says so |
//! | `<inertial>` missing | no mass; the warnings say which |
//! | `<limit>` missing, or 0 to 0 | no limits; the warnings say which |
//! | `<visual>`, `<collision>`, `<transmission>`, `<material>`, `<gazebo>` | not read, and not checked |
//!
//! Joints are in the order in which a walk from the root meets them, branch by branch, children in the order of the file.
//! Roll, pitch and yaw are angles about the fixed x, y and z: R = Rot_z(y)·Rot_y(p)·Rot_x(r).
//! Source: <https://wiki.ros.org/urdf/XML>.

mod build;
mod fault;
mod xml;

use std::collections::BTreeMap;
use std::ops::Range;
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
    let not_xml = |wrong: xml::NotXml| source.error(Some(wrong.span), Fault::Syntax(wrong.reason));
    let outline = xml::outline(source.text()).map_err(not_xml)?;
    let file = urdf_rs::read_from_string(&outline.text).map_err(|error| {
        let (span, reason) = first_unreadable(&outline).unwrap_or((0..0, error.to_string()));
        source.error(Some(span), Fault::Syntax(reason))
    })?;
    build::robot(&file, locks).map_err(|(element, fault)| {
        let span = element.and_then(|element| element.span(source.text()));
        source.error(span, Fault::Content(Box::new(fault)))
    })
}

/// The first link or joint that cannot be read even on its own, and why: the reader of URDF reports no place.
fn first_unreadable(outline: &xml::Outline) -> Option<(Range<usize>, String)> {
    outline.children.iter().find_map(|span| {
        let alone = format!("<robot name=\"alone\">{}</robot>", outline.text.get(span.clone())?);
        let reason = urdf_rs::read_from_string(&alone).err()?.to_string();
        Some((span.clone(), reason.trim_start_matches("custom: ").to_owned()))
    })
}

#[cfg(test)]
mod tests;
