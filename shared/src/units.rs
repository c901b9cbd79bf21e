//! What travels between host and board or is easily swapped: time, actuator numbers, words, identities.
#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::arithmetic_side_effects, clippy::unwrap_used))]

use core::fmt;
use core::ops::{Add, Sub};
use core::str::FromStr;

use serde::{Deserialize, Serialize};

/// A moment or a span on the board's own clock, in microseconds. The core reads no clock: time comes in as an argument.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Micros(pub u64);

impl Micros {
    /// A span of integer milliseconds.
    pub const fn from_millis(millis: u32) -> Self {
        Self((millis as u64).saturating_mul(1000))
    }
}

impl Add for Micros {
    type Output = Self;
    fn add(self, span: Self) -> Self {
        Self(self.0.saturating_add(span.0))
    }
}

/// Saturates at zero: a span is never negative.
impl Sub for Micros {
    type Output = Self;
    fn sub(self, earlier: Self) -> Self {
        Self(self.0.saturating_sub(earlier.0))
    }
}

impl fmt::Display for Micros {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:03} s", self.0 / 1_000_000, self.0 / 1000 % 1000)
    }
}

/// Number of a discrete actuator, counted along the chain from the base; it is also the index of its digit in a [`Word`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct ActuatorId(pub u8);

/// Fingerprint of the model that a table or a calibration was made for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelHash(pub u64);

impl fmt::Display for ModelHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

/// The chip's 96-bit unique number: the serial number of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceId(pub [u8; 12]);

impl fmt::Display for DeviceId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// SHA-256 of a table's or profile's bytes: what binds program, model, profile and recording together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Digest(pub [u8; 32]);

impl Digest {
    /// Its first eight bytes.
    pub const fn short(&self) -> ShortDigest {
        let [a, b, c, d, e, f, g, h, ..] = self.0;
        ShortDigest(u64::from_be_bytes([a, b, c, d, e, f, g, h]))
    }
}

/// The first eight bytes of a [`Digest`], enough to distinguish two at a glance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShortDigest(pub u64);

impl fmt::Display for ShortDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// The digits of all discrete actuators: digit `i` is the state of actuator `i`, 0 (contracted) to 3.
///
/// Two bits a digit, digit 0 in the lowest bits, so a word is copied and compared as one number.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "WordBytes")]
pub struct Word {
    len: u8,
    bits: u128,
}

/// A word as it travels, before anybody has looked at it.
#[derive(Deserialize)]
struct WordBytes {
    len: u8,
    bits: u128,
}

impl TryFrom<WordBytes> for Word {
    type Error = WordError;
    fn try_from(WordBytes { len, bits }: WordBytes) -> Result<Self, WordError> {
        let longest = Self::zeros(len).ok_or(WordError::TooLong { len: len.into() })?;
        let beyond = bits.checked_shr(u32::from(len).saturating_mul(2)).unwrap_or(0);
        if beyond == 0 { Ok(Self { bits, ..longest }) } else { Err(WordError::Digit { at: len.into() }) }
    }
}

/// Why digits do not make a [`Word`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WordError {
    /// More digits than [`Word::MAX_LEN`].
    TooLong {
        /// How many digits were given.
        len: usize,
    },
    /// A digit above [`Word::MAX_DIGIT`], or a character that is no digit.
    Digit {
        /// Index of the digit.
        at: usize,
    },
}

impl fmt::Display for WordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooLong { len } => {
                write!(f, "a word has at most {} digits, not {len}", Word::MAX_LEN)
            }
            Self::Digit { at } => {
                write!(f, "digit {} of the word is not one of 0 to {}", at.saturating_add(1), Word::MAX_DIGIT)
            }
        }
    }
}

impl core::error::Error for WordError {}

impl Word {
    /// Most digits that a word can hold.
    pub const MAX_LEN: usize = 64;
    /// Largest digit: actuators have up to four states.
    pub const MAX_DIGIT: u8 = 3;
    const STATES: u32 = Self::MAX_DIGIT as u32 + 1;

    /// The word with these digits, base first.
    ///
    /// # Errors
    ///
    /// [`WordError::TooLong`]: there are more than [`MAX_LEN`](Self::MAX_LEN) digits. [`WordError::Digit`]: a digit is
    /// above [`MAX_DIGIT`](Self::MAX_DIGIT).
    pub fn new(digits: &[u8]) -> Result<Self, WordError> {
        let mut word = Self::zeros(u8::try_from(digits.len()).unwrap_or(u8::MAX))
            .ok_or(WordError::TooLong { len: digits.len() })?;
        for (at, &digit) in digits.iter().enumerate() {
            if digit > Self::MAX_DIGIT {
                return Err(WordError::Digit { at });
            }
            word = word.with_digit(at, digit);
        }
        Ok(word)
    }

    /// The word of `len` zeros, every actuator contracted; `None` if it would be too long.
    pub const fn zeros(len: u8) -> Option<Self> {
        if len as usize > Self::MAX_LEN { None } else { Some(Self { len, bits: 0 }) }
    }

    /// Number of digits.
    pub const fn len(&self) -> usize {
        self.len as usize
    }

    /// True of the word without digits.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Digit of actuator `index`; 0 beyond the end.
    ///
    /// Four digits a byte: a shift of all 128 bits would cost the chip a hundred instructions.
    pub fn digit(&self, index: usize) -> u8 {
        let four = self.bits.to_le_bytes().get(index / 4).map_or(0, |four| *four);
        if index < self.len() { four >> (index % 4).wrapping_mul(2) & Self::MAX_DIGIT } else { 0 }
    }

