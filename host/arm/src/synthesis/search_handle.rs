//! Looking at a long search from outside, and ending it early.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Shared with a search: how far it is, and whether it is to end with the best so far. Clones share.
#[derive(Clone, Debug, Default)]
pub struct SearchHandle {
    ended: Arc<AtomicBool>,
    starts: Arc<AtomicU32>,
}

impl SearchHandle {
    /// Lets the search end with the best so far.
    pub fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
    }

    /// Whether the search is to end.
    pub fn is_ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }

    /// Starts that have been tried.
    pub fn starts(&self) -> u32 {
        self.starts.load(Ordering::Relaxed)
    }

    pub(super) fn count(&self) {
        self.starts.fetch_add(1, Ordering::Relaxed);
    }
}
