//! Any bytes on the console of the firmware's library: decoder, dispatcher and text commands must neither panic nor stall.
#![no_main]

use std::sync::OnceLock;

use darm_sim::in_process::{InProcess, MemoryFlash};
use darm_sim::plant::Plant;
use darm_core::output::Wiring;
use darm_core::wire::frame::{self, Header};
use libfuzzer_sys::fuzz_target;

fn board() -> &'static InProcess {
    static BOARD: OnceLock<InProcess> = OnceLock::new();
    BOARD.get_or_init(|| {
        let plant = Plant::new(&Wiring::default(), &[]);
        InProcess::boot(plant, MemoryFlash::default()).expect("a thread for the board")
    })
}

fuzz_target!(|bytes: &[u8]| {
    let mut link = board().link();
    // As they come, and as the payload of a valid frame: the fuzzer cannot guess a checksum.
    link.send(bytes).expect("the board's thread lives");
    let (header, payload) = (Header { tag: 0x10, link: 1, number: 1 }, &bytes[..bytes.len().min(frame::MAX_PAYLOAD)]);
    let mut framed = [0; frame::MAX_FRAME];
    let len = frame::encode(header, payload, &mut framed).expect("the payload fits");
    link.send(&framed[..len]).expect("the board's thread lives");
    board().pass(0.005);
    assert!(board().state().is_some(), "the board panicked");
});
