//! The window against a line that loses, copies and reorders, and boards that keep chunks or drop them.

use std::collections::{BTreeSet, VecDeque};

use darm_core::wire::message::CHUNK;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::{Piece, UNDER_WAY, Window};

/// What happens to a message, with its probability.
#[derive(Clone, Copy, Debug)]
struct Line {
    lost: f64,
    twice: f64,
    reordered: f64,
    seed: u64,
}

/// A board that has some pieces of an image.
struct Board {
    total: u32,
    wanted: u32,
    ahead: BTreeSet<u32>,
    keeps: bool,
}

impl Board {
    fn take(&mut self, piece: Piece) -> u32 {
        if piece.offset == self.wanted || self.keeps && piece.offset > self.wanted {
            self.ahead.insert(piece.offset);
        }
        while self.ahead.remove(&self.wanted) {
            self.wanted = (self.wanted / CHUNK as u32 + 1).saturating_mul(CHUNK as u32).min(self.total);
        }
        self.wanted
    }
}

/// One direction of the line.
struct Lane<T> {
    queue: VecDeque<T>,
}

impl<T: Clone> Lane<T> {
    fn push(&mut self, message: T, line: Line, rng: &mut ChaCha8Rng) {
        if rng.random_bool(line.lost) {
            return;
        }
        let copies = 1 + usize::from(rng.random_bool(line.twice));
        for _ in 0..copies {
            let back = if rng.random_bool(line.reordered) { rng.random_range(0..=self.queue.len().min(3)) } else { 0 };
            self.queue.insert(self.queue.len() - back, message.clone());
        }
    }
}

/// Pieces that were sent until the board had all and the window knew it.
fn pieces_sent(mut board: Board, line: Line) -> usize {
    let rng = &mut ChaCha8Rng::seed_from_u64(line.seed);
    let mut window = Window::new(board.wanted, board.total);
    let (mut out, mut back) = (Lane { queue: VecDeque::new() }, Lane { queue: VecDeque::new() });
    let (mut sent, mut number) = (0, 0u16);
    while !window.is_complete() {
        let mut under_way = 0;
        while let Some(piece) = window.next() {
            number = number.wrapping_add(2);
            assert!(piece.len > 0 && piece.offset + piece.len <= board.total, "{piece:?}");
            window.on_sent(piece, number, 0.0);
            out.push((number, piece), line, rng);
            (sent, under_way) = (sent + 1, under_way + 1);
        }
        assert!(under_way <= UNDER_WAY && sent < 100_000);
        match (out.queue.pop_front(), back.queue.pop_front()) {
            (None, None) => window.on_silence(),
            (taken, answer) => {
                if let Some((number, piece)) = taken {
                    back.push((number, board.take(piece)), line, rng);
                }
                if let Some((number, wanted)) = answer {
                    let before = window.wanted();
                    window.on_answer(number, wanted);
                    assert!(window.wanted() >= before);
                }
            }
        }
        assert!(window.wanted() <= board.wanted, "the window believes only what the board has said");
    }
    sent
}

fn board(keeps: bool, from: u32, total: u32) -> Board {
    Board { total, wanted: from.min(total - 1), ahead: BTreeSet::new(), keeps }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, rng_seed: RngSeed::Fixed(19), failure_persistence: None, ..Default::default() })]

    #[test]
    fn the_board_gets_every_piece_over_any_line(
        lost in 0.0..0.3f64, twice in 0.0..0.3f64, reordered in 0.0..0.3f64, seed: u64,
        keeps: bool, from in 0u32..5000, total in 1u32..65_536,
    ) {
        pieces_sent(board(keeps, from, total), Line { lost, twice, reordered, seed });
    }

    /// Without losses nothing is sent twice; each loss costs one piece where the board keeps what comes ahead.
    #[test]
    fn a_loss_costs_one_piece(lost in prop_oneof![Just(0.0), 0.0..0.1f64], seed: u64) {
        let total = 64 * 1024;
        let pieces = total as usize / CHUNK;
        let line = Line { lost, twice: 0.0, reordered: 0.0, seed };
        let sent = pieces_sent(board(true, 0, total), line);
        // Either direction loses: at most one more piece for each message that is lost.
        let (mean, most) = (2.0 * lost * sent as f64, 6.0 * (2.0 * lost * sent as f64).sqrt() + 4.0 * f64::from(u8::from(lost > 0.0)));
        prop_assert!((sent - pieces) as f64 <= mean + most, "{sent} sent of {pieces}, {lost} lost");
        prop_assert!(lost > 0.0 || sent == pieces);
    }
}

/// After a resumed upload at any offset the pieces are the board's blocks.
#[test]
fn pieces_are_blocks_wherever_the_upload_is_resumed() {
    let mut window = Window::new(100, 1000);
    let pieces: Vec<(u32, u32)> = std::iter::from_fn(|| window.next()).map(|piece| (piece.offset, piece.len)).collect();
    assert_eq!(pieces, [(100, 156), (256, 256), (512, 256), (768, 232)]);
}
