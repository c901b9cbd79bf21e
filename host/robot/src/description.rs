//! A robot from a file: XML, whose root element says whether it is URDF or MJCF, or a Denavit–Hartenberg table in TOML.

use crate::dh::{self, TableError};
use crate::files::FileRef;
use crate::mjcf::{self, MjcfError};
use crate::robot::Robot;
use crate::shape::LinkShape;
use crate::source::{FileError, Source};
use crate::urdf::{self, Locks, Selection, UrdfError};
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
pub fn read<'a>(file: impl Into<FileRef<'a>>, locks: &Locks) -> Result<Robot, DescriptionError> {
    read_selected(file, &locks.into())
}

/// The same of a part of the file.
///
/// # Errors
///
/// As [`read`]; also where the file has no body or link of the name of the root.
pub fn read_selected<'a>(file: impl Into<FileRef<'a>>, selection: &Selection) -> Result<Robot, DescriptionError> {
    let file = file.into();
    of_source(&Source::read::<urdf::UrdfFault>(&file)?, selection)
}

/// The same of what was read already.
///
/// # Errors
///
/// As [`read_selected`].
pub fn of_source(source: &Source, selection: &Selection) -> Result<Robot, DescriptionError> {
    if source.is_toml() {
        return match (selection.locks.keys().next(), &selection.root) {
            (Some(joint), _) => Err(dh::locked(source.path(), joint).into()),
            (None, Some(root)) => Err(dh::rooted(source.path(), root).into()),
            (None, None) => Ok(dh::of_source(source)?),
        };
    }
    match Document::parse(source) {
        Ok(document) if document.root().tag() == "mujoco" => Ok(mjcf::of_source(source, selection)?),
        parsed => Ok(urdf::of_parsed(source, parsed, selection)?),
    }
}

/// Reads the shapes that collide from a URDF or MJCF file, by the names of the links that they are on.
///
/// # Errors
///
/// The file, or a file of a mesh, cannot be read; or a shape has no size above 0 or is of a kind that is not read.
pub fn read_shapes<'a>(file: impl Into<FileRef<'a>>) -> Result<Vec<LinkShape>, DescriptionError> {
    let file = file.into();
    let source = Source::read::<urdf::UrdfFault>(&file)?;
    match Document::parse(&source) {
        Ok(document) if document.root().tag() == "mujoco" => Ok(mjcf::shapes_of(&source)?),
        parsed => Ok(urdf::shapes_of(&source, parsed)?),
    }
}

#[cfg(test)]
mod tests;
