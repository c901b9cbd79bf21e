//! Embeds the firmware images of the folder that `DARM_IMAGES` names, for `src/firmware_image.rs`; without it none.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

/// Environment variable with the folder that `cargo xtask image --all` fills.
const VARIABLE: &str = "DARM_IMAGES";
/// Its files, without their ending.
const BOARDS: [&str; 3] = ["b-l475e-iot01a", "pico", "olimex-stm32-h405"];

fn main() -> io::Result<()> {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed={VARIABLE}");
    let folder = env::var_os(VARIABLE).filter(|folder| !folder.is_empty());
    let images: Vec<_> = folder.iter().flat_map(|folder| BOARDS.map(|board| image(Path::new(folder), board))).collect();
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    fs::write(out.join("images.rs"), format!("&[{}]", images.concat()))
}

/// One element of the list: name of the board and bytes of its image.
fn image(folder: &Path, board: &str) -> String {
    let file = folder.join(board).with_extension("elf");
    assert!(
        file.is_absolute() && file.is_file(),
        "{VARIABLE}: no image {}; name the folder that `cargo xtask image --all` prints",
        file.display()
    );
    println!("cargo:rerun-if-changed={}", file.display());
    format!("({board:?}, include_bytes!({file:?})),")
}
