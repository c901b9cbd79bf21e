//! A robot from a file in XML: its root element says whether it is URDF or MJCF.

use std::path::Path;

use crate::mjcf::{self, MjcfError};
use crate::robot::Robot;
use crate::source::Source;
use crate::urdf::{self, Locks, UrdfError};
use crate::xml::Document;

/// Why a file gives no robot.
#[derive(Debug, thiserror::Error)]
pub enum DescriptionError {
    /// Of a URDF, or of what is neither.
    #[error(transparent)]
    Urdf(#[from] UrdfError),
    /// Of an MJCF.
    #[error(transparent)]
    Mjcf(#[from] MjcfError),
}

/// Reads a robot from a URDF or MJCF file, with some of its joints locked.
pub fn read(path: &Path, locks: &Locks) -> Result<Robot, DescriptionError> {
    let source = Source::read_lossy::<urdf::UrdfFault>(path)?;
    match Document::parse(&source) {
        Ok(document) if document.root().tag() == "mujoco" => Ok(mjcf::parse(path, source.text(), locks)?),
        _ => Ok(urdf::parse(path, source.text(), locks)?),
    }
}

#[cfg(test)]
mod tests;
