//! Why a file is no model.

use darm_robot::description::DescriptionError;

/// Why a file is no model.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// It cannot be read.
    #[error("{0}: cannot be read: {1}")]
    Io(String, std::io::Error),
    /// It is no model.
    #[error("{0}: {1}")]
    Toml(String, toml::de::Error),
    /// Its robot cannot be read.
    #[error(transparent)]
    Robot(#[from] DescriptionError),
    /// A number makes no sense.
    #[error("{0}: {1}")]
    Value(String, String),
}
