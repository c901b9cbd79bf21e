//! A robot from a file: XML, whose root element says whether it is URDF or MJCF, or a Denavit–Hartenberg table in TOML.

use std::path::Path;

use crate::dh::{self, TableError};
use crate::mjcf::{self, MjcfError};
use crate::robot::Robot;
use crate::shape::LinkShape;
use crate::source::{FileError, Source};
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
    /// Of a Denavit–Hartenberg table.
    #[error(transparent)]
    Table(#[from] TableError),
}

impl From<DescriptionError> for FileError<String> {
    fn from(error: DescriptionError) -> Self {
        match error {
            DescriptionError::Urdf(error) => error.map(|fault| fault.to_string()),
            DescriptionError::Mjcf(error) => error.map(|fault| fault.to_string()),
            DescriptionError::Table(error) => error.map(|fault| fault.to_string()),
        }
    }
}

/// Reads a robot from a URDF or MJCF file, with some of its joints locked, or from a Denavit–Hartenberg table.
///
/// # Errors
///
/// The file cannot be read, is neither URDF nor MJCF, describes no robot that is computed, or has no joint of a name in
/// `locks`. The error names line and column.
pub fn read(path: &Path, locks: &Locks) -> Result<Robot, DescriptionError> {
    if path.extension().is_some_and(|end| end == "toml") {
        return match locks.keys().next() {
            Some(joint) => Err(dh::locked(path, joint).into()),
            None => Ok(dh::read(path)?),
        };
    }
    let source = Source::read_lossy::<urdf::UrdfFault>(path)?;
    match Document::parse(&source) {
        Ok(document) if document.root().tag() == "mujoco" => Ok(mjcf::parse(path, source.text(), locks)?),
        _ => Ok(urdf::parse(path, source.text(), locks)?),
    }
}

/// Reads the shapes that collide from a URDF or MJCF file, by the names of the links that they are on.
///
/// # Errors
///
/// The file, or a file of a mesh, cannot be read; or a shape has no size above 0 or is of a kind that is not read.
pub fn read_shapes(path: &Path) -> Result<Vec<LinkShape>, DescriptionError> {
    let source = Source::read_lossy::<urdf::UrdfFault>(path)?;
    match Document::parse(&source) {
        Ok(document) if document.root().tag() == "mujoco" => Ok(mjcf::parse_shapes(path, source.text())?),
        _ => Ok(urdf::parse_shapes(path, source.text())?),
    }
}

#[cfg(test)]
mod tests;
