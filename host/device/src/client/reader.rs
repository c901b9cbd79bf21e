//! Parts the byte stream from a board into frames and text.
//!
//! A frame is between two zero bytes, everything else is text. A lost or damaged zero byte turns frames into text
//! and text into frames; the reader finds back: after a frame that cannot be read the zero byte behind it may as well
//! begin the next one, and silence ends a frame that does not end.

use darm_core::wire::frame::{self, FrameError, Header, MAX_FRAME};

/// A frame that has been incomplete for this time without a byte has lost its end.
const SILENCE_S: f64 = 0.1;

/// What comes out of the stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Piece {
    /// A frame that was read.
    Frame(Header, Vec<u8>),
    /// A frame that could not be read.
    Damaged(FrameError),
    /// Bytes outside frames.
    Text(Vec<u8>),
}

/// Where in the stream the reader is.
#[derive(Debug, Default)]
pub(super) struct Reader {
    /// Bytes since the zero byte that began a frame.
    frame: Option<Vec<u8>>,
    last_s: f64,
}

impl Reader {
    /// Takes bytes that arrived at host time `now_s`.
    pub(super) fn read(&mut self, now_s: f64, bytes: &[u8]) -> Vec<Piece> {
        let mut pieces = Vec::new();
        if now_s - self.last_s > SILENCE_S {
            self.frame = None;
        }
        self.last_s = now_s;
        for &byte in bytes {
            match (&mut self.frame, byte) {
                (None, 0) => self.frame = Some(Vec::new()),
                (None, _) => push_text(&mut pieces, byte),
                (Some(frame), 0) if frame.is_empty() => {}
                (Some(frame), 0) => {
                    let piece = read_frame(frame);
                    self.frame = matches!(piece, Piece::Damaged(_)).then(Vec::new);
                    pieces.push(piece);
                }
                (Some(frame), _) if frame.len() >= MAX_FRAME => {
                    pieces.push(Piece::Damaged(FrameError::TooLong));
                    self.frame = None;
                }
                (Some(frame), _) => frame.push(byte),
            }
        }
        pieces
    }
}

fn read_frame(encoded: &mut [u8]) -> Piece {
    match frame::decode(encoded) {
        Ok((header, payload)) => Piece::Frame(header, payload.to_vec()),
        Err(error) => Piece::Damaged(error),
    }
}

fn push_text(pieces: &mut Vec<Piece>, byte: u8) {
    if let Some(Piece::Text(text)) = pieces.last_mut() {
        text.push(byte);
    } else {
        pieces.push(Piece::Text(vec![byte]));
    }
}

#[cfg(test)]
mod tests {
    use darm_core::wire::frame::{Header, MAX_FRAME, encode};

    use super::{Piece, Reader};

    const HEADER: Header = Header { tag: 0x90, link: 7, number: 9 };

    fn framed(payload: &[u8]) -> Vec<u8> {
        let mut frame = [0; MAX_FRAME];
        let len = encode(HEADER, payload, &mut frame).unwrap();
        frame[..len].to_vec()
    }

    fn complete(payload: &[u8]) -> Piece {
        Piece::Frame(HEADER, payload.to_vec())
    }

    #[test]
    fn text_and_frames_are_parted_wherever_the_bytes_are_cut() {
        let stream = [b"hi\r\n".to_vec(), framed(&[0, 1]), framed(&[2]), b"> ".to_vec()].concat();
        for cut in 0..stream.len() {
            let mut reader = Reader::default();
            let mut pieces = reader.read(0.0, &stream[..cut]);
            pieces.extend(reader.read(0.01, &stream[cut..]));
            let frames: Vec<_> = pieces.iter().filter(|piece| matches!(piece, Piece::Frame(..))).collect();
            assert_eq!(frames, [&complete(&[0, 1]), &complete(&[2])]);
            let text: Vec<u8> = pieces
                .iter()
                .flat_map(|piece| if let Piece::Text(text) = piece { text.clone() } else { vec![] })
                .collect();
            assert_eq!(text, b"hi\r\n> ");
        }
    }

    #[test]
    fn a_lost_zero_byte_costs_at_most_one_more_frame() {
        let one = framed(&[1]);
        for lost in [0, one.len() - 1] {
            let mut stream = one.clone();
            stream.remove(lost);
            (2..5).for_each(|n| stream.extend(framed(&[n])));
            let pieces = Reader::default().read(0.0, &stream);
            assert!(pieces.ends_with(&[complete(&[3]), complete(&[4])]), "{pieces:?}");
        }
    }

    #[test]
    fn silence_ends_a_frame_without_end() {
        let mut reader = Reader::default();
        reader.read(0.0, &[0, 5, 6]);
        assert_eq!(reader.read(1.0, b"ok"), [Piece::Text(b"ok".to_vec())]);
    }
}
