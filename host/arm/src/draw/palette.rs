//! The colours of all pictures, charts and pages.

use std::fmt;

/// A colour: red, green and blue. It is displayed as in CSS: `#1f6f8b`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Color(pub u8, pub u8, pub u8);

/// Text, and what is rigid.
pub const INK: Color = Color(0x33, 0x3d, 0x45);
/// Text and lines of less weight, and axes.
pub const MUTED: Color = Color(0x64, 0x71, 0x7b);
/// Large areas and thin lines behind others.
pub const PALE: Color = Color(0xc3, 0xcc, 0xd2);
/// Grids and frames.
pub const GRID: Color = Color(0xe7, 0xeb, 0xee);
/// The background of a page around its sections.
pub const GROUND: Color = Color(0xf6, 0xf8, 0xf9);
/// The background of a picture.
pub const PAPER: Color = Color(0xff, 0xff, 0xff);
/// Errors before a correction; joints that turn.
pub const ORANGE: Color = Color(0xd1, 0x5b, 0x2c);
/// Errors after a correction; joints that slide.
pub const BLUE: Color = Color(0x1f, 0x6f, 0x8b);
/// Goals met; the axis y of a frame.
pub const GREEN: Color = Color(0x2e, 0x8b, 0x57);
/// Goals missed; the axis x of a frame; contacts.
pub const RED: Color = Color(0xc0, 0x39, 0x2b);
/// The axis z of a frame.
pub const AZURE: Color = Color(0x2d, 0x5f, 0xbf);
/// A paler blue, for a comparison with [`AZURE`].
pub const SKY: Color = Color(0x5f, 0xb0, 0xd6);
/// A series among others.
pub const PURPLE: Color = Color(0x8e, 0x44, 0xad);
/// A series among others.
pub const OCHRE: Color = Color(0xb8, 0x86, 0x0b);
/// Series in their order; they repeat from the start where there are more.
pub const SERIES: [Color; 8] = [ORANGE, BLUE, GREEN, PURPLE, MUTED, OCHRE, RED, SKY];
/// Ends of the scale of a density: low and high.
pub const DENSITY: [Color; 2] = [Color(222, 235, 247), Color(8, 48, 107)];

impl Color {
    /// The colour between this one (`share` 0) and another (`share` 1).
    pub fn mix(self, other: Self, share: f64) -> Self {
        let between = |from: u8, to: u8| (f64::from(from) + share * (f64::from(to) - f64::from(from))) as u8;
        Self(between(self.0, other.0), between(self.1, other.1), between(self.2, other.2))
    }
}

impl fmt::Display for Color {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }
}
