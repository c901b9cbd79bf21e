//! Finds a stop in the bytes of a console, whatever is around it: those that the board receives, and those that a program sends which
//! uses the port of another.
//!
//! A stop is one event, in whatever form it comes: typed, the frozen frame of the bootstrap set, or the message `Command(Stop)` of
//! any link and number. It must not depend on what else is on the line: an open frame of another program, lost zeros, noise
//! before a typed word. So nothing is parsed here. A stop frame is what is between any two zeros, if its checksum is right and
//! [`Stop::of`] says so; a typed stop is a line that ends in `stop`, after corrections of up to twelve characters. The bytes
//! `stop\r` within the data of another frame are a stop too: by chance once in 10^12 bytes, and a stop too many does no harm.

use super::bootstrap;
use super::frame::{self, HEADER, Header};
use super::message::{self, MAX_STOP, REQUEST};

/// A stop, in the language in which it came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// A typed line.
    Typed,
    /// The frame of the bootstrap set.
    Bootstrap(Header),
    /// A request of the messages.
    Message(Header),
}

impl Stop {
    /// What a frame means, if it is a stop: the only place that decides this.
    pub fn of(header: Header, payload: &[u8]) -> Option<Self> {
        if header.tag == REQUEST {
            return message::is_stop(payload).then_some(Self::Message(header));
        }
        let request = bootstrap::Request::decode(header.tag, payload)?;
        (request == bootstrap::Request::Stop).then_some(Self::Bootstrap(header))
    }
}

/// Spaces in a row that count, here and in a line of the board: more would push the word out of the characters that are remembered.
pub const MAX_SPACES: usize = 8;
/// Longest stop frame between its zeros: header, payload, checksum and COBS's overhead.
const FRAME: usize = HEADER + MAX_STOP + 4 + 1;
const WORD: u32 = u32::from_be_bytes(*b"stop");
/// Bit 5 of each letter: small and capital.
const CASE: u32 = 0x2020_2020;

/// What has been received since the last zero, and the last characters of the line.
#[derive(Debug, Default)]
pub struct Scanner {
    bytes: [u8; FRAME],
    /// May be larger than the room: what is that long is no stop.
    len: usize,
    /// The last sixteen characters, the last one lowest.
    typed: u128,
}

impl Scanner {
    /// Takes the next byte; the stop that it completes.
    pub fn push(&mut self, byte: u8) -> Option<Stop> {
        if byte == 0 {
            let stop = self.bytes.get_mut(..self.len).and_then(stop_frame);
            *self = Self::default();
            return stop;
        }
        if let Some(slot) = self.bytes.get_mut(self.len) {
            *slot = byte;
        }
        self.len = self.len.saturating_add(1);
        match byte {
            b'\r' | b'\n' => {
                let mut line = core::mem::take(&mut self.typed);
                while line as u8 == b' ' {
                    line >>= 8;
                }
                return (line as u32 | CASE == WORD).then_some(Stop::Typed);
            }
            0x08 | 0x7f => self.typed >>= 8,
            b' ' if self.typed as u64 == u64::from_be_bytes([b' '; MAX_SPACES]) => {}
            _ => self.typed = self.typed << 8 | u128::from(byte),
        }
        None
    }
}

