//! Finds a stop in the bytes of the console, whatever is around it.
//!
//! A stop must not depend on what else is on the line: an open frame of another program, lost zeros, noise before a typed
//! word. So nothing is parsed here. A stop frame is what is between any two zeros, if its checksum is right; a typed
//! stop is a line that ends in `stop`. The bytes `stop\r` within the data of another frame are a stop too: by chance once
//! in 10^12 bytes, and a stop too many does no harm.
use darm_core::wire::bootstrap;
use darm_core::wire::frame::{self, Header};

/// A stop, in the language in which it came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Stop {
    Typed,
    Framed(Header),
}

/// Longest stop frame between its zeros.
const FRAME: usize = 16;
const WORD: [u8; 4] = *b"stop";

/// What has been received since the last zero, and the last characters of the line.
#[derive(Default)]
pub(crate) struct Scanner {
    bytes: [u8; FRAME],
    /// May be larger than the room: what is that long is no stop.
    len: usize,
    typed: [u8; WORD.len()],
}

impl Scanner {
    /// Takes the next byte; the stop that it completes.
    pub(crate) fn push(&mut self, byte: u8) -> Option<Stop> {
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
                let is_stop = self.typed.eq_ignore_ascii_case(&WORD);
                self.typed = [0; WORD.len()];
                return is_stop.then_some(Stop::Typed);
            }
            0x08 | 0x7f => {
                let [first, second, third, _] = self.typed;
                self.typed = [0, first, second, third];
            }
            b' ' => {}
            _ => {
                let [_, second, third, fourth] = self.typed;
                self.typed = [second, third, fourth, byte];
            }
        }
        None
    }
}

fn stop_frame(encoded: &mut [u8]) -> Option<Stop> {
    let (header, payload) = frame::decode(encoded).ok()?;
    let request = bootstrap::Request::decode(header.tag, payload)?;
    (request == bootstrap::Request::Stop).then_some(Stop::Framed(header))
}

#[cfg(test)]
mod tests {
    use super::{Scanner, Stop};
    use darm_core::wire::bootstrap::Request;
    use darm_core::wire::frame::{Header, MAX_FRAME, encode};

    const HEADER: Header = Header { tag: Request::Stop.tag(), link: 0, number: 9 };

    fn stops(bytes: &[u8]) -> Vec<Stop> {
        let mut scanner = Scanner::default();
        bytes.iter().filter_map(|byte| scanner.push(*byte)).collect()
    }

    #[test]
    fn a_stop_frame_is_heard_behind_anything() {
        let mut frame = [0; MAX_FRAME];
        let len = encode(HEADER, Request::Stop.payload(), &mut frame).unwrap();
        for before in [&b""[..], b"\0", b"\0xy", b"\0xy\0", b"text", &[b'x'; 500], &[0xff; 40]] {
            let bytes = [before, &frame[..len], b"id\r"].concat();
            assert_eq!(stops(&bytes), [Stop::Framed(HEADER)], "{before:?}");
        }
        frame[3] ^= 1;
        assert_eq!(stops(&frame[..len]), []);
    }

    #[test]
    fn a_typed_stop_is_heard_behind_anything() {
        for line in [&b"stop\r"[..], b"STOP\n", b"  stop \r\n", b"\0xstop\r", b"\xff\x01stop\r", b"sti\x08op\r"] {
            assert_eq!(stops(line), [Stop::Typed], "{line:?}");
        }
        for line in [&b"stop"[..], b"stops\r", b"sto\rp\r", b"top\r", b"stop\0\r"] {
            assert_eq!(stops(line), [], "{line:?}");
        }
    }
}
