//! Why a recording gives no table.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// What is wrong with a recording or with its mapping: `FILE: PLACE: what; what to do`.
#[derive(Debug)]
pub struct ImportError {
    /// The file.
    pub path: PathBuf,
    /// Line, array, topic or message; empty of the complete file.
    pub place: String,
    /// What is wrong, and what to do about it.
    pub fault: String,
}

impl ImportError {
    /// Of a place in a file.
    pub(crate) fn new(path: &Path, place: impl Into<String>, fault: impl Into<String>) -> Self {
        Self { path: path.into(), place: place.into(), fault: fault.into() }
    }

    /// Of a file that the system does not give.
    pub(crate) fn io(path: &Path, error: &io::Error) -> Self {
        Self::new(path, "", format!("cannot be read: {error}"))
    }
}

impl fmt::Display for ImportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.path.display())?;
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        f.write_str(&self.fault)
    }
}

impl std::error::Error for ImportError {}

/// What is wrong within a file: its place (`line 3`, `array q`), and the fault with its cure.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) place: String,
    pub(crate) text: String,
}

impl Fault {
    /// At a place.
    pub(crate) fn at(place: impl Into<String>, text: impl Into<String>) -> Self {
        Self { place: place.into(), text: text.into() }
    }

    /// Of the complete file.
    pub(crate) fn of_file(text: impl Into<String>) -> Self {
        Self::at("", text)
    }

    /// The same with its file.
    pub(crate) fn in_file(self, path: &Path) -> ImportError {
        ImportError::new(path, self.place, self.text)
    }
}
