//! The hostile sender: valid frames of every message with arbitrary values, lines of text, tables beyond every limit.

pub mod generate;
pub mod tables;

use darm_core::sequencer::Command;
use darm_core::wire::frame::{self, Header, MAX_FRAME};
use darm_core::wire::message::{REQUEST, Request};
use darm_core::wire::{PROTOCOL, bootstrap};
use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;

use crate::arm::ArmPlan;
use crate::panics::caught;
use crate::words;

/// Bytes and what they are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sent {
    /// Bytes on the line.
    pub bytes: Vec<u8>,
    /// What it is, for the trace.
    pub what: String,
}

/// A frame of these bytes; nothing when they do not fit one.
pub fn framed(tag: u8, link: u32, number: u16, payload: &[u8]) -> Vec<u8> {
    let mut bytes = [0; MAX_FRAME];
    let length = frame::encode(Header { tag, link, number }, payload, &mut bytes).unwrap_or(0);
    bytes[..length].to_vec()
}

/// What opens a connection, with the board's challenge.
pub fn hello(link: u32, number: u16, challenge: u64) -> Vec<u8> {
    request(link, number, &Request::Hello { protocol: PROTOCOL, challenge })
}

/// A request in a frame.
pub fn request(link: u32, number: u16, request: &Request<'_>) -> Vec<u8> {
    postcard::to_allocvec(request).map(|payload| framed(REQUEST, link, number, &payload)).unwrap_or_default()
}

/// An arbitrary frame: one in eight of the bootstrap set, the others any request with any values, some of them `likely`.
pub fn any_frame(rng: &mut ChaCha8Rng, link: u32, likely: &[u64]) -> Sent {
    let number = rng.random();
    if rng.random_ratio(1, 8) {
        let (tag, payload) =
            [(1, &[][..]), (2, &[]), (3, &[]), (4, &[]), (5, &[0]), (5, &[1]), (6, &[0])][rng.random_range(0..7)];
        let link = if rng.random() { 0 } else { link };
        return Sent { bytes: framed(tag, link, number, payload), what: format!("bootstrap {tag}") };
    }
    let payload = generate::request_bytes(rng, likely);
    let mut sent = Sent { bytes: framed(REQUEST, link, number, &payload), ..Sent::default() };
    match postcard::from_bytes::<Request<'_>>(&payload) {
        // A value that the type does not allow may not even be printable.
        Ok(request) => {
            sent.what = caught(|| format!("{request:?}")).unwrap_or_else(|_| format!("{payload:02x?}"));
        }
        Err(_) => sent.what = format!("{payload:02x?}"),
    }
    sent.what.truncate(160);
    sent
}

/// A command and a stop of any form in one piece. The stop comes twice: what stood on the line before may cost one frame.
pub fn command_and_stop(rng: &mut ChaCha8Rng, coils: u8) -> Sent {
    let what = match rng.random_range(0..4u8) {
        0 => "play".to_owned(),
        _ => format!("coil {} on {}", rng.random_range(0..coils.max(1)), rng.random_range(40..700)),
    };
    let number = rng.random();
    let stop = match rng.random_range(0..3u8) {
        0 => stop(number).bytes,
        1 => stop_message(rng.random(), number),
        _ => TYPED_STOP.to_vec(),
    };
    // The board takes 64 bytes at once: a command of the first ones may wait for its tick when the stop is found.
    let between = b"\r".repeat(rng.random_range(0..100));
    let bytes = [format!("{what}\r").as_bytes(), &between, &stop, &stop].concat();
    Sent { bytes, what: format!("{what}, {} empty lines, stop", between.len()) }
}

/// The stop that somebody types.
pub const TYPED_STOP: &[u8] = b"stop\r";

/// The stop of the messages.
pub fn stop_message(link: u32, number: u16) -> Vec<u8> {
    request(link, number, &Request::Command(Command::Stop))
}

/// The stop of the bootstrap set.
pub fn stop(number: u16) -> Sent {
    let stop = bootstrap::Request::Stop;
    Sent { bytes: framed(stop.tag(), 0, number, stop.payload()), what: "stop".into() }
}

/// A line of text of known and unknown commands with arbitrary numbers.
pub fn any_line(rng: &mut ChaCha8Rng) -> Sent {
    const NUMBERS: [&str; 12] = ["0", "1", "3", "7", "47", "48", "255", "256", "-1", "4294967295", "NaN", "1e30"];
    let mut number = || NUMBERS[rng.random_range(0..NUMBERS.len())];
    let (first, second) = (number(), number());
    let line = match rng.random_range(0..10u8) {
        0 => "play".into(),
        1 => "stop".into(),
        2 => "clear".into(),
        3 => format!("coil {first} on {second}"),
        4 => format!("servo {first} {second}"),
        5 => format!("word {}", "0123".repeat(rng.random_range(0..17))),
        6 => format!("nearest {first} {second} 0"),
        7 => "status".into(),
        8 => "log".into(),
        _ => "limits".into(),
    };
    Sent { bytes: format!("{line}\r").into_bytes(), what: line }
}

/// Every command that would move something, each with a separate number, on a connection that is said to be opened again
/// first, with the challenge that opened it.
pub fn commands_of_before(rng: &mut ChaCha8Rng, link: u32, challenge: u64, arm: &ArmPlan) -> Sent {
    let mut number: u16 = rng.random();
    let coil = rng.random_range(0..arm.coils.len().max(1)) as u8;
    let angle_rad = rng.random_range(-0.4..0.4);
    let mut requests = vec![
        Request::Command(Command::Coil { coil, on_ms: 60 }),
        Request::Command(Command::Word(words::word(arm, rng.random()))),
        Request::Command(Command::Servo { servo: 0, angle_rad }),
        Request::Command(Command::Play),
    ];
    requests.shuffle(rng);
    // Without it an emergency stop would refuse the others for being latched.
    requests.insert(0, Request::Command(Command::Clear));
    requests.insert(rng.random_range(0..=1), Request::Hello { protocol: PROTOCOL, challenge });
    let frames = requests.iter().map(|asked| {
        number = number.wrapping_add(1);
        request(link, number, asked)
    });
    Sent { bytes: frames.collect::<Vec<_>>().concat(), what: format!("commands of connection {link:x}") }
}
