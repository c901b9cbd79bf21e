//! A link that is as slow as a serial line: for measurements in virtual time, seeded.
//!
//! # Model
//!
//! A byte occupies its direction of the line for 10 bits (8N1): byte n starts at tₙ = max(now, tₙ₋₁ + 10/baud) and arrives
//! at tₙ + 10/baud + delay. A lost frame occupies the line as any other and does not arrive. The sender's buffer is as long
//! as it has to be. How finely arrivals are spread is that of the link below: a board in this process takes bytes once a
//! millisecond.

use std::collections::VecDeque;
use std::time::Duration;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::faulty::pieces;
use super::{Link, LinkError};

/// Bits on the line for a byte: start, eight, stop.
const BITS_PER_BYTE: f64 = 10.0;

/// What a line is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Bits per second in each direction.
    pub baud: u32,
    /// From the end of a byte on the line to its arrival, in each direction.
    pub delay_s: f64,
    /// Share of the frames that are lost, in each direction.
    pub lost: f64,
}

impl Line {
    /// Time that a byte occupies the line.
    pub fn byte_s(&self) -> f64 {
        BITS_PER_BYTE / f64::from(self.baud)
    }
}

/// One direction: bytes with the time at which each arrives.
#[derive(Default)]
struct Lane {
    free_s: f64,
    bytes: VecDeque<(f64, u8)>,
}

impl Lane {
    fn push(&mut self, line: &Line, now_s: f64, bytes: &[u8], is_lost: bool) {
        for &byte in bytes {
            self.free_s = self.free_s.max(now_s) + line.byte_s();
            if !is_lost {
                self.bytes.push_back((self.free_s + line.delay_s, byte));
            }
        }
    }

    fn pop_due(&mut self, now_s: f64) -> Option<u8> {
        let (due_s, byte) = *self.bytes.front()?;
        (due_s <= now_s).then(|| {
            self.bytes.pop_front();
            byte
        })
    }

    fn next_s(&self) -> Option<f64> {
        self.bytes.front().map(|&(due_s, _)| due_s)
    }
}

/// Another link behind a serial line.
pub struct Paced<L> {
    inner: L,
    line: Line,
    rng: ChaCha8Rng,
    out: Lane,
    back: Lane,
}

impl<L: Link> Paced<L> {
    /// Puts `inner` behind a line; `seed` decides which frames it loses.
    pub fn new(inner: L, line: Line, seed: u64) -> Self {
        let rng = ChaCha8Rng::seed_from_u64(seed);
        Self { inner, line, rng, out: Lane::default(), back: Lane::default() }
    }

    fn deliver(&mut self) -> Result<(), LinkError> {
        let now_s = self.inner.now_s();
        let due: Vec<u8> = std::iter::from_fn(|| self.out.pop_due(now_s)).collect();
        if due.is_empty() { Ok(()) } else { self.inner.send(&due) }
    }

    /// Waits for what the board sends, until the next byte arrives somewhere or `end_s`.
    fn listen(&mut self, end_s: f64) -> Result<(), LinkError> {
        let now_s = self.inner.now_s();
        let until_s = [self.out.next_s(), self.back.next_s()].into_iter().flatten().fold(end_s, f64::min);
        // Less than a tick would never pass in virtual time.
        let wait = Duration::from_secs_f64((until_s - now_s).max(1e-5));
        let mut bytes = [0; 1024];
        let count = self.inner.receive(&mut bytes, wait)?;
        let now_s = self.inner.now_s();
        for piece in pieces(&bytes[..count]) {
            let is_lost = self.rng.random_bool(self.line.lost);
            self.back.push(&self.line, now_s, &piece, is_lost);
        }
        Ok(())
    }
}

impl<L: Link> Link for Paced<L> {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        let now_s = self.inner.now_s();
        for piece in pieces(bytes) {
            let is_lost = self.rng.random_bool(self.line.lost);
            self.out.push(&self.line, now_s, &piece, is_lost);
        }
        self.deliver()
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        let end_s = self.inner.now_s() + timeout.as_secs_f64();
        loop {
            self.deliver()?;
            let now_s = self.inner.now_s();
            let mut count = 0;
            for (slot, byte) in buffer.iter_mut().zip(std::iter::from_fn(|| self.back.pop_due(now_s))) {
                *slot = byte;
                count += 1;
            }
            if count > 0 || now_s >= end_s {
                return Ok(count);
            }
            self.listen(end_s)?;
        }
    }

    fn now_s(&self) -> f64 {
        self.inner.now_s()
    }

    fn name(&self) -> &str {
        self.inner.name()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::faulty::tests::Echo;
    use super::{Line, Paced};
    use crate::link::Link as _;

    /// When the last of `count` frames of 100 bytes is back, and how many bytes are.
    fn echo(line: Line, count: usize) -> (f64, usize) {
        let mut link = Paced::new(Echo::default(), line, 3);
        let frame = [&[0][..], &[1; 98], &[0]].concat();
        (0..count).for_each(|_| link.send(&frame).unwrap());
        let (mut back, mut last_s, mut buffer) = (0, 0.0, [0; 64]);
        while let Ok(bytes @ 1..) = link.receive(&mut buffer, Duration::from_secs(2)) {
            (back, last_s) = (back + bytes, link.now_s());
        }
        (last_s, back)
    }

    #[test]
    fn bytes_take_their_time_on_the_line_and_the_delay_each_way() {
        let line = Line { baud: 10_000, delay_s: 0.25, lost: 0.0 };
        let (at_s, bytes) = echo(line, 10);
        assert_eq!(bytes, 1000);
        // A second out, the last byte back again, twice the delay; to within the steps in which the test waits.
        assert!((at_s - (1.0 + 0.001 + 0.5)).abs() < 2e-3, "{at_s}");
    }

    #[test]
    fn frames_are_lost_in_both_directions() {
        let (_, bytes) = echo(Line { baud: 1_000_000, delay_s: 0.0, lost: 0.1 }, 1000);
        // 81 % come back; three times the deviation of 1000 draws is 3.7 %.
        assert!((770..850).contains(&(bytes / 100)), "{bytes}");
    }
}
