//! Writes the number of the source, which a board says in its answer to `Hello`.
use std::path::{Path, PathBuf};
use std::{env, fs, io};

use sha2::{Digest as _, Sha256};

/// What an image is made of, from this folder; a PC has no boards.
const SOURCES: [&str; 6] = ["src", "../shared/src", "../Cargo.toml", "../Cargo.lock", "boards", "../memory.x"];
/// Those that only the image of a chip is made of.
const OF_CHIP: [&str; 2] = ["boards", "../memory.x"];
/// The same of a published crate, which is outside of its workspace.
const PUBLISHED: [&str; 2] = ["src", "Cargo.toml"];

fn main() -> io::Result<()> {
    println!("cargo:rerun-if-changed=build.rs");
    let variable = |name: &str| PathBuf::from(env::var_os(name).expect("cargo sets it"));
    let (folder, out) = (variable("CARGO_MANIFEST_DIR"), variable("OUT_DIR"));
    fs::write(out.join("build-id"), build_id(&folder)?)?;
    Ok(())
}

/// First eight bytes of the SHA-256 of all source files with their names: equal sources have equal numbers.
fn build_id(folder: &Path) -> io::Result<[u8; 8]> {
    let mut files = Vec::new();
    let is_chip = env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none");
    let sources: &[&str] = if folder.join("../shared").is_dir() { &SOURCES } else { &PUBLISHED };
    for source in sources.iter().filter(|source| is_chip || !OF_CHIP.contains(source)).map(|source| folder.join(source))
    {
        println!("cargo:rerun-if-changed={}", source.display());
        collect(&source, &mut files)?;
    }
    files.sort();
    let mut sha = Sha256::new();
    for file in files {
        sha.update(file.strip_prefix(folder).unwrap_or(&file).to_string_lossy().as_bytes());
        sha.update(fs::read(&file)?);
    }
    let mut id = [0; 8];
    id.iter_mut().zip(sha.finalize()).for_each(|(to, from)| *to = from);
    Ok(id)
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    if path.is_dir() {
        for entry in fs::read_dir(path)? {
            collect(&entry?.path(), files)?;
        }
    } else {
        files.push(path.to_path_buf());
    }
    Ok(())
}
