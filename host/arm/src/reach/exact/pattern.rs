//! Patterns that name some words of an arm.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use darm_core::units::Word;

/// Some words: a digit for each actuator, or `*` for any.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern(Vec<Option<u8>>);

impl Pattern {
    /// Whether the pattern has a digit or a `*` for each digit of `word`, and agrees with it.
    pub fn names(&self, word: &Word) -> bool {
        self.0.len() == word.len()
            && self.0.iter().zip(word.iter()).all(|(wanted, digit)| wanted.is_none_or(|wanted| wanted == digit))
    }

    /// Whether it agrees with these digits of `word`.
    pub(super) fn agrees(&self, word: &Word, digits: Range<usize>) -> bool {
        digits
            .into_iter()
            .all(|at| matches!(self.0.get(at), Some(wanted) if wanted.is_none_or(|d| d == word.digit(at))))
    }

    /// How many digits it has.
    pub fn digits(&self) -> usize {
        self.0.len()
    }
}

/// Why a text is no pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoPattern {
    /// The first character that is neither a digit of a word nor `*`.
    pub character: char,
}

impl FromStr for Pattern {
    type Err = NoPattern;

    /// Reads digits and `*`; commas, blanks and underscores between them are for the eye.
    fn from_str(text: &str) -> Result<Self, NoPattern> {
        let digit = |character: char| match character {
            '*' => Ok(None),
            '0'..='3' => Ok(Some(character as u8 - b'0')),
            _ => Err(NoPattern { character }),
        };
        let characters = text.chars().filter(|character| !matches!(character, ',' | ' ' | '_'));
        characters.map(digit).collect::<Result<_, _>>().map(Self)
    }
}

impl fmt::Display for NoPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} is neither a digit from 0 to 3 nor *", self.character)
    }
}

impl std::error::Error for NoPattern {}
