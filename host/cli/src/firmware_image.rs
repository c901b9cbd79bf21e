//! ELF file of the firmware: named by the user, or built in this workspace.

use std::path::{Path, PathBuf};

/// Environment variable with its path.
pub(crate) const VARIABLE: &str = "DARM_FIRMWARE";
/// A board whose image `cargo xtask image` builds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Board {
    /// B-L475E-IOT01A
    #[value(name = "b-l475e-iot01a")]
    BL475eIot01a,
    /// Raspberry Pi Pico
    Pico,
}

impl Board {
    /// Path in the folder that cargo builds into.
    fn image(self) -> &'static str {
        match self {
            Self::BL475eIot01a => "thumbv7em-none-eabihf/firmware/b-l475e-iot01a",
            Self::Pico => "thumbv6m-none-eabi/firmware/pico",
        }
    }
}

/// Why no image was found.
#[derive(Debug, thiserror::Error)]
pub(crate) enum NoImage {
    /// The named file does not exist.
    #[error("no firmware image at {0}; build it with `cargo xtask image`")]
    Named(PathBuf),
    /// No image has been built.
    #[error("no firmware image found; build one with `cargo xtask image`, name an ELF file, or use --in-process")]
    NotBuilt,
}

/// The image of the first board, see [`find_for`].
pub(crate) fn find(named: Option<&Path>) -> Result<PathBuf, NoImage> {
    find_for(Board::BL475eIot01a, named)
}

/// The image that the user named, or that of the workspace around the current folder or around this program.
pub(crate) fn find_for(board: Board, named: Option<&Path>) -> Result<PathBuf, NoImage> {
    if let Some(path) = named {
        return if path.is_file() { Ok(path.into()) } else { Err(NoImage::Named(path.into())) };
    }
    let starts = [std::env::current_dir(), std::env::current_exe()];
    let folders = starts.iter().flatten().flat_map(|start| start.ancestors());
    let images = folders.map(|folder| folder.join("target").join(board.image()));
    let built = std::env::var_os("CARGO_TARGET_DIR").map(|folder| Path::new(&folder).join(board.image()));
    built.into_iter().chain(images).find(|path| path.is_file()).ok_or(NoImage::NotBuilt)
}

#[cfg(test)]
mod tests {
    use super::{NoImage, find};

    #[test]
    fn a_named_file_that_does_not_exist_is_an_error() {
        assert!(matches!(find(Some("/nonexistent".as_ref())), Err(NoImage::Named(_))));
    }
}
