//! Why a recording gives no table.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Where in a recording something is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Where {
    /// In the complete file.
    File,
    /// In a line of a text, the first one being 1.
    Line(usize),
    /// In an array, a topic or a message.
    Part(String),
}

impl From<String> for Where {
    fn from(part: String) -> Self {
        if part.is_empty() { Self::File } else { Self::Part(part) }
    }
}

impl From<&str> for Where {
    fn from(part: &str) -> Self {
        part.to_owned().into()
    }
}

/// What is wrong with a recording or with its mapping: `FILE:LINE: what; what to do`, or `FILE: PART: what; what to do`.
#[derive(Debug)]
pub struct ImportError {
    /// The file.
    pub path: PathBuf,
    /// Where in it.
    pub place: Where,
    /// What is wrong, and what to do about it.
    pub fault: String,
}

impl ImportError {
    /// Of a place in a file.
    pub(crate) fn new(path: &Path, place: impl Into<Where>, fault: impl Into<String>) -> Self {
        Self { path: path.into(), place: place.into(), fault: fault.into() }
    }

    /// Of a file that the system does not give.
    pub(crate) fn io(path: &Path, error: &io::Error) -> Self {
        Self::new(path, Where::File, darm_robot::source::unreadable(error))
    }
}

impl fmt::Display for ImportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (path, fault) = (self.path.display(), &self.fault);
        match &self.place {
            Where::File => write!(f, "{path}: {fault}"),
            Where::Line(line) => write!(f, "{path}:{line}: {fault}"),
            Where::Part(part) => write!(f, "{path}: {part}: {fault}"),
        }
    }
}

impl std::error::Error for ImportError {}

/// What is wrong within a file: its place, and the fault with its cure.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) place: Where,
    pub(crate) text: String,
}

impl Fault {
    /// At a place.
    pub(crate) fn at(place: impl Into<Where>, text: impl Into<String>) -> Self {
        Self { place: place.into(), text: text.into() }
    }

    /// Of the complete file.
    pub(crate) fn of_file(text: impl Into<String>) -> Self {
        Self::at(Where::File, text)
    }

    /// The same with its file.
    pub(crate) fn in_file(self, path: &Path) -> ImportError {
        ImportError::new(path, self.place, self.text)
    }
}
