//! Why the store refuses an image or fails.

use darm_core::profile::ProfileError;
use darm_core::table::TableError;
use darm_core::wire::message::Refusal;

/// The flash could not be read or written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StorageError;

/// Why an upload does not continue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UploadError {
    /// The image is longer than a slot, or empty.
    TooLong {
        /// Longest image of its kind in bytes.
        max: u32,
    },
    /// No upload has begun.
    NoUpload,
    /// The flash could not be written.
    Storage,
}

/// Why an image is not a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadError {
    /// Length, digest or model differ from what was announced.
    Damaged,
    /// The table breaks a limit.
    Table(TableError),
    /// The profile cannot be run safely.
    Profile(ProfileError),
    /// The flash could not be read.
    Storage,
}

impl From<UploadError> for Refusal {
    fn from(error: UploadError) -> Self {
        match error {
            UploadError::TooLong { max } => Self::TooLong { max },
            UploadError::NoUpload => Self::NoUpload,
            UploadError::Storage => Self::Storage,
        }
    }
}

impl From<LoadError> for Refusal {
    fn from(error: LoadError) -> Self {
        match error {
            LoadError::Damaged => Self::Damaged,
            LoadError::Table(error) => Self::Table(error),
            LoadError::Profile(error) => Self::Profile(error),
            LoadError::Storage => Self::Storage,
        }
    }
}

impl From<StorageError> for UploadError {
    fn from(_: StorageError) -> Self {
        Self::Storage
    }
}
