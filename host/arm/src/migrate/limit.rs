//! The limits that format 1 gave to an output by itself.

use darm_core::output::Drive;
use toml::{Table, Value};

/// A key with its number.
pub(super) fn pair((key, value): (&str, u32)) -> (String, Value) {
    (key.to_owned(), Value::from(i64::from(value)))
}

/// The keys of the limit of an output with this drive.
pub(super) fn default_limit(drive: &str) -> Table {
    let limit = match drive {
        "latch" => Drive::Latch { set: 0, reset: 0, pulse_ms: 0 },
        "peak-hold" => Drive::PeakHold { pull: 0, hold: 0, peak_ms: 0 },
        _ => Drive::Hold { line: 0 },
    }
    .default_limit();
    let limits =
        [("max_on_ms", limit.max_on_ms), ("duty_percent", limit.duty_percent.into()), ("window_ms", limit.window_ms)];
    limits.into_iter().map(pair).collect()
}