fn stop_frame(encoded: &mut [u8]) -> Option<Stop> {
    let (header, payload) = frame::decode(encoded).ok()?;
    Stop::of(header, payload)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::{FRAME, Scanner, Stop};
    use crate::sequencer::Command;
    use crate::wire::bootstrap;
    use crate::wire::frame::{Header, MAX_FRAME, encode};
    use crate::wire::message::{REQUEST, Request};
    use std::vec;
    use std::vec::Vec;

    const HEADER: Header = Header { tag: bootstrap::Request::Stop.tag(), link: 0, number: 9 };
    const MESSAGE: Header = Header { tag: REQUEST, link: 0xdead_0000, number: 0xff00 };

    fn stops(bytes: &[u8]) -> Vec<Stop> {
        let mut scanner = Scanner::default();
        bytes.iter().filter_map(|byte| scanner.push(*byte)).collect()
    }

    fn frame_of(header: Header, payload: &[u8]) -> Vec<u8> {
        let mut frame = [0; MAX_FRAME];
        let len = encode(header, payload, &mut frame).unwrap();
        frame[..len].to_vec()
    }

    /// Both frames, and the message with each index in as many bytes as the decoder takes.
    fn stop_frames() -> Vec<(Vec<u8>, Stop)> {
        let mut payload = [0; 8];
        let message = postcard::to_slice(&Request::Command(Command::Stop), &mut payload).unwrap().to_vec();
        let long = [0x86, 0x80, 0x80, 0x80, 0, 0x81, 0x80, 0x80, 0x80, 0];
        vec![
            (frame_of(HEADER, &[]), Stop::Bootstrap(HEADER)),
            (frame_of(MESSAGE, &message), Stop::Message(MESSAGE)),
            (frame_of(MESSAGE, &long), Stop::Message(MESSAGE)),
        ]
    }

    struct Random(u64);

    impl Random {
        fn below(&mut self, n: usize) -> usize {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) as usize % n
        }
    }

    #[test]
    fn a_stop_frame_is_heard_behind_anything() {
        for (mut frame, stop) in stop_frames() {
            assert!(frame.len() <= FRAME + 2);
            for before in [&b""[..], b"\0", b"\0xy", b"\0xy\0", b"text", &[b'x'; 500], &[0xff; 40]] {
                let bytes = [before, &frame, b"id\r"].concat();
                assert_eq!(stops(&bytes), [stop], "{before:?}");
            }
            for at in 1..frame.len() - 1 {
                frame[at] ^= 1;
                assert_eq!(stops(&frame), [], "byte {at}");
                frame[at] ^= 1;
            }
        }
    }

    /// As docs/wire.md prints it.
    #[test]
    fn the_message_has_these_bytes() {
        let header = Header { tag: REQUEST, link: 0, number: 0 };
        let bytes = [0, 2, 0x10, 1, 1, 1, 1, 1, 7, 6, 1, 0xcf, 0xc1, 0x94, 0x6b, 0];
        assert_eq!(frame_of(header, &[6, 1]), bytes);
        assert_eq!(stops(&bytes), [Stop::Message(header)]);
    }

    #[test]
    fn a_stop_frame_within_random_bytes_is_found() {
        let (mut random, frames) = (Random(7), stop_frames());
        for round in 0..20_000 {
            let mut noise = || (0..random.below(60)).map(|_| random.below(256) as u8).collect::<Vec<u8>>();
            let (before, behind) = (noise(), noise());
            let (frame, stop) = &frames[round % frames.len()];
            let bytes = [&before[..], frame, &behind].concat();
            assert!(stops(&bytes).contains(stop), "round {round}: {bytes:?}");
        }
    }

    #[test]
    fn requests_other_than_the_stop_are_none() {
        for payload in [&[6, 0][..], &[6, 2], &[6, 1, 0], &[6], &[1], &[5, 1], &[]] {
            assert_eq!(stops(&frame_of(MESSAGE, payload)), [], "{payload:?}");
        }
        assert_eq!(stops(&frame_of(Header { tag: 0x11, ..MESSAGE }, &[6, 1])), []);
        assert_eq!(stops(&frame_of(HEADER, &[0])), []);
    }

    #[test]
    fn a_typed_stop_is_heard_behind_anything() {
        for line in [
            &b"stop\r"[..],
            b"STOP\n",
            b"  stop \r\n",
            b"\0xstop\r",
            b"\xff\x01stop\r",
            b"sti\x08op\r",
            b"stopp\x08\r",
            b"stop now\x7f\x7f\x7f\x7f\r",
            b"play\x08\x08\x08\x08stop\r",
        ] {
            assert_eq!(stops(line), [Stop::Typed], "{line:?}");
        }
        for line in [&b"stop"[..], b"stops\r", b"sto\rp\r", b"top\r", b"stop\0\r", b"stop\x08\r"] {
            assert_eq!(stops(line), [], "{line:?}");
        }
    }
}
