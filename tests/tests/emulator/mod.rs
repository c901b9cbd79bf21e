//! The flashed image in the emulator, as several tests need it.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use darm_device::qemu;

/// What a test needs to start the image.
pub(crate) struct Ready {
    /// The image.
    pub(crate) elf: PathBuf,
    /// Held while an emulator runs: two at a time would make each other slow.
    pub(crate) lock: File,
}

/// Waits until no other test has an emulator. `None` where image or emulator are missing, see [`missing`].
pub(crate) fn ready() -> Option<Ready> {
    let elf = target().join("thumbv7em-none-eabihf/firmware/b-l475e-iot01a");
    if let Err(error) = qemu::find() {
        return missing(&error.to_string());
    }
    if !elf.exists() {
        return missing(&format!("no image at {}; build it with `cargo xtask image`", elf.display()));
    }
    let lock = File::create(std::env::temp_dir().join("darm-qemu-tests.lock")).unwrap();
    lock.lock().unwrap();
    Some(Ready { elf, lock })
}

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
