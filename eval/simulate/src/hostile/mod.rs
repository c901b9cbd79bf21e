//! The hostile sender: valid frames of every message with arbitrary values, lines of text, tables beyond every limit.

pub mod generate;
pub mod tables;

use darm_core::sequencer::Command;
use darm_core::wire::bootstrap;
use darm_core::wire::frame::{self, Header, MAX_FRAME};
use darm_core::wire::message::{REQUEST, Request};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use crate::panics::caught;

/// A frame and the servo angles that it asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sent {
    /// Bytes on the line.
    pub bytes: Vec<u8>,
    /// Requested servo angles, rad.
    pub angles_rad: Vec<f32>,
    /// Zero offsets that it sets, rad.
    pub offsets_rad: Vec<f32>,
    /// What it is, for the trace.
    pub what: String,
}

/// A frame of these bytes; nothing when they do not fit one.
pub fn framed(tag: u8, link: u32, number: u16, payload: &[u8]) -> Vec<u8> {
    let mut bytes = [0; MAX_FRAME];
    let length = frame::encode(Header { tag, link, number }, payload, &mut bytes).unwrap_or(0);
    bytes[..length].to_vec()
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
        return Sent { bytes: framed(tag, link, number, payload), what: format!("bootstrap {tag}"), ..Sent::default() };
    }
    let payload = generate::request_bytes(rng, likely);
    let mut sent = Sent { bytes: framed(REQUEST, link, number, &payload), ..Sent::default() };
    match postcard::from_bytes::<Request<'_>>(&payload) {
        Ok(request) => {
            match request {
                Request::Command(Command::Servo { angle_rad, .. }) => sent.angles_rad.push(angle_rad),
                Request::Calibrate(calibration) => sent.offsets_rad.extend(calibration.offsets_rad()),
                _ => {}
            }
            // A value that the type does not allow may not even be printable.
            sent.what = caught(|| format!("{request:?}")).unwrap_or_else(|_| format!("{payload:02x?}"));
        }
        Err(_) => sent.what = format!("{payload:02x?}"),
    }
    sent.what.truncate(160);
    sent
}

/// A command and a stop in one piece. The stop comes twice: what stood on the line before may cost one frame.
pub fn command_and_stop(rng: &mut ChaCha8Rng, coils: u8) -> Sent {
    let what = match rng.random_range(0..4u8) {
        0 => "play".to_owned(),
        _ => format!("coil {} on {}", rng.random_range(0..coils.max(1)), rng.random_range(40..700)),
    };
    let stop = framed(bootstrap::Request::Stop.tag(), 0, rng.random(), bootstrap::Request::Stop.payload());
    let bytes = [format!("{what}\r").as_bytes(), &stop, &stop].concat();
    Sent { bytes, what: format!("{what}, stop"), ..Sent::default() }
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
    let angles_rad = if line.starts_with("servo") { second.parse().ok().map(f32::to_radians) } else { None };
    let angles_rad = angles_rad.into_iter().collect();
    Sent { bytes: format!("{line}\r").into_bytes(), angles_rad, what: line, ..Sent::default() }
}
