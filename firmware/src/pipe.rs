//! Byte queue between an interrupt and a task, without a lock: one side pushes, the other pops.
//!
//! Neither side masks interrupts to move a byte; only waking the other side does, for a few instructions.
//! With more than one writer or reader bytes may be lost or doubled, but nothing worse.
use core::convert::Infallible;
use core::future::poll_fn;
use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};
use core::task::Poll;

use embassy_sync::waitqueue::AtomicWaker;
use embedded_io_async::{ErrorType, Read, Write};

/// Queue of up to `N - 1` bytes.
pub struct Pipe<const N: usize> {
    cells: [AtomicU8; N],
    /// Where the next byte is written.
    head: AtomicUsize,
    /// Where the next byte is read.
    tail: AtomicUsize,
    reader: AtomicWaker,
    writer: AtomicWaker,
}

impl<const N: usize> Pipe<N> {
    /// An empty queue.
    pub const fn new() -> Self {
        Self {
            cells: [const { AtomicU8::new(0) }; N],
            head: AtomicUsize::new(0),
            tail: AtomicUsize::new(0),
            reader: AtomicWaker::new(),
            writer: AtomicWaker::new(),
        }
    }

    /// Number of bytes that wait.
    pub fn len(&self) -> usize {
        let (head, tail) = (self.head.load(Ordering::Acquire), self.tail.load(Ordering::Acquire));
        head.checked_sub(tail).unwrap_or(N.wrapping_sub(tail).wrapping_add(head))
    }

    /// No byte waits.
    pub fn is_empty(&self) -> bool {
        self.head.load(Ordering::Acquire) == self.tail.load(Ordering::Acquire)
    }

    /// The next [`Pipe::push`] would fail.
    pub fn is_full(&self) -> bool {
        next::<N>(self.head.load(Ordering::Acquire)) == self.tail.load(Ordering::Acquire)
    }

    /// Appends a byte; false when the queue is full. Does not wake the reader.
    pub fn push(&self, byte: u8) -> bool {
        let head = self.head.load(Ordering::Relaxed);
        let after = next::<N>(head);
        if after == self.tail.load(Ordering::Acquire) {
            return false;
        }
        // There is always a cell: both places stay below `N`.
        let Some(cell) = self.cells.get(head) else { return false };
        cell.store(byte, Ordering::Relaxed);
        self.head.store(after, Ordering::Release);
        true
    }

    /// Takes the oldest byte. Does not wake the writer.
    pub fn pop(&self) -> Option<u8> {
        let tail = self.tail.load(Ordering::Relaxed);
        if tail == self.head.load(Ordering::Acquire) {
            return None;
        }
        let byte = self.cells.get(tail)?.load(Ordering::Relaxed);
        self.tail.store(next::<N>(tail), Ordering::Release);
        Some(byte)
    }

    /// Appends what fits of `bytes` and wakes the reader; the number appended.
    pub fn push_slice(&self, bytes: &[u8]) -> usize {
        let n = bytes.iter().take_while(|byte| self.push(**byte)).count();
        if n > 0 {
            self.wake_reader();
        }
        n
    }

    /// Takes what fits into `bytes` and wakes the writer; the number taken.
    pub fn pop_slice(&self, bytes: &mut [u8]) -> usize {
        let mut n = 0usize;
        for (slot, byte) in bytes.iter_mut().zip(core::iter::from_fn(|| self.pop())) {
            *slot = byte;
            n = n.saturating_add(1);
        }
        if n > 0 {
            self.wake_writer();
        }
        n
    }

    /// Wakes the reader: bytes wait.
    pub fn wake_reader(&self) {
        self.reader.wake();
    }

    /// Wakes the writer: there is room, or the last byte has left.
    pub fn wake_writer(&self) {
        self.writer.wake();
    }

    /// Waits for at least one byte.
    pub async fn read(&self, bytes: &mut [u8]) -> usize {
        poll_fn(|context| {
            self.reader.register(context.waker());
            match self.pop_slice(bytes) {
                0 if !bytes.is_empty() => Poll::Pending,
                n => Poll::Ready(n),
            }
        })
        .await
    }

    /// Waits for room for at least one byte.
    pub async fn write(&self, bytes: &[u8]) -> usize {
        self.until(|| match self.push_slice(bytes) {
            0 if !bytes.is_empty() => None,
            n => Some(n),
        })
        .await
    }

    /// Waits until `done` gives a value; it is asked again whenever the writer is woken.
    pub async fn until<T>(&self, mut done: impl FnMut() -> Option<T>) -> T {
        poll_fn(|context| {
            self.writer.register(context.waker());
            done().map_or(Poll::Pending, Poll::Ready)
        })
        .await
    }
}

impl<const N: usize> Default for Pipe<N> {
    fn default() -> Self {
        Self::new()
    }
}

fn next<const N: usize>(index: usize) -> usize {
    let next = index.wrapping_add(1);
    if next < N { next } else { 0 }
}

/// Reading end of a pipe.
pub struct PipeReader<'a, const N: usize>(pub &'a Pipe<N>);
/// Writing end of a pipe.
pub struct PipeWriter<'a, const N: usize>(pub &'a Pipe<N>);

impl<const N: usize> ErrorType for PipeReader<'_, N> {
    type Error = Infallible;
}
impl<const N: usize> ErrorType for PipeWriter<'_, N> {
    type Error = Infallible;
}
impl<const N: usize> Read for PipeReader<'_, N> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        Ok(self.0.read(bytes).await)
    }
}
impl<const N: usize> Write for PipeWriter<'_, N> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        Ok(self.0.write(bytes).await)
    }
    async fn flush(&mut self) -> Result<(), Infallible> {
        self.0.until(|| self.0.is_empty().then_some(())).await;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::Pipe;

    #[test]
    fn bytes_come_out_in_order_and_room_returns() {
        let pipe = Pipe::<4>::new();
        assert_eq!(pipe.push_slice(b"abcd"), 3);
        assert!(pipe.is_full());
        assert_eq!(pipe.pop(), Some(b'a'));
        assert!(pipe.push(b'd'));
        let mut bytes = [0; 8];
        assert_eq!(pipe.pop_slice(&mut bytes), 3);
        assert_eq!(&bytes[..3], b"bcd");
        assert!(pipe.is_empty());
    }

    #[test]
    fn length_holds_across_the_end() {
        let pipe = Pipe::<5>::new();
        for round in 0..20u8 {
            assert!(pipe.push(round) && pipe.push(round));
            assert_eq!(pipe.len(), 2);
            assert_eq!((pipe.pop(), pipe.pop()), (Some(round), Some(round)));
        }
    }
}
