//! Values handed from one task to another without a lock: neither side masks interrupts to copy a value.
//!
//! One task puts, another takes; the one that finds the other half-way, because it has preempted it, sees a full or an
//! empty ring and comes again. With more tasks on one side values may change order, but none is torn or doubled.
use core::cell::UnsafeCell;
use core::future::poll_fn;
use core::mem::MaybeUninit;
use core::sync::atomic::Ordering;
use core::task::Poll;

use embassy_sync::waitqueue::AtomicWaker;
use portable_atomic::{AtomicU8, AtomicUsize};

const EMPTY: u8 = 0;
/// Somebody writes or reads the value.
const BUSY: u8 = 1;
const FULL: u8 = 2;

struct Slot<T> {
    state: AtomicU8,
    value: UnsafeCell<MaybeUninit<T>>,
}

/// Up to `N` values under way.
pub struct Ring<T, const N: usize> {
    slots: [Slot<T>; N],
    /// Where the next value is put.
    head: AtomicUsize,
    /// Where the next value is taken.
    tail: AtomicUsize,
    reader: AtomicWaker,
}

// SAFETY: a value is touched only by the one that turned its slot's state to BUSY, and moves from task to task.
unsafe impl<T: Send, const N: usize> Sync for Ring<T, N> {}

impl<T> Slot<T> {
    const fn new() -> Self {
        Self { state: AtomicU8::new(EMPTY), value: UnsafeCell::new(MaybeUninit::uninit()) }
    }

    /// True when the slot was in this state and is now the caller's.
    fn seize(&self, from: u8) -> bool {
        self.state.compare_exchange(from, BUSY, Ordering::Acquire, Ordering::Relaxed).is_ok()
    }
}

impl<T, const N: usize> Ring<T, N> {
    /// An empty ring.
    pub const fn new() -> Self {
        Self {
            slots: [const { Slot::new() }; N],
            head: AtomicUsize::new(0),
            tail: AtomicUsize::new(0),
            reader: AtomicWaker::new(),
        }
    }

    /// Hands a value over, or gives it back when the ring is full.
    ///
    /// # Errors
    ///
    /// The ring is full: the value comes back.
    pub fn put(&self, value: T) -> Result<(), T> {
        let head = self.head.load(Ordering::Relaxed);
        let Some(slot) = self.slots.get(head).filter(|slot| slot.seize(EMPTY)) else {
            return Err(value);
        };
        // SAFETY: the slot is ours until its state changes.
        unsafe { (*slot.value.get()).write(value) };
        slot.state.store(FULL, Ordering::Release);
        self.head.store(next::<N>(head), Ordering::Relaxed);
        self.reader.wake();
        Ok(())
    }

    /// Takes the oldest value, if there is one.
    pub fn take(&self) -> Option<T> {
        let tail = self.tail.load(Ordering::Relaxed);
        let slot = self.slots.get(tail).filter(|slot| slot.seize(FULL))?;
        // SAFETY: the slot is ours until its state changes, and FULL says that it holds a value.
        let value = unsafe { (*slot.value.get()).assume_init_read() };
        slot.state.store(EMPTY, Ordering::Release);
        self.tail.store(next::<N>(tail), Ordering::Relaxed);
        Some(value)
    }

    /// Waits for a value.
    pub async fn next(&self) -> T {
        poll_fn(|context| {
            self.reader.register(context.waker());
            self.take().map_or(Poll::Pending, Poll::Ready)
        })
        .await
    }
}

impl<T, const N: usize> Default for Ring<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

fn next<const N: usize>(index: usize) -> usize {
    let next = index.wrapping_add(1);
    if next < N { next } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::Ring;

    #[test]
    fn values_come_out_in_order_until_it_is_empty() {
        let ring = Ring::<u32, 3>::new();
        for round in 0..10 {
            assert_eq!([0, 1, 2, 3].map(|n| ring.put(round + n)), [Ok(()), Ok(()), Ok(()), Err(round + 3)]);
            assert_eq!([0; 4].map(|_| ring.take()), [Some(round), Some(round + 1), Some(round + 2), None]);
        }
    }

    #[test]
    fn threads_lose_nothing() {
        let ring = Ring::<u64, 4>::new();
        std::thread::scope(|scope| {
            scope.spawn(|| (0..20_000).for_each(|n| while ring.put(n).is_err() {}));
            for expected in 0..20_000 {
                let got = core::iter::repeat_with(|| ring.take()).find_map(|value| value);
                assert_eq!(got, Some(expected));
            }
        });
    }
}