    /// The same word with one digit changed; unchanged where index or digit do not exist.
    #[must_use]
    pub const fn with_digit(mut self, index: usize, digit: u8) -> Self {
        if index < self.len as usize && digit <= Self::MAX_DIGIT {
            let place = index.wrapping_mul(2);
            self.bits &= !((Self::MAX_DIGIT as u128) << place);
            self.bits |= (digit as u128) << place;
        }
        self
    }

    /// The digits, base first.
    pub fn iter(&self) -> impl Iterator<Item = u8> + use<> {
        let word = *self;
        (0..word.len()).map(move |index| word.digit(index))
    }

    /// The digits that differ from those of another word: bit `i` for digit `i`. Digits beyond an end are 0.
    pub const fn differing(&self, other: &Self) -> u64 {
        self.flips(other).digits_set()
    }

    /// The bits in which the digits differ from those of another word. Digits beyond an end are 0.
    #[must_use]
    pub const fn flips(&self, other: &Self) -> Self {
        let len = if self.len > other.len { self.len } else { other.len };
        Self { len, bits: self.bits ^ other.bits }
    }

    /// The digits that are not 0: bit `i` for digit `i`.
    const fn digits_set(&self) -> u64 {
        every_second(self.bits | self.bits >> 1)
    }

    /// The lower bit of every digit, and the higher one: bit `i` for digit `i`.
    pub(crate) const fn bits_of_digits(&self) -> [u64; 2] {
        [every_second(self.bits), every_second(self.bits >> 1)]
    }
}

/// Bits 0, 2, 4, …
///
/// Sixteen at a time: the chip has 32 bits.
const fn every_second(bits: u128) -> u64 {
    let (low, high) = (bits as u64, (bits >> 64) as u64);
    every_second_of_32(low as u32) as u64
        | (every_second_of_32((low >> 32) as u32) as u64) << 16
        | (every_second_of_32(high as u32) as u64) << 32
        | (every_second_of_32((high >> 32) as u32) as u64) << 48
}

const fn every_second_of_32(bits: u32) -> u32 {
    let mut bits = bits & 0x5555_5555;
    bits = (bits | bits >> 1) & 0x3333_3333;
    bits = (bits | bits >> 2) & 0x0f0f_0f0f;
    bits = (bits | bits >> 4) & 0x00ff_00ff;
    (bits | bits >> 8) & 0xffff
}

impl fmt::Display for Word {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.iter().try_for_each(|digit| write!(f, "{digit}"))
    }
}

impl fmt::Debug for Word {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Word({self})")
    }
}

/// Reads digits; commas, blanks and underscores between them are for the eye.
impl FromStr for Word {
    type Err = WordError;
    fn from_str(text: &str) -> Result<Self, WordError> {
        let mut digits = heapless::Vec::<u8, { Self::MAX_LEN }>::new();
        for character in text.chars().filter(|c| !matches!(c, ',' | ' ' | '_')) {
            let digit = character.to_digit(Self::STATES).ok_or(WordError::Digit { at: digits.len() })?;
            digits.push(digit as u8).map_err(|_| WordError::TooLong { len: text.len() })?;
        }
        Self::new(&digits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::string::ToString;

    #[test]
    fn text_and_digits_are_inverse() {
        let word: Word = "000,101,320,001".parse().unwrap();
        assert_eq!(word.to_string(), "000101320001");
        assert_eq!(Word::new(&word.iter().collect::<std::vec::Vec<_>>()), Ok(word));
        assert_eq!(word.digit(6), 3);
    }

    #[test]
    fn a_changed_digit_changes_only_itself() {
        let word: Word = "0123".parse().unwrap();
        assert_eq!(word.with_digit(2, 1).to_string(), "0113");
        assert_eq!(word.with_digit(4, 1), word);
        assert_eq!(word.with_digit(0, 4), word);
    }

    #[test]
    fn differing_digits_are_those_that_change() {
        let rest = Word::zeros(64).unwrap();
        for index in 0..64 {
            for digit in 1..=Word::MAX_DIGIT {
                assert_eq!(rest.with_digit(index, digit).differing(&rest), 1 << index);
            }
        }
        assert_eq!(rest.differing(&rest), 0);
    }

    #[test]
    fn bad_text_is_told_by_place() {
        assert_eq!("014".parse::<Word>(), Err(WordError::Digit { at: 2 }));
        assert_eq!(Word::new(&[0; 65]), Err(WordError::TooLong { len: 65 }));
    }

    #[test]
    fn longest_word_keeps_every_digit() {
        let word = Word::new(&[3; 64]).unwrap();
        assert!(word.iter().all(|digit| digit == 3));
    }

    #[test]
    fn a_word_from_the_wire_is_valid_or_refused() {
        // 48 digits announced, then bits of digit 63; 65 digits; a word as it is sent.
        let mut bytes = [0; 24];
        let sent = postcard::to_slice(&(48u8, 3u128 << 126), &mut bytes).unwrap();
        assert!(postcard::from_bytes::<Word>(sent).is_err());
        let mut bytes = [0; 24];
        assert!(postcard::from_bytes::<Word>(postcard::to_slice(&(65u8, 0u128), &mut bytes).unwrap()).is_err());
        let word: Word = "0123".parse().unwrap();
        assert_eq!(postcard::from_bytes(postcard::to_slice(&word, &mut bytes).unwrap()), Ok(word));
    }
}
