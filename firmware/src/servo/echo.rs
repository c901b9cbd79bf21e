//! One wire for both directions: what is sent comes back and is dropped, the answer behind it passes.
//!
//! A receiver that hears its sender takes the request for an answer, since both have the same form. Bytes that come are
//! compared with those that were sent: as long as they agree they are held back, and dropped when the last one has come. At
//! the first difference all that was held back passes: then the port has no echo, and what comes is an answer.

use core::cell::RefCell;

use embedded_io_async::{ErrorType, Read, Write};

/// Longest request whose echo is expected.
const LONGEST: usize = 32;

/// What was sent and has not come back.
#[derive(Default)]
struct Expected {
    sent: heapless::Vec<u8, LONGEST>,
    /// Bytes of it that have come.
    matched: usize,
    /// Bytes that were held back and pass, before anything else.
    passing: heapless::Deque<u8, LONGEST>,
}

impl Expected {
    fn send(&mut self, bytes: &[u8]) {
        if self.matched == self.sent.len() {
            self.sent.clear();
            self.matched = 0;
        }
        // What is too long is not expected back.
        let _ = self.sent.extend_from_slice(bytes);
    }

    /// Takes a byte that came; true when it passes.
    fn take(&mut self, byte: u8) -> bool {
        if self.matched == self.sent.len() {
            return true;
        }
        if self.sent.get(self.matched) == Some(&byte) {
            self.matched = self.matched.saturating_add(1);
            return false;
        }
        for byte in self.sent.iter().take(self.matched) {
            let _ = self.passing.push_back(*byte);
        }
        self.sent.clear();
        self.matched = 0;
        let _ = self.passing.push_back(byte);
        false
    }
}

/// The wire.
#[derive(Default)]
pub struct Wire(RefCell<Expected>);

impl Wire {
    /// A reader and a writer on this wire, over those of the port.
    pub fn split<R: Read, W: Write>(&self, reader: R, writer: W) -> (HalfDuplexRx<'_, R>, HalfDuplexTx<'_, W>) {
        (HalfDuplexRx { wire: self, reader }, HalfDuplexTx { wire: self, writer })
    }
}

/// Hears what others say.
pub struct HalfDuplexRx<'w, R> {
    wire: &'w Wire,
    reader: R,
}

/// Sends, and has the echo dropped.
pub struct HalfDuplexTx<'w, W> {
    wire: &'w Wire,
    writer: W,
}

impl<R: Read> ErrorType for HalfDuplexRx<'_, R> {
    type Error = R::Error;
}

impl<W: Write> ErrorType for HalfDuplexTx<'_, W> {
    type Error = W::Error;
}

impl<R: Read> Read for HalfDuplexRx<'_, R> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, R::Error> {
        loop {
            let count = self.pass(bytes);
            if count > 0 || bytes.is_empty() {
                return Ok(count);
            }
            let room = bytes.len().min(LONGEST);
            let came = self.reader.read(bytes.get_mut(..room).unwrap_or_default()).await?;
            if let Ok(mut expected) = self.wire.0.try_borrow_mut() {
                for byte in bytes.iter().take(came) {
                    if expected.take(*byte) {
                        let _ = expected.passing.push_back(*byte);
                    }
                }
            }
        }
    }
}

impl<R> HalfDuplexRx<'_, R> {
    fn pass(&mut self, bytes: &mut [u8]) -> usize {
        let Ok(mut expected) = self.wire.0.try_borrow_mut() else { return 0 };
        let mut count = 0usize;
        for slot in bytes {
            let Some(byte) = expected.passing.pop_front() else { break };
            *slot = byte;
            count = count.saturating_add(1);
        }
        count
    }
}

impl<W: Write> Write for HalfDuplexTx<'_, W> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, W::Error> {
        if let Ok(mut expected) = self.wire.0.try_borrow_mut() {
            expected.send(bytes);
        }
        self.writer.write_all(bytes).await?;
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), W::Error> {
        self.writer.flush().await
    }
}

#[cfg(test)]
mod tests {
    use super::Expected;

    /// What passes of `came` after `sent`.
    fn heard(sent: &[u8], came: &[u8]) -> Vec<u8> {
        let (mut expected, mut heard) = (Expected::default(), Vec::new());
        expected.send(sent);
        for byte in came {
            if expected.take(*byte) {
                heard.push(*byte);
            }
            heard.extend(std::iter::from_fn(|| expected.passing.pop_front()));
        }
        heard
    }

    #[test]
    fn the_echo_is_dropped_and_the_answer_passes() {
        assert_eq!(heard(&[0xff, 0xff, 1, 4, 2], &[0xff, 0xff, 1, 4, 2, 0xff, 0xff, 1, 2, 0]), [0xff, 0xff, 1, 2, 0]);
    }

    #[test]
    fn without_an_echo_the_answer_passes_from_its_first_byte() {
        assert_eq!(heard(&[0xff, 0xff, 1, 4, 2], &[0xff, 0xff, 1, 2, 0, 7]), [0xff, 0xff, 1, 2, 0, 7]);
    }

    #[test]
    fn each_request_has_its_echo_dropped() {
        let mut expected = Expected::default();
        expected.send(&[1, 2]);
        assert!(!expected.take(1) && !expected.take(2) && expected.take(9));
        expected.send(&[3]);
        assert!(!expected.take(3) && expected.take(3));
    }
}
