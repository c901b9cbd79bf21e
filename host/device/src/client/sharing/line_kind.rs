//! What a typed line does, as far as has to be known before it is sent.

/// First words of lines that change nothing. Source: the board's `help`.
const READING: [&str; 9] = ["help", "id", "status", "limits", "profile", "table", "fault", "log", "nearest"];
/// Longest line.
pub(super) const LONGEST: usize = 200;

/// What a line does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineKind {
    /// It reads: its first word is in a list.
    Reads,
    /// It stops the arm.
    Stops,
    /// It changes something, or nothing is known of it.
    Changes,
}

/// Why a text is no line for a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a line has at most {LONGEST} letters, digits and signs, and nothing else")]
pub struct NoLine;

impl LineKind {
    /// What this line does, without its end.
    ///
    /// # Errors
    ///
    /// It is too long, or has other characters. A backspace would make another line of it on the board than the one that is looked at
    /// here.
    pub fn of(line: &str) -> Result<Self, NoLine> {
        if is_stop(line) {
            return Ok(Self::Stops);
        }
        if line.len() > LONGEST || !line.bytes().all(|byte| matches!(byte, b' '..=b'~' | b'\t')) {
            return Err(NoLine);
        }
        let first = line.split_whitespace().next().unwrap_or_default().to_ascii_lowercase();
        Ok(match first.as_str() {
            first if READING.contains(&first) => Self::Reads,
            _ => Self::Changes,
        })
    }
}

/// Whether a board may take the line for a stop: it hears one behind noise and after corrections. What only looks like one stops the
/// arm too.
fn is_stop(line: &str) -> bool {
    let mut heard = String::new();
    for character in line.chars() {
        match character {
            '\x08' | '\x7f' => drop(heard.pop()),
            letter if letter.is_ascii_alphabetic() => heard.push(letter.to_ascii_lowercase()),
            character if character.is_control() => {}
            other => heard.push(other),
        }
    }
    heard.contains("stop") || line.to_ascii_lowercase().contains("stop")
}

#[cfg(test)]
mod tests {
    use super::{LineKind, NoLine};

    #[test]
    fn what_is_not_known_to_read_changes_something() {
        for (line, kind) in [
            ("status", LineKind::Reads),
            ("  Nearest 100 200 0", LineKind::Reads),
            ("STOP", LineKind::Stops),
            ("stop now", LineKind::Stops),
            ("stopp", LineKind::Stops),
            ("plystop", LineKind::Stops),
            ("sti\x08op", LineKind::Stops),
            ("\u{1}stop", LineKind::Stops),
            ("statuscoil 1 on 5", LineKind::Changes),
            ("coil 1 off", LineKind::Changes),
            ("", LineKind::Changes),
        ] {
            assert_eq!(LineKind::of(line), Ok(kind), "{line:?}");
        }
        let long = "a".repeat(201);
        for text in ["help\x08\x08\x08\x08play", "help\rplay", "hélp", "help\u{0}", &long] {
            assert_eq!(LineKind::of(text), Err(NoLine), "{text:?}");
        }
    }
}
