//! The images that a release of the tool embeds: of all boards, without debug information.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use object::build::elf::Builder;

use super::{Board, build_for};
use crate::setup;

/// Builds the images of all boards and writes them, as `NAME.elf`, to the folder that is returned.
///
/// # Errors
///
/// An image does not build, cannot be read or cannot be written.
pub fn build_all() -> Result<PathBuf> {
    let folder = setup::target().join("images");
    fs::create_dir_all(&folder).with_context(|| format!("{} cannot be created", folder.display()))?;
    for board in Board::ALL {
        let elf = build_for(board)?;
        let bytes = without_debug(&elf)?;
        let file = folder.join(board.name()).with_extension("elf");
        fs::write(&file, bytes).with_context(|| format!("{} cannot be written", file.display()))?;
    }
    Ok(folder)
}

/// An ELF without its debug information. Segments, symbols and the texts of `defmt` are what emulator and probe need.
fn without_debug(elf: &Path) -> Result<Vec<u8>> {
    let bytes = fs::read(elf).with_context(|| format!("{} cannot be read", elf.display()))?;
    let context = || format!("{} is no ELF that can be copied", elf.display());
    let mut builder = Builder::read(bytes.as_slice()).with_context(context)?;
    for section in &mut builder.sections {
        section.delete = section.name.starts_with(b".debug_");
    }
    let mut written = Vec::new();
    builder.write(&mut written).with_context(context)?;
    Ok(written)
}
