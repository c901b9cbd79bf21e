//! Which chunk of an upload is sent next: selective repeat, or go-back-N where the board keeps no chunks ahead.
//!
//! # Model
//!
//! The line keeps the order of what it does not lose. So an answer to one chunk says of every chunk that was sent before it
//! and has no answer that it, or its answer, is lost: those are sent again, before new ones. An answer names the offset that
//! the board wants; it never falls. A chunk that was answered while an earlier one is missing is kept by the board, unless
//! the board wants it later all the same: then the board keeps none, and a gap takes the window back to the wanted offset.
//!
//! A line that changes the order, or brings things twice, costs chunks that are sent again and nothing else.
//!
//! Source: A. S. Tanenbaum, Computer Networks, sections on go-back-N and selective repeat; RFC 6675 (the answers to later
//! packets as the sign of a loss).

use std::cmp::Ordering;
use std::collections::{BTreeSet, VecDeque};

use darm_core::wire::message::CHUNK;

/// Chunks without an answer: this number waits in the board's receive buffer of 1152 bytes while it erases a page. With 24 ms
/// each at 115200 baud they fill a line of up to 70 ms from a chunk's end to its answer.
const UNDER_WAY: usize = 4;

/// A piece of the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    pub(super) offset: u32,
    pub(super) len: u32,
    /// It was sent before.
    pub(super) again: bool,
}

/// A piece that was sent and has no answer.
#[derive(Clone, Copy, Debug)]
struct Sent {
    number: u16,
    offset: u32,
    at_s: f64,
}

/// What the board has of an image, as far as its answers say.
#[derive(Debug)]
pub(super) struct Window {
    total: u32,
    /// The board wants this offset: it has all before it.
    wanted: u32,
    /// What is sent after the lost pieces: all from here on.
    fresh: u32,
    /// All from here on was never sent.
    reached: u32,
    under_way: VecDeque<Sent>,
    /// Lost; to be sent again.
    lost: BTreeSet<u32>,
    /// Answered, ahead of what is wanted.
    ahead: BTreeSet<u32>,
    /// The board has not shown that it drops chunks ahead of the wanted one.
    keeps: bool,
}

impl Window {
    /// The board wants the image of `total` bytes from `wanted` on.
    pub(super) fn new(wanted: u32, total: u32) -> Self {
        let (lost, ahead) = (BTreeSet::new(), BTreeSet::new());
        Self { total, wanted, fresh: wanted, reached: wanted, under_way: VecDeque::new(), lost, ahead, keeps: true }
    }

    /// Offset that the board wants.
    pub(super) fn wanted(&self) -> u32 {
        self.wanted
    }

    /// The board has everything.
    pub(super) fn is_complete(&self) -> bool {
        self.wanted >= self.total
    }

    /// What to send now, if the line has room for it.
    pub(super) fn next(&mut self) -> Option<Piece> {
        if self.under_way.len() >= UNDER_WAY {
            return None;
        }
        let offset = self.lost.pop_first().or((self.fresh < self.total).then_some(self.fresh))?;
        // The board writes blocks: after a resumed upload the first piece leads to the next one.
        let len = (CHUNK as u32 - offset % CHUNK as u32).min(self.total - offset);
        let piece = Piece { offset, len, again: offset < self.reached };
        self.fresh = self.fresh.max(offset + len);
        self.reached = self.reached.max(offset + len);
        Some(piece)
    }

    /// A piece has left under this number.
    pub(super) fn on_sent(&mut self, piece: Piece, number: u16, at_s: f64) {
        self.under_way.push_back(Sent { number, offset: piece.offset, at_s });
    }

    /// When the piece with this number was sent; `None` if nobody waits for its answer.
    pub(super) fn sent_s(&self, number: u16) -> Option<f64> {
        self.under_way.iter().find(|sent| sent.number == number).map(|sent| sent.at_s)
    }

    /// The board has answered the piece with this number: it wants `wanted`.
    pub(super) fn on_answer(&mut self, number: u16, wanted: u32) {
        let Some(at) = self.under_way.iter().position(|sent| sent.number == number) else { return };
        let answered = self.under_way[at].offset;
        let passed = self.under_way.drain(..=at).map(|sent| sent.offset).take(at);
        self.lost.extend(passed);
        self.wanted = self.wanted.max(wanted);
        match answered.cmp(&self.wanted) {
            Ordering::Greater => drop(self.ahead.insert(answered)),
            // It came too early, and meanwhile the board wants it.
            Ordering::Equal => drop(self.lost.insert(answered)),
            Ordering::Less => {}
        }
        let is_dropped = self.ahead.contains(&self.wanted);
        self.keeps &= !is_dropped;
        if is_dropped || !self.keeps && answered > self.wanted {
            self.go_back();
        }
        self.forget_what_arrived();
    }

    /// No answer came in time: all that is under way is lost.
    pub(super) fn on_silence(&mut self) {
        self.lost.extend(self.under_way.drain(..).map(|sent| sent.offset));
        self.forget_what_arrived();
    }

    fn go_back(&mut self) {
        self.under_way.clear();
        self.lost.clear();
        self.ahead.clear();
        self.fresh = self.wanted;
    }

    fn forget_what_arrived(&mut self) {
        self.ahead = self.ahead.split_off(&self.wanted);
        self.lost = self.lost.split_off(&self.wanted);
        self.lost.retain(|offset| !self.ahead.contains(offset));
        self.fresh = self.fresh.max(self.wanted);
    }
}

#[cfg(test)]
mod tests;
