//! The model of an experiment that is no arm of words: a small TOML, or a URDF alone.
//!
//! ```toml
//! kind = "cylinder"        # force of one fluid actuator: p·A
//! bore_mm = 25.0
//! ```
//!
//! | kind | keys | observed |
//! | --- | --- | --- |
//! | `cylinder` | `bore_mm` | force against gauge pressure |
//! | `servo` | | position against target |

use std::path::Path;

use serde::Deserialize;

/// A model of an experiment.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Model {
    /// One fluid actuator.
    Cylinder {
        /// Diameter of its piston, mm.
        bore_mm: f64,
    },
    /// One joint that holds its target.
    Servo {},
}

/// Why a file is no model.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// It cannot be read.
    #[error("{0}: cannot be read: {1}")]
    Io(String, std::io::Error),
    /// It is no model.
    #[error("{0}: {1}")]
    Toml(String, toml::de::Error),
    /// A number makes no sense.
    #[error("{0}: {1}")]
    Value(String, &'static str),
}

impl Model {
    /// Reads a model.
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| ModelError::Io(name.clone(), error))?;
        let model: Self = toml::from_str(&text).map_err(|error| ModelError::Toml(name.clone(), error))?;
        match model {
            Self::Cylinder { bore_mm } if !(bore_mm > 0.0 && bore_mm.is_finite()) => {
                Err(ModelError::Value(name, "bore_mm must be more than 0"))
            }
            model => Ok(model),
        }
    }

    /// Whether a text is such a model, and not an arm file.
    pub fn is_one(text: &str) -> bool {
        text.parse::<toml::Table>().is_ok_and(|table| table.get("kind").is_some_and(toml::Value::is_str))
    }
}
