//! One serial port, two languages: frames between zero bytes, lines of text everywhere else.
//!
//! ```text
//!            00                    00 after bytes: a frame
//!   Text ─────────► Frame ─────────────────────────────────► Text
//!                   │  ▲ 00 at once: this zero opened it
//!                   └──┘
//!   Frame ── silence of 100 ms ──► Text
//!   Text ── silence of 30 s ──► Text without a line that has begun
//! ```
//!
//! After a lost zero the parser is out of step for one frame only: the closing zero of that frame opens the next,
//! and the zero that follows at once does not close it.
use darm_core::units::Micros;
use darm_core::wire::frame::MAX_FRAME;
use darm_core::wire::scan::MAX_SPACES;

/// Silence after which an open frame is given up.
pub const SILENCE: Micros = Micros::from_millis(100);
/// Silence after which a line that nobody has ended is given up: whoever presses Enter later means something else.
pub const LINE_SILENCE: Micros = Micros::from_millis(30_000);
/// What a board queues for the line, bytes: they leave at 11.5 a millisecond, and what confirms a stop leaves behind them within 20 ms.
pub const QUEUE: usize = 128;
/// Longest line of text.
const MAX_LINE: usize = 120;

/// What the port has received.
#[derive(Debug, PartialEq)]
pub enum Item<'a> {
    /// What stood between two zero bytes.
    Frame(&'a mut [u8]),
    /// A line without its end. Printable ASCII.
    Line(&'a str),
    /// A line with characters that are not printable, or a frame or line that is too long, was dropped.
    Dropped,
}

/// Takes bytes, gives items.
pub struct Port {
    bytes: [u8; MAX_FRAME],
    len: usize,
    in_frame: bool,
    /// What is being received does not fit or is no text.
    spoilt: bool,
    last: Micros,
}

impl Default for Port {
    fn default() -> Self {
        Self { bytes: [0; MAX_FRAME], len: 0, in_frame: false, spoilt: false, last: Micros(0) }
    }
}

impl Port {
    /// Takes the next byte, received at `now`.
    pub fn push(&mut self, byte: u8, now: Micros) -> Option<Item<'_>> {
        if now - self.last > if self.in_frame { SILENCE } else { LINE_SILENCE } {
            self.begin(false);
        }
        self.last = now;
        match (byte, self.in_frame) {
            (0, true) => self.close_frame(),
            (0, false) => {
                self.begin(true);
                None
            }
            (_, true) => self.keep(byte, MAX_FRAME),
            (b'\r' | b'\n', false) => self.close_line(),
            (0x08 | 0x7f, false) => {
                self.len = self.len.saturating_sub(1);
                None
            }
            // As the scanner, so that both have the same line after corrections.
            (b' ', false) if self.bytes.get(..self.len).is_some_and(|line| line.ends_with(&[b' '; MAX_SPACES])) => None,
            (b' '..=b'~', false) => self.keep(byte, MAX_LINE),
            (_, false) => {
                self.spoilt = true;
                None
            }
        }
    }

    fn begin(&mut self, in_frame: bool) {
        self.in_frame = in_frame;
        self.len = 0;
        self.spoilt = false;
    }

    fn keep(&mut self, byte: u8, limit: usize) -> Option<Item<'_>> {
        match self.bytes.get_mut(self.len) {
            Some(slot) if self.len < limit => {
                *slot = byte;
                self.len = self.len.saturating_add(1);
            }
            _ => self.spoilt = true,
        }
        None
    }

    /// An empty frame is no frame: the zero before was a stray or closed another one.
    fn close_frame(&mut self) -> Option<Item<'_>> {
        let (len, spoilt) = (self.len, self.spoilt);
        self.begin(len == 0);
        match self.bytes.get_mut(..len) {
            _ if spoilt => Some(Item::Dropped),
            Some(bytes) if len > 0 => Some(Item::Frame(bytes)),
            _ => None,
        }
    }

    fn close_line(&mut self) -> Option<Item<'_>> {
        let (len, spoilt) = (self.len, self.spoilt);
        self.begin(false);
        let line = self.bytes.get(..len).and_then(|bytes| core::str::from_utf8(bytes).ok());
        match line.map(str::trim) {
            _ if spoilt => Some(Item::Dropped),
            Some(line) if !line.is_empty() => Some(Item::Line(line)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Item, Port};
    use darm_core::units::Micros;

    /// Frames as `#bytes`, lines as they are, dropped ones as `!`.
    fn items(bytes: &[u8]) -> Vec<String> {
        let mut port = Port::default();
        let item = |byte: &u8| {
            port.push(*byte, Micros(0)).map(|item| match item {
                Item::Frame(bytes) => format!("#{}", String::from_utf8_lossy(bytes)),
                Item::Line(line) => line.to_string(),
                Item::Dropped => "!".to_string(),
            })
        };
        bytes.iter().filter_map(item).collect()
    }

    #[test]
    fn text_and_frames_share_the_line() {
        assert_eq!(items(b"help\r\n\0ab\0id\r\0cd\0\0ef\0"), ["help", "#ab", "id", "#cd", "#ef"]);
    }

    #[test]
    fn a_lost_zero_costs_one_frame() {
        assert_eq!(items(b"ab\0\0cd\0\0ef\0stop\r"), ["#cd", "#ef", "stop"]);
        assert_eq!(items(b"\0ab\0cd\0\0ef\0"), ["#ab", "#ef"]);
    }

    #[test]
    fn a_typing_error_can_be_taken_back() {
        assert_eq!(items(b"stip\x08\x7fop\r"), ["stop"]);
    }

    #[test]
    fn too_long_and_unprintable_are_dropped() {
        assert_eq!(items(&[&[b'x'; 200][..], b"\rid\r"].concat()), ["!", "id"]);
        assert_eq!(items(&[b"\0", &[b'x'; 400][..], b"\0id\r"].concat()), ["!", "id"]);
        assert_eq!(items(b"i\xffd\rid\r"), ["!", "id"]);
    }

    #[test]
    fn silence_ends_an_open_line() {
        for (silence_ms, line) in [(30_000, Some(Item::Line("coil 0 on 400"))), (30_001, None)] {
            let mut port = Port::default();
            b"coil 0 on 400".iter().for_each(|byte| assert_eq!(port.push(*byte, Micros(0)), None));
            assert_eq!(port.push(b'\r', Micros::from_millis(silence_ms)), line, "{silence_ms} ms");
        }
    }

    #[test]
    fn silence_ends_an_open_frame() {
        let mut port = Port::default();
        assert_eq!(port.push(0, Micros(0)), None);
        assert_eq!(port.push(b'x', Micros(1)), None);
        for byte in *b"id" {
            assert_eq!(port.push(byte, Micros(200_000)), None);
        }
        assert_eq!(port.push(b'\r', Micros(200_000)), Some(Item::Line("id")));
    }
}
