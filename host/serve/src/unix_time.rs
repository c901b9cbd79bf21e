//! Time of this computer since 1970.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// In s.
pub(crate) fn now_s() -> f64 {
    since_1970().as_secs_f64()
}

/// In ms.
pub(crate) fn now_ms() -> i64 {
    since_1970().as_millis() as i64
}

fn since_1970() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}
