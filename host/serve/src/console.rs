//! The console of pages: what they have typed, and the text that the board has sent.

use std::collections::VecDeque;

use serde::Serialize;

/// Lines that are kept: some answers to `help`.
const KEPT: usize = 300;
/// Longest line that is kept; a board sends shorter ones.
const LONGEST: usize = 400;

/// Whether lines have this character: no other one, and none that takes six letters in an answer.
fn is_kept(byte: u8) -> bool {
    matches!(byte, b' '..=b'~' | b'\t')
}

/// A line of the console.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct ConsoleLine {
    /// Its number.
    pub number: u64,
    /// Whether a page has typed it.
    pub is_typed: bool,
    /// The line.
    pub text: String,
}

/// The last lines.
#[derive(Debug, Default)]
pub(crate) struct Console {
    lines: VecDeque<ConsoleLine>,
    count: u64,
    begun: String,
}

impl Console {
    /// Number of lines so far.
    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    /// Keeps what a page has typed; a stop may have any length and any characters.
    pub(crate) fn typed(&mut self, line: &str) {
        let kept = line.chars().filter(|c| u8::try_from(*c).is_ok_and(is_kept)).take(LONGEST).collect();
        self.push(kept, true);
    }

    /// Takes text of the board; whether it has ended a line.
    pub(crate) fn hear(&mut self, bytes: &[u8]) -> bool {
        let before = self.count;
        for &byte in bytes {
            match byte {
                b'\n' => {
                    let text = std::mem::take(&mut self.begun);
                    self.push(text, false);
                }
                byte if is_kept(byte) && self.begun.len() < LONGEST => self.begun.push(byte.into()),
                _ => {}
            }
        }
        self.count > before
    }

    /// The lines from this number on, as far as they are kept.
    pub(crate) fn from(&self, number: u64) -> Vec<ConsoleLine> {
        self.lines.iter().filter(|line| line.number >= number).cloned().collect()
    }

    fn push(&mut self, text: String, is_typed: bool) {
        self.lines.push_back(ConsoleLine { number: self.count, is_typed, text });
        self.count += 1;
        if self.lines.len() > KEPT {
            self.lines.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Console, KEPT, LONGEST};

    /// A stop is one at any length, and needs no control.
    #[test]
    fn what_is_kept_is_bounded_however_long_the_lines_are() {
        let mut console = Console::default();
        let long = format!("stop{}", "a\u{1}ä".repeat(10_000));
        (0..2 * KEPT).for_each(|_| console.typed(&long));
        console.hear(long.as_bytes());
        console.hear(b"\n");
        let all = console.from(0);
        assert!(all.iter().all(|line| line.text.starts_with("stopaa") && line.text.len() == LONGEST));
        assert_eq!(all.len(), KEPT);
    }

    #[test]
    fn the_last_lines_are_kept_with_their_numbers() {
        let mut console = Console::default();
        console.typed("status");
        assert!(!console.hear(b"id") && console.hear(b"le\r\nword 0\x07\r\n"));
        let texts: Vec<_> = console.from(1).into_iter().map(|line| (line.number, line.text)).collect();
        assert_eq!(texts, [(1, "idle".to_owned()), (2, "word 0".to_owned())]);
        (0..2 * KEPT).for_each(|_| console.typed("id"));
        assert_eq!((console.count(), console.from(0).len()), (3 + 2 * KEPT as u64, KEPT));
    }
}
