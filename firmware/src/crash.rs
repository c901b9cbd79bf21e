//! The end of a start that cannot continue: outputs disabled in one edge, a record in memory that the reset leaves alone,
//! reset.
//!
//! Crashes in a row are counted beside the record. After [`life::MAX_CRASHES`] the board is held: outputs disabled, the
//! console answers the bootstrap set, until a reboot by `reboot`, the reset button or power. A start that ran for
//! [`life::STEADY`] ends the row.

use core::fmt;
use core::panic::PanicInfo;

use darm_core::wire::bootstrap::CrashKind;

use crate::clock::Clock;
use crate::hardware::Hardware;
use crate::kept::keep;
pub use crate::kept::{Kept, Registers, count_crash, forget_crashes, past, take};
use crate::life;

/// Ends this start: outputs disabled, record, reset.
pub fn end<H: Hardware>(kind: CrashKind, at: Registers, message: fmt::Arguments) -> ! {
    H::disable_outputs();
    keep(H::kept(), kind, H::CLOCK.now(), at, message);
    H::reset()
}

/// Ends a start that cannot continue, as a panic does.
pub fn give_up<H: Hardware>(why: fmt::Arguments) -> ! {
    end::<H>(CrashKind::Panic, Registers::UNKNOWN, why)
}

/// Ends a start in which a task no longer runs.
pub fn end_silence<H: Hardware>(task: life::Task) -> ! {
    let limit_ms = life::SILENCE_LIMIT.0 / 1000;
    end::<H>(CrashKind::Watchdog, Registers::UNKNOWN, format_args!("{} silent for {limit_ms} ms", task.name()))
}

/// What a board's panic handler does.
pub fn panicked<H: Hardware>(info: &PanicInfo) -> ! {
    let message = info.message();
    match info.location() {
        Some(place) => give_up::<H>(format_args!("{}:{}: {message}", short(place.file()), place.line())),
        None => give_up::<H>(format_args!("{message}")),
    }
}

/// The end of a path: the start is the same for all files of a crate.
fn short(path: &str) -> &str {
    path.get(path.len().saturating_sub(18)..).unwrap_or(path)
}
