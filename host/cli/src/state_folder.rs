//! The user's state folder: history of the console, simulated board.

use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

/// The home folder is unknown.
#[derive(Debug, thiserror::Error)]
#[error("neither HOME nor XDG_STATE_HOME is set; name a folder with --folder")]
pub(crate) struct NoHomeDir;

/// The state folder of `darm`.
pub(crate) fn path() -> Option<PathBuf> {
    let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".local/state"));
    let state = std::env::var_os("XDG_STATE_HOME").map(PathBuf::from).or_else(home)?;
    Some(state.join("darm"))
}

/// The folder of the board of `darm sim`.
pub(crate) fn board() -> Result<PathBuf, NoHomeDir> {
    path().map(|path| path.join("board")).ok_or(NoHomeDir)
}

/// The socket at which the process that holds `port` accepts a stop from other processes; `None` without a home folder.
///
/// Its name is a digest, since a socket's path has at most 107 bytes, of the port's real path.
pub(crate) fn stop_socket(port: &str) -> Option<PathBuf> {
    let plain = port.strip_prefix("unix:").unwrap_or(port);
    let real = std::fs::canonicalize(plain).map_or_else(|_| port.to_owned(), |real| real.display().to_string());
    let digest = Sha256::digest(real.as_bytes());
    let name: String = digest.iter().take(8).map(|byte| format!("{byte:02x}")).collect();
    Some(path()?.join("ports").join(name))
}

/// The port of the board in `folder`.
pub(crate) fn port(folder: &Path) -> PathBuf {
    folder.join("port")
}

/// The camera's socket of the board in `folder`.
pub(crate) fn camera(folder: &Path) -> PathBuf {
    folder.join("camera")
}
