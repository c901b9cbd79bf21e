//! What a test does that lacks an emulator or an image, and where images are.

use std::io::Write as _;
use std::path::Path;

/// A test that cannot run: it fails in CI and in `cargo xtask test`; elsewhere a notice is printed and it passes.
pub(crate) fn missing<T>(what: &str) -> Option<T> {
    let is_required = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    assert!(!is_required("CI") && !is_required("DARM_EMULATOR_REQUIRED"), "{what}");
    let name = std::thread::current().name().unwrap_or_default().to_owned();
    // Not `eprintln`, whose output is hidden when a test passes.
    let _ = writeln!(std::io::stderr(), "NOT RUN: {name}: {what}");
    None
}

/// The folder that cargo builds into.
pub(crate) fn target() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap()
}
