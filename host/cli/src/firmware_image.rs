//! Where the firmware's ELF is: named by the user, or built in this workspace.

use std::path::{Path, PathBuf};

/// Environment variable that names it.
pub(crate) const VARIABLE: &str = "DARM_FIRMWARE";
/// Where the workspace's build puts it.
const BUILT: &str = "target/thumbv7em-none-eabihf/firmware/darm-firmware";

/// Why there is no image.
#[derive(Debug, thiserror::Error)]
pub(crate) enum NoImage {
    /// The named file is not there.
    #[error("no firmware image at {0}; build it with `cargo xtask image`")]
    Named(PathBuf),
    /// None was built.
    #[error("no firmware image found; build it with `cargo xtask image` or name an ELF file")]
    NotBuilt,
}

/// The image that the user named, or that of the workspace around the current folder or around this program.
pub(crate) fn find(named: Option<&Path>) -> Result<PathBuf, NoImage> {
    if let Some(path) = named {
        return if path.is_file() { Ok(path.into()) } else { Err(NoImage::Named(path.into())) };
    }
    let starts = [std::env::current_dir(), std::env::current_exe()];
    let folders = starts.iter().flatten().flat_map(|start| start.ancestors());
    folders.map(|folder| folder.join(BUILT)).find(|path| path.is_file()).ok_or(NoImage::NotBuilt)
}

#[cfg(test)]
mod tests {
    use super::{NoImage, find};

    #[test]
    fn a_named_file_that_is_missing_is_named() {
        assert!(matches!(find(Some("/nonexistent".as_ref())), Err(NoImage::Named(_))));
    }
}
