//! Hands the workspace's one `memory.x` to the linker when a chip image is built.
use std::path::Path;

fn main() -> std::io::Result<()> {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_FEATURE_CHIP").is_none() {
        return Ok(());
    }
    let variable = |name: &str| std::env::var(name).unwrap_or_default();
    let source = Path::new(&variable("CARGO_MANIFEST_DIR")).join("../memory.x");
    let out = variable("OUT_DIR");
    std::fs::copy(&source, Path::new(&out).join("memory.x"))?;
    println!("cargo:rustc-link-search={out}");
    println!("cargo:rerun-if-changed={}", source.display());
    Ok(())
}
