//! Why a table gives no experiment.

use crate::measurement::{ReadError, SelectError};

/// Why a table gives no experiment.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// A column is missing.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A selection makes no sense.
    #[error(transparent)]
    Select(#[from] SelectError),
    /// Nothing is left.
    #[error("{0}")]
    Nothing(String),
}
