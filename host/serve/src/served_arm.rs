//! The arm of a server, and the file that it was read from.

use darm_arm::wired_arm::WiredArm;

/// The arm of a server.
pub struct ServedArm {
    /// The arm on its board.
    pub wired: WiredArm,
    /// Its file, as a person named it.
    pub file: String,
}

/// The name of a file without its folder.
pub(crate) fn file_name(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}
