//! What the build scripts of all boards do.
use std::path::PathBuf;
use std::{env, fs, io};

/// Hands `memory.x` of the workspace and the board's `board.x` to the linker, and arguments of its binaries.
pub(crate) fn link(arguments: &[&str]) -> io::Result<()> {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    for (script, name) in [("../../../memory.x", "memory.x"), ("board.x", "board.x")] {
        println!("cargo:rerun-if-changed={script}");
        fs::copy(script, out.join(name))?;
    }
    println!("cargo:rustc-link-search={}", out.display());
    if env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none") {
        arguments.iter().for_each(|argument| println!("cargo:rustc-link-arg-bins={argument}"));
    }
    Ok(())
}
