//! The printed target: a calibration board and two single tags, one for the base of the arm and one for its tool.
//!
//! Frames: the board has its origin at the middle of its tags, x to the right, y up, z out of the paper; a single tag the same
//! at its centre. Corners of a tag are in the order −x−y, +x−y, +x+y, −x+y.

use darm_core::real::Vec3;

use crate::family::CELLS;

/// Corners of a tag.
pub const CORNERS: usize = 4;

/// Length of the printed ruler, mm.
pub const RULER_MM: f64 = 100.0;

/// The paper of a target, and what it is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// For an arm on a desk, the camera at 0.3 to 1 m.
    A4,
    /// For an arm on a stand, the camera at 0.6 to 2 m.
    A3,
}

/// A tag by its number and size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tag {
    /// Number in the family 36h11.
    pub id: u16,
    /// Side of the black square, m.
    pub side_m: f64,
}

impl Tag {
    /// Its corners in its frame, m.
    pub fn corners_m(&self) -> [Vec3<f64>; CORNERS] {
        let half = self.side_m / 2.0;
        [[-half, -half], [half, -half], [half, half], [-half, half]].map(|[x, y]| Vec3::new(x, y, 0.0))
    }
}

/// A board of tags with the single tags that are printed next to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    columns: u16,
    rows: u16,
    /// Side of a tag of the board, m.
    tag_side_m: f64,
    /// From a tag of the board to the next, side to side, m.
    gap_m: f64,
    base: Tag,
    tool: Tag,
}

/// Number of the base's tag; the board's are below.
const BASE_ID: u16 = 100;

/// Number of the tool's tag.
const TOOL_ID: u16 = 101;

/// The length of the ruler cannot be what was measured on a print.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "a ruler of {measured_mm} mm was printed as {RULER_MM} mm: expected 50 to 200 mm; measure between its outer lines"
)]
pub struct RulerError {
    /// The length that was given, mm.
    pub measured_mm: f64,
}

impl Target {
    /// The target of a size, printed to scale.
    pub fn new(size: Size) -> Self {
        let (n, tag_side_m, gap_m, base_m, tool_m) = match size {
            Size::A4 => (5, 0.027, 0.009, 0.050, 0.040),
            Size::A3 => (6, 0.035, 0.011, 0.070, 0.056),
        };
        let base = Tag { id: BASE_ID, side_m: base_m };
        Self { columns: n, rows: n, tag_side_m, gap_m, base, tool: Tag { id: TOOL_ID, side_m: tool_m } }
    }

    /// The same target on a print whose ruler measures `measured_mm`.
    ///
    /// # Errors
    ///
    /// The length is not between half and twice of what it should be.
    pub fn with_ruler(self, measured_mm: f64) -> Result<Self, RulerError> {
        let scale = measured_mm / RULER_MM;
        if !(0.5..=2.0).contains(&scale) {
            return Err(RulerError { measured_mm });
        }
        let scaled = |tag: Tag| Tag { side_m: tag.side_m * scale, ..tag };
        let (base, tool) = (scaled(self.base), scaled(self.tool));
        Ok(Self { tag_side_m: self.tag_side_m * scale, gap_m: self.gap_m * scale, base, tool, ..self })
    }

    /// The tag for the base of the arm.
    pub fn base(&self) -> Tag {
        self.base
    }

    /// The tag for the tool.
    pub fn tool(&self) -> Tag {
        self.tool
    }

    /// Number of tags of the board.
    pub fn board_tags(&self) -> usize {
        usize::from(self.columns) * usize::from(self.rows)
    }

    /// Width and height of the board between the outer sides of its tags, m.
    pub fn board_size_m(&self) -> [f64; 2] {
        [self.columns, self.rows].map(|n| f64::from(n) * (self.tag_side_m + self.gap_m) - self.gap_m)
    }

    /// Width of the white margin that a tag needs on each side, m.
    pub fn margin_m(tag: &Tag) -> f64 {
        tag.side_m / CELLS as f64
    }

    /// The tags of the board with their centres in its frame, m: row by row from the upper left.
    pub fn board(&self) -> impl Iterator<Item = (Tag, Vec3<f64>)> {
        let Self { columns, tag_side_m, .. } = *self;
        let pitch = self.tag_side_m + self.gap_m;
        let [width, height] = self.board_size_m();
        (0..columns * self.rows).map(move |id| {
            let (column, row) = (f64::from(id % columns), f64::from(id / columns));
            let x = column * pitch + (tag_side_m - width) / 2.0;
            let y = (height - tag_side_m) / 2.0 - row * pitch;
            (Tag { id, side_m: tag_side_m }, Vec3::new(x, y, 0.0))
        })
    }

    /// The corners of a tag of the board in the frame of the board, m; `None` of another tag.
    pub fn board_corners_m(&self, id: u16) -> Option<[Vec3<f64>; CORNERS]> {
        let (tag, centre) = self.board().nth(usize::from(id))?;
        Some(tag.corners_m().map(|corner| centre + corner))
    }
}

#[cfg(test)]
mod tests {
    use super::{RulerError, Size, Target};

    #[test]
    fn the_board_is_centred_and_its_tags_are_a_gap_apart() {
        let target = Target::new(Size::A4);
        let [width, height] = target.board_size_m();
        assert!((width - 0.171).abs() < 1e-12 && (height - 0.171).abs() < 1e-12);
        assert_eq!((target.board().count(), target.board_tags()), (25, 25));
        let first = target.board_corners_m(0).unwrap();
        let last = target.board_corners_m(24).unwrap();
        assert!((first[3].x + width / 2.0).abs() < 1e-12 && (first[3].y - height / 2.0).abs() < 1e-12);
        assert!((first[3] + last[1]).norm() < 1e-12, "the board is symmetric about its origin");
        let second = target.board_corners_m(1).unwrap();
        assert!((second[0].x - first[1].x - 0.009).abs() < 1e-12);
        assert_eq!(target.board_corners_m(25), None);
    }

    #[test]
    fn a_print_at_another_scale_is_described_by_its_ruler() {
        let target = Target::new(Size::A3).with_ruler(97.0).unwrap();
        assert!((target.base().side_m - 0.07 * 0.97).abs() < 1e-12);
        assert!(matches!(target.with_ruler(f64::NAN), Err(RulerError { .. })));
        assert!(target.with_ruler(10.0).is_err());
    }
}
