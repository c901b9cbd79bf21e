//! Why a table gives no experiment.

use darm_measure::{ReadError, SelectError};

/// Why a table gives no experiment.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// A column is missing.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A selection makes no sense.
    #[error(transparent)]
    Select(#[from] SelectError),
    /// A row contradicts the model.
    #[error("{what}")]
    Row {
        /// Line of the file, the header being 1.
        line: usize,
        /// What is wrong, and what to do about it.
        what: String,
    },
    /// Nothing is left.
    #[error("{0}")]
    Nothing(String),
}
