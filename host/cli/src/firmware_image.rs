//! ELF file of the firmware: named by the user, embedded in this program, or built in this workspace.
//!
//! A release has the images of all boards in it (`DARM_IMAGES`, see `build.rs`); QEMU and probe-rs read files, so such an
//! image is written to the state folder first.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use sha2::{Digest as _, Sha256};

use crate::state_folder::{self, NoHomeDir};

/// Environment variable with its path.
pub(crate) const VARIABLE: &str = "DARM_FIRMWARE";
/// Names of boards with the images that this program was built with; empty but in a release.
const EMBEDDED: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/images.rs"));

/// A board that there is an image for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Board {
    /// B-L475E-IOT01A
    #[value(name = "b-l475e-iot01a")]
    BL475eIot01a,
    /// Raspberry Pi Pico
    Pico,
    /// Olimex STM32-H405
    #[value(name = "olimex-stm32-h405")]
    OlimexStm32H405,
}

impl Board {
    /// Name of its image.
    fn name(self) -> &'static str {
        match self {
            Self::BL475eIot01a => "b-l475e-iot01a",
            Self::Pico => "pico",
            Self::OlimexStm32H405 => "olimex-stm32-h405",
        }
    }

    /// Name of its chip as probe-rs knows it.
    pub(crate) fn chip(self) -> &'static str {
        match self {
            Self::BL475eIot01a => "STM32L475VG",
            Self::Pico => "RP2040",
            Self::OlimexStm32H405 => "STM32F405RG",
        }
    }

    /// Path in the folder that cargo builds into.
    fn built(self) -> PathBuf {
        let target = if self == Self::Pico { "thumbv6m-none-eabi" } else { "thumbv7em-none-eabihf" };
        Path::new(target).join("firmware").join(self.name())
    }
}

/// Why no image was found.
#[derive(Debug, thiserror::Error)]
pub(crate) enum NoImage {
    /// The named file does not exist.
    #[error("no firmware image at {0}; build it with `cargo xtask image`")]
    Named(PathBuf),
    /// No image has been built.
    #[error("no firmware image of {0} found; build it with `cargo xtask image --board {0}`, or name an ELF file")]
    NotBuilt(&'static str),
    /// There is no folder to write an embedded image to.
    #[error(transparent)]
    NoHomeDir(#[from] NoHomeDir),
    /// An embedded image cannot be written.
    #[error(transparent)]
    NotWritten(anyhow::Error),
}

/// The image of the first board, see [`find_for`].
pub(crate) fn find(named: Option<&Path>) -> Result<PathBuf, NoImage> {
    find_for(Board::BL475eIot01a, named)
}

/// The image that the user named, else the embedded one, else that of the workspace around the current folder or around this
/// program.
pub(crate) fn find_for(board: Board, named: Option<&Path>) -> Result<PathBuf, NoImage> {
    if let Some(path) = named {
        return if path.is_file() { Ok(path.into()) } else { Err(NoImage::Named(path.into())) };
    }
    if let Some((name, bytes)) = EMBEDDED.iter().find(|(name, _)| *name == board.name()) {
        let folder = state_folder::path().ok_or(NoHomeDir)?.join("images");
        return write(&folder, name, bytes).map_err(NoImage::NotWritten);
    }
    let starts = [std::env::current_dir(), std::env::current_exe()];
    let folders = starts.iter().flatten().flat_map(|start| start.ancestors());
    let images = folders.map(|folder| folder.join("target").join(board.built()));
    let built = std::env::var_os("CARGO_TARGET_DIR").map(|folder| Path::new(&folder).join(board.built()));
    built.into_iter().chain(images).find(|path| path.is_file()).ok_or(NoImage::NotBuilt(board.name()))
}

/// Names of the boards whose images are in this program.
pub(crate) fn embedded() -> Vec<&'static str> {
    EMBEDDED.iter().map(|(name, _)| *name).collect()
}

/// Writes an image under a name that has its digest, unless it is there. It has this name only when it is complete: another
/// `darm` may read it at any time.
fn write(folder: &Path, name: &str, bytes: &[u8]) -> anyhow::Result<PathBuf> {
    let digest: String = Sha256::digest(bytes).iter().take(8).map(|byte| format!("{byte:02x}")).collect();
    let file = folder.join(format!("{name}-{digest}.elf"));
    if std::fs::read(&file).is_ok_and(|there| there == bytes) {
        return Ok(file);
    }
    let context = || format!("cannot write the firmware image {}", file.display());
    std::fs::create_dir_all(folder).with_context(context)?;
    let unfinished = file.with_extension(format!("{}", std::process::id()));
    std::fs::write(&unfinished, bytes).with_context(context)?;
    std::fs::rename(&unfinished, &file).with_context(context)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum as _;

    use super::{Board, NoImage, find, write};

    #[test]
    fn the_images_of_all_boards_are_embedded() {
        let script = include_str!("../build.rs");
        for board in Board::value_variants() {
            assert!(script.contains(&format!("\"{}\"", board.name())), "{}", board.name());
        }
    }

    #[test]
    fn a_named_file_that_does_not_exist_is_an_error() {
        assert!(matches!(find(Some("/nonexistent".as_ref())), Err(NoImage::Named(_))));
    }

    #[test]
    fn an_image_is_written_once_and_again_when_it_was_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let images = folder.path().join("images");
        let file = write(&images, "pico", b"an image").unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"an image");
        std::fs::write(&file, b"an im").unwrap();
        assert_eq!(write(&images, "pico", b"an image").unwrap(), file);
        assert_eq!(std::fs::read(&file).unwrap(), b"an image");
        assert_ne!(write(&images, "pico", b"a newer image").unwrap(), file);
        assert_eq!(std::fs::read_dir(&images).unwrap().count(), 2);
    }
}
