//! The flashed image in the emulator, as several tests need it.

mod missing;

use std::fs::File;
use std::path::PathBuf;

use darm_sim::qemu;

pub(crate) use missing::{missing, target};

/// What a test needs to start the image.
pub(crate) struct Ready {
    /// The image.
    pub(crate) elf: PathBuf,
    /// Held while an emulator runs: two at a time would make each other slow.
    pub(crate) lock: File,
}

/// Waits until no other test has an emulator. `None` where image or emulator are missing, see [`missing`].
pub(crate) fn ready() -> Option<Ready> {
    ready_for("b-l475e-iot01a")
}

/// The same with the image of another board.
pub(crate) fn ready_for(board: &str) -> Option<Ready> {
    let elf = target().join("thumbv7em-none-eabihf/firmware").join(board);
    if let Err(error) = qemu::find() {
        return missing(&error.to_string());
    }
    if !elf.exists() {
        return missing(&format!("no image at {}; build it with `cargo xtask image --board {board}`", elf.display()));
    }
    let lock = File::create(std::env::temp_dir().join("darm-qemu-tests.lock")).unwrap();
    lock.lock().unwrap();
    Some(Ready { elf, lock })
}
