//! A link that drops, corrupts, duplicates, reorders and delays: for tests, seeded, so that every run can be repeated.
//!
//! A fault strikes a *piece*: a frame of the protocol with its zero bytes, or what one call brings of it. Both directions
//! suffer alike.

use std::collections::VecDeque;
use std::time::Duration;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::{Link, LinkError};

/// How often each fault strikes a piece, as a probability in 0..=1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    /// The piece is lost.
    pub drop: f64,
    /// One bit of the piece is turned.
    pub corrupt: f64,
    /// The piece comes twice.
    pub duplicate: f64,
    /// The piece comes after the one that follows it.
    pub reorder: f64,
    /// The piece comes late by up to `longest_delay_s`.
    pub delay: f64,
    /// Longest delay.
    pub longest_delay_s: f64,
}

impl Faults {
    /// Every fault with the same probability.
    pub fn all(probability: f64) -> Self {
        Faults {
            drop: probability,
            corrupt: probability,
            duplicate: probability,
            reorder: probability,
            delay: probability,
            longest_delay_s: 0.05,
        }
    }
}

/// How many pieces each fault struck.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultCounts {
    /// Pieces lost.
    pub dropped: u32,
    /// Pieces with a turned bit.
    pub corrupted: u32,
    /// Pieces that came twice.
    pub duplicated: u32,
    /// Pieces that changed places with the next.
    pub reordered: u32,
    /// Pieces that came late.
    pub delayed: u32,
}

/// A piece on its way and the time at which it may arrive.
struct Piece {
    due_s: f64,
    bytes: Vec<u8>,
}

/// Pieces on their way in one direction.
#[derive(Default)]
struct Lane {
    delayed: Option<Vec<u8>>,
    queue: VecDeque<Piece>,
}

impl Lane {
    /// The next due piece, if any.
    fn pop_due(&mut self, now_s: f64) -> Option<Vec<u8>> {
        let at = self.queue.iter().position(|piece| piece.due_s <= now_s)?;
        self.queue.remove(at).map(|piece| piece.bytes)
    }

    fn push(&mut self, due_s: f64, bytes: Vec<u8>) {
        self.queue.push_back(Piece { due_s, bytes });
    }

    /// How long until the next piece is due.
    fn wait(&self, now_s: f64) -> Option<Duration> {
        let due_s = self.queue.iter().map(|piece| piece.due_s).reduce(f64::min)?;
        Some(Duration::from_secs_f64((due_s - now_s).clamp(0.0, 10.0)))
    }
}

/// A link with faults over any other link.
pub struct Faulty<L> {
    inner: L,
    faults: Faults,
    rng: ChaCha8Rng,
    out: Lane,
    back: Lane,
    ready: VecDeque<u8>,
    counts: FaultCounts,
}

impl<L: Link> Faulty<L> {
    /// Puts faults on `inner`, drawn from `seed`.
    pub fn new(inner: L, faults: Faults, seed: u64) -> Self {
        Self {
            inner,
            faults,
            rng: ChaCha8Rng::seed_from_u64(seed),
            out: Lane::default(),
            back: Lane::default(),
            ready: VecDeque::new(),
            counts: FaultCounts::default(),
        }
    }

    /// What has struck so far.
    pub fn counts(&self) -> FaultCounts {
        self.counts
    }

    /// The link below.
    pub fn inner_mut(&mut self) -> &mut L {
        &mut self.inner
    }

    /// Sends one piece to its fate.
    fn strike(&mut self, mut piece: Vec<u8>, outward: bool) {
        let now_s = self.inner.now_s();
        if self.rng.random_bool(self.faults.drop) {
            self.counts.dropped += 1;
            return;
        }
        if self.rng.random_bool(self.faults.corrupt) {
            self.counts.corrupted += 1;
            let at = self.rng.random_range(0..piece.len());
            piece[at] ^= 1 << self.rng.random_range(0..8);
        }
        let mut due_s = now_s;
        if self.rng.random_bool(self.faults.delay) {
            self.counts.delayed += 1;
            due_s += self.rng.random_range(0.0..=self.faults.longest_delay_s);
        }
        let twice = self.rng.random_bool(self.faults.duplicate);
        let hold = self.rng.random_bool(self.faults.reorder);
        let lane = if outward { &mut self.out } else { &mut self.back };
        if hold && lane.delayed.is_none() {
            self.counts.reordered += 1;
            lane.delayed = Some(piece);
            return;
        }
        if twice {
            self.counts.duplicated += 1;
            lane.push(due_s, piece.clone());
        }
        lane.push(due_s, piece);
        if let Some(earlier) = lane.delayed.take() {
            lane.push(due_s, earlier);
        }
    }

