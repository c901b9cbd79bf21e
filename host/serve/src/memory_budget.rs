//! Memory that many requests share: a bound for all of them together, whoever sends how many at once.

use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Bytes that one permit is for.
const BLOCK: usize = 1 << 10;

/// A number of bytes, and what is left of them.
#[derive(Clone)]
pub(crate) struct MemoryBudget {
    all: usize,
    free: Arc<Semaphore>,
}

/// Memory of one request, which is free again when this is dropped.
pub(crate) struct Reserved {
    budget: MemoryBudget,
    permits: Option<OwnedSemaphorePermit>,
    bytes: usize,
}

/// There is not as much memory left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{free} of {all} MB are free")]
pub(crate) struct NoMemory {
    /// MB that are free.
    free: usize,
    /// MB of all requests.
    all: usize,
}

impl MemoryBudget {
    pub(crate) fn new(bytes: usize) -> Self {
        Self { all: bytes, free: Arc::new(Semaphore::new(bytes / BLOCK)) }
    }

    /// No memory yet.
    pub(crate) fn reserved(&self) -> Reserved {
        Reserved { budget: self.clone(), permits: None, bytes: 0 }
    }
}

impl Reserved {
    /// Reserves what is missing to this number of bytes.
    ///
    /// # Errors
    ///
    /// There is not as much left.
    pub(crate) fn grow_to(&mut self, bytes: usize) -> Result<(), NoMemory> {
        let more = bytes.saturating_sub(self.bytes).div_ceil(BLOCK);
        let more = u32::try_from(more).unwrap_or(u32::MAX);
        let MemoryBudget { all, free } = &self.budget;
        let none = |_| NoMemory { free: (free.available_permits() * BLOCK) >> 20, all: all >> 20 };
        let permits = Arc::clone(free).try_acquire_many_owned(more).map_err(none)?;
        match &mut self.permits {
            Some(own) => own.merge(permits),
            own => *own = Some(permits),
        }
        self.bytes = self.bytes.max(bytes.next_multiple_of(BLOCK));
        Ok(())
    }
}
