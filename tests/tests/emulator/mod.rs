//! The flashed image in the emulator, as several tests need it.

use std::fs::File;
use std::path::{Path, PathBuf};

use darm_device::qemu;

/// What a test needs to start the image.
pub(crate) struct Ready {
    /// The image.
    pub(crate) elf: PathBuf,
    /// Held while an emulator runs: two at a time would make each other slow.
    pub(crate) lock: File,
}

/// Waits until no other test has an emulator. `None`, reported, where image or emulator are missing.
pub(crate) fn ready() -> Option<Ready> {
    let elf = target().join("thumbv7em-none-eabihf/firmware/darm-firmware");
    if let Err(error) = qemu::find() {
        eprintln!("SKIPPED: {error}");
        return None;
    }
    if !elf.exists() {
        eprintln!("SKIPPED: no image at {}", elf.display());
        return None;
    }
    let lock = File::create(std::env::temp_dir().join("darm-qemu-tests.lock")).unwrap();
    lock.lock().unwrap();
    Some(Ready { elf, lock })
}

/// The folder that cargo builds into.
pub(crate) fn target() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap()
}