    /// Hands the due pieces on in both directions.
    fn deliver(&mut self) -> Result<(), LinkError> {
        let now_s = self.inner.now_s();
        while let Some(bytes) = self.out.pop_due(now_s) {
            self.inner.send(&bytes)?;
        }
        while let Some(bytes) = self.back.pop_due(now_s) {
            self.ready.extend(bytes);
        }
        Ok(())
    }
}

/// Cuts after every zero byte that ends something.
pub(super) fn pieces(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut pieces: Vec<Vec<u8>> = Vec::new();
    for part in bytes.split_inclusive(|&byte| byte == 0) {
        match pieces.last_mut() {
            Some(last) if *last == [0] => last.extend(part),
            _ => pieces.push(part.to_vec()),
        }
    }
    pieces
}

impl<L: Link> Link for Faulty<L> {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        for piece in pieces(bytes) {
            self.strike(piece, true);
        }
        self.deliver()
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        let end_s = self.inner.now_s() + timeout.as_secs_f64();
        loop {
            self.deliver()?;
            let now_s = self.inner.now_s();
            if !self.ready.is_empty() || now_s >= end_s {
                break;
            }
            let mut wait = Duration::from_secs_f64(end_s - now_s);
            for lane in [&self.out, &self.back] {
                wait = lane.wait(now_s).map_or(wait, |due| wait.min(due)).max(Duration::from_micros(100));
            }
            let mut bytes = [0; 1024];
            let count = self.inner.receive(&mut bytes, wait)?;
            for piece in pieces(&bytes[..count]) {
                self.strike(piece, false);
            }
        }
        let count = buffer.len().min(self.ready.len());
        for (slot, byte) in buffer.iter_mut().zip(self.ready.drain(..count)) {
            *slot = byte;
        }
        Ok(count)
    }

    fn now_s(&self) -> f64 {
        self.inner.now_s()
    }

    fn name(&self) -> &str {
        self.inner.name()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::time::Duration;

    use super::{Faults, Faulty};
    use crate::link::{Link, LinkError};

    /// Gives back what was sent; its time passes only by waiting.
    #[derive(Default)]
    pub(in crate::link) struct Echo {
        bytes: Vec<u8>,
        now_s: f64,
    }

    impl Link for Echo {
        fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
            self.bytes.extend(bytes);
            Ok(())
        }

        fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
            let count = buffer.len().min(self.bytes.len());
            buffer[..count].copy_from_slice(&self.bytes[..count]);
            self.bytes.drain(..count);
            if count == 0 {
                self.now_s += timeout.as_secs_f64();
            }
            Ok(count)
        }

        fn now_s(&self) -> f64 {
            self.now_s
        }

        fn name(&self) -> &str {
            "echo"
        }
    }

    fn echo(faults: Faults, seed: u64) -> (Vec<u8>, super::FaultCounts) {
        let mut link = Faulty::new(Echo::default(), faults, seed);
        let mut back = Vec::new();
        let mut buffer = [0; 64];
        for n in 1..=200u8 {
            link.send(&[n, n, 0]).unwrap();
            let count = link.receive(&mut buffer, Duration::from_millis(1)).unwrap();
            back.extend(&buffer[..count]);
        }
        while let Ok(count @ 1..) = link.receive(&mut buffer, Duration::from_secs(1)) {
            back.extend(&buffer[..count]);
        }
        (back, link.counts())
    }

    #[test]
    fn without_faults_all_bytes_come_in_order() {
        let sent: Vec<u8> = (1..=200u8).flat_map(|n| [n, n, 0]).collect();
        assert_eq!(echo(Faults::default(), 1).0, sent);
    }

    #[test]
    fn the_seed_decides() {
        let faults = Faults::all(0.1);
        assert_eq!(echo(faults, 7), echo(faults, 7));
        assert_ne!(echo(faults, 7).0, echo(faults, 8).0);
    }

    #[test]
    fn every_fault_strikes() {
        let counts = echo(Faults::all(0.2), 3).1;
        let each = [counts.dropped, counts.corrupted, counts.duplicated, counts.reordered, counts.delayed];
        assert!(each.iter().all(|&n| n > 10), "{counts:?}");
    }
}
