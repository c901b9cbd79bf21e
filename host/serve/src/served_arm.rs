//! The arm of a server, and the file that it was read from.

use darm_arm::wired_arm::WiredArm;

/// The arm of a server.
pub struct ServedArm {
    /// The arm on its board.
    pub wired: WiredArm,
    /// Its file, as a person named it.
    pub file: String,
}

impl ServedArm {
    /// The name of its file without the folder.
    pub(crate) fn file_name(&self) -> &str {
        self.file.rsplit('/').next().unwrap_or(&self.file)
    }
}
