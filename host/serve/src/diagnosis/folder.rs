//! Files of a page in a folder of the server, for as long as they are needed.

use std::io;
use std::path::{Path, PathBuf};

use crate::refusal::{Kind, Refused};
use crate::upload::Upload;

/// A folder that is removed when it is dropped.
pub(super) struct Folder(tempfile::TempDir);

impl Folder {
    pub(super) fn new() -> Result<Self, Refused> {
        tempfile::tempdir().map(Self).map_err(|error| unwritable(&error))
    }

    pub(super) fn path(&self) -> &Path {
        self.0.path()
    }

    /// Writes the files of an upload; the path of the measurements.
    pub(super) fn write_upload(&self, upload: &Upload<'_>) -> Result<PathBuf, Refused> {
        upload.write(self.path()).map_err(|error| unwritable(&error))
    }

    /// Writes a file.
    pub(super) fn write(&self, name: &str, text: &str) -> Result<(), Refused> {
        std::fs::write(self.path().join(name), text).map_err(|error| unwritable(&error))
    }

    /// Reads a file.
    pub(super) fn read(&self, name: &str) -> Result<String, Refused> {
        std::fs::read_to_string(self.path().join(name)).map_err(|error| unwritable(&error))
    }

    /// The folder means nothing to a person: files are named as they were sent.
    pub(super) fn without(&self, text: &str) -> String {
        text.replace(&format!("{}/", self.path().display()), "")
    }

    /// A refusal of what was sent, with files named as they were sent.
    pub(super) fn refusal(&self, text: &str) -> Refused {
        Refused::new(Kind::Invalid, self.without(text))
    }
}

fn unwritable(error: &io::Error) -> Refused {
    Refused::new(
        Kind::Refused,
        format!("the server cannot keep the files: {error}; free space in its folder for temporary files"),
    )
}
