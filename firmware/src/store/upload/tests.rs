//! Chunks in any order.
use darm_core::table::{Board, Table};
use darm_core::units::DeviceId;
use darm_core::wire::message::Image;

use super::super::Store;
use super::BLOCK;
use crate::tests::fakes::{Cells, MockFlash, profile, run, table};

/// Numbers that look random, the same in each run.
struct Random(u32);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as usize % limit
    }
}

fn now<T>(future: impl Future<Output = T>) -> T {
    run(future, || {})
}

fn begun(rows: u64) -> (Store<MockFlash>, Image, Vec<u8>) {
    let (image, bytes) = table(2, rows, true);
    let mut store = now(Store::open(Cells::erased().flash(u32::MAX)));
    assert_eq!(now(store.begin(image)), Ok(0));
    (store, image, bytes)
}

/// What was uploaded is the image, and it can be committed.
fn commits(store: &mut Store<MockFlash>) {
    let board = Board { device: Some(DeviceId([7; 12])), profile: &profile() };
    assert_eq!(now(store.load_upload(&mut Box::<Table>::default(), &board)), Ok(()));
    assert_eq!(now(store.commit()), Ok(()));
}

/// The flash refuses a second write, so that no block is written twice.
#[test]
fn blocks_in_any_order_with_losses_and_copies_make_the_image() {
    for seed in 0..60 {
        let random = &mut Random(seed);
        let (mut store, image, bytes) = begun(300 + 5 * u64::from(seed));
        let blocks: Vec<&[u8]> = bytes.chunks(BLOCK).collect();
        let (mut has, mut sent) = (vec![false; blocks.len()], 0);
        while !store.is_complete(image) {
            let at = random.below(blocks.len());
            let wanted = now(store.chunk((at * BLOCK) as u32, blocks[at])).unwrap() as usize;
            has[at] = true;
            let missing = has.iter().position(|has| !has).map_or(bytes.len(), |block| block * BLOCK);
            assert_eq!(wanted, missing, "seed {seed}");
            sent += 1;
        }
        assert!(sent > blocks.len() && bytes.len() > 2048, "seed {seed}: {sent} chunks, {} bytes", bytes.len());
        commits(&mut store);
    }
}

/// A host that sends pieces of another length gets the same image: those ahead of the wanted offset are not taken.
#[test]
fn pieces_of_any_length_in_any_order_make_the_image() {
    for seed in 0..60 {
        let random = &mut Random(1000 + seed);
        let (mut store, image, bytes) = begun(150);
        let mut wanted = 0;
        while !store.is_complete(image) {
            let at = match random.below(4) {
                0 => wanted,
                1 => (wanted + random.below(1000)).min(bytes.len()),
                _ => random.below(bytes.len()) / BLOCK * BLOCK,
            };
            let len = [random.below(BLOCK), BLOCK][random.below(2)].min(bytes.len() - at);
            let next = now(store.chunk(at as u32, &bytes[at..at + len])).unwrap() as usize;
            assert!(next >= wanted, "seed {seed}: {next} after {wanted}");
            wanted = next;
        }
        commits(&mut store);
    }
}

#[test]
fn a_wrong_block_ahead_is_found_by_the_digest() {
    let (mut store, _, bytes) = begun(150);
    assert_eq!(now(store.chunk(BLOCK as u32, &[0xaa; BLOCK])), Ok(0));
    for (at, block) in bytes.chunks(BLOCK).enumerate() {
        now(store.chunk((at * BLOCK) as u32, block)).unwrap();
    }
    let board = Board { device: Some(DeviceId([7; 12])), profile: &profile() };
    let loaded = now(store.load_upload(&mut Box::<Table>::default(), &board));
    assert_eq!(loaded, Err(super::super::LoadError::Damaged));
}
