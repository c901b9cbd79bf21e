//! The image of the Raspberry Pi Pico in the emulator rp2040js, with a plant at its pins, in virtual time.
//!
//! | file       | holds                                                                    |
//! |------------|--------------------------------------------------------------------------|
//! | `emulator` | the process that emulates, step by step, and what it needs on a machine   |
//! | `bench`    | the board with its plant: steps it, and sees what its pins do             |
//!
//! [`boot`] gives the board as a handle for clients, as [`crate::in_process::InProcess`] does for the library.

mod bench;
mod emulator;

use std::path::Path;

use darm_arm::image::UploadImage;

use crate::in_process::InProcess;
use crate::plant::Plant;
pub use bench::{Edges, PicoBench};
use darm_device::client::{Client, ClientError};
pub use emulator::{Ended, Measured, PicoError, find};

/// The file that represents the part of the flash that the firmware writes.
pub const FLASH_FILE: &str = "pico-flash.img";

/// Starts the image at `elf`; its flash is in `folder`, blank where there is none.
///
/// # Errors
///
/// As [`PicoBench::start`]; the system gives no thread.
pub fn boot(elf: &Path, folder: &Path, plant: Plant) -> Result<InProcess<PicoBench>, PicoError> {
    let bench = PicoBench::start(elf, folder, plant)?;
    Ok(InProcess::run("pico", move || bench)?)
}

/// Writes a profile as a person at the board does: with the jumper set. The board starts again with it.
///
/// # Errors
///
/// As [`Client::connect`] and [`Client::upload`]: the board refuses the profile, or does not answer.
pub fn write_profile(board: &InProcess<PicoBench>, profile: &UploadImage) -> Result<(), ClientError> {
    // A press is a contact that closes after it was open.
    board.pass(0.2);
    board.hold_button(true);
    board.pass(0.1);
    let written = Client::connect(board.link()).and_then(|mut client| client.upload(profile, &mut |_| {}));
    board.hold_button(false);
    board.pass(1.0);
    written.map(drop)
}
