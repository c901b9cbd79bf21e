//! The user's folder for what is kept from one run to the next: the console's history, the emulated board.

use std::path::{Path, PathBuf};

/// There is no home.
#[derive(Debug, thiserror::Error)]
#[error("neither HOME nor XDG_STATE_HOME is set; give a folder with --folder")]
pub(crate) struct Homeless;

/// The folder `darm` keeps its state in.
pub(crate) fn path() -> Option<PathBuf> {
    let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".local/state"));
    let state = std::env::var_os("XDG_STATE_HOME").map(PathBuf::from).or_else(home)?;
    Some(state.join("darm"))
}

/// The folder of the emulated board that `darm plant` starts.
pub(crate) fn board() -> Result<PathBuf, Homeless> {
    path().map(|path| path.join("board")).ok_or(Homeless)
}

/// The port of the board in `folder`.
pub(crate) fn port(folder: &Path) -> PathBuf {
    folder.join("port")
}

/// The camera's socket of the board in `folder`.
pub(crate) fn camera(folder: &Path) -> PathBuf {
    folder.join("camera")
}
