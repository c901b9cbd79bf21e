//! Reading the cells of a quadrilateral, and finding the tag that has them.

use std::sync::OnceLock;

use darm_core::real::Vec2;

use super::Detection;
use crate::family::{CELLS, DATA, TAGS, data};
use crate::grey::GreyImage;
use crate::homography::{of_unit_square, seen_at};

/// Cells along a tag with its border and margin.
const ALL: usize = CELLS + 2;

/// Cells of the data that may be read wrongly: two tags differ in 11 at least.
const MAX_WRONG: u32 = 2;

/// Cells of the black border and of the white margin that may have the wrong colour.
const MAX_WRONG_BORDER: usize = 2;
const MAX_WRONG_MARGIN: usize = 7;

/// Least difference of white and black at the middle of the tag, grey levels.
const MIN_CONTRAST: f64 = 8.0;

/// By how much a cell is set off against its neighbours before it is read: small cells blur into each other.
const SHARPENING: f64 = 0.25;

/// The grey levels of a colour over the tag: a plane a + b x + c y.
#[derive(Clone, Copy, Debug)]
struct Plane([f64; 3]);

impl Plane {
    /// The plane that fits cells best; `None` of too few.
    fn new(cells: impl Iterator<Item = (usize, f64)>) -> Option<Self> {
        let (mut products, mut right) = (nalgebra::Matrix3::zeros(), nalgebra::Vector3::zeros());
        for (cell, grey) in cells {
            let (x, y) = place(cell);
            let row = nalgebra::Vector3::new(1.0, x, y);
            products += row * row.transpose();
            right += row * grey;
        }
        Some(Self((products.try_inverse()? * right).into()))
    }

    fn at(&self, cell: usize) -> f64 {
        let (Self([a, b, c]), (x, y)) = (self, place(cell));
        a + b * x + c * y
    }
}

/// Column and row of a cell from the middle of the tag.
fn place(cell: usize) -> (f64, f64) {
    let from_middle = |k: usize| k as f64 - (ALL - 1) as f64 / 2.0;
    (from_middle(cell % ALL), from_middle(cell / ALL))
}

/// How far a cell is from the rim: 0 in the margin, 1 in the border, more in the data.
fn depth(cell: usize) -> usize {
    let (column, row) = (cell % ALL, cell / ALL);
    column.min(row).min(ALL - 1 - column).min(ALL - 1 - row)
}

/// The tag in a quadrilateral whose corners are clockwise as they are seen.
pub(super) fn decode(image: &GreyImage, clockwise: &[Vec2<f64>; 4]) -> Option<Detection> {
    let cells = read(image, clockwise)?;
    let with_depth = |wanted: usize| (0..ALL * ALL).filter(move |cell| depth(*cell) == wanted);
    // A margin partly outside of the picture is as good as one that is there.
    let plane = |wanted| Plane::new(with_depth(wanted).filter_map(|cell| Some((cell, cells[cell]?))));
    let (white, black) = (plane(0)?, plane(1)?);
    if white.0[0] - black.0[0] < MIN_CONTRAST {
        return None;
    }
    let above = |cell: usize| cells[cell].map(|grey| grey - (white.at(cell) + black.at(cell)) / 2.0);
    let wrong_border = with_depth(1).filter(|cell| above(*cell).is_none_or(|above| above > 0.0)).count();
    let wrong_margin = with_depth(0).filter(|cell| above(*cell).is_some_and(|above| above < 0.0)).count();
    if wrong_border > MAX_WRONG_BORDER || wrong_margin > MAX_WRONG_MARGIN {
        return None;
    }
    let mut seen = 0;
    for cell in (0..ALL * ALL).filter(|cell| depth(*cell) > 1) {
        let near = [cell - 1, cell + 1, cell - ALL, cell + ALL].map(|near| above(near).unwrap_or(0.0));
        let own = above(cell)?;
        let sharp = own + SHARPENING * (4.0 * own - near.iter().sum::<f64>());
        seen = seen << 1 | u64::from(sharp > 0.0);
    }
    let (id, turns, wrong_cells) = nearest(seen).filter(|(.., wrong)| *wrong <= MAX_WRONG)?;
    // Clockwise from the upper left as the tag is printed, then in the order of the target.
    let printed = |k: usize| clockwise[(k + 4 - turns) % 4];
    Some(Detection { id, corners: [printed(3), printed(2), printed(1), printed(0)], wrong_cells })
}

/// The grey levels at the middles of all cells, row by row from the first corner; `None` outside of the picture.
fn read(image: &GreyImage, clockwise: &[Vec2<f64>; 4]) -> Option<[Option<f64>; ALL * ALL]> {
    let shown = of_unit_square(clockwise);
    if !shown.iter().all(|number| number.is_finite()) {
        return None;
    }
    let mut cells = [None; ALL * ALL];
    for (cell, grey) in cells.iter_mut().enumerate() {
        let (column, row) = place(cell);
        let (x, y) = (0.5 + column / CELLS as f64, 0.5 + row / CELLS as f64);
        *grey = interpolate(image, &seen_at(&shown, &Vec2::new(x, y)));
    }
    Some(cells)
}

/// The grey level between four pixels.
fn interpolate(image: &GreyImage, at: &Vec2<f64>) -> Option<f64> {
    if !(at.x >= 0.0 && at.y >= 0.0) {
        return None;
    }
    let (column, row) = (at.x as usize, at.y as usize);
    let grey = |right: usize, down: usize| image.get(column + right, row + down).map(f64::from);
    let (x, y) = (at.x - column as f64, at.y - row as f64);
    let upper = grey(0, 0)? * (1.0 - x) + grey(1, 0)? * x;
    let lower = grey(0, 1)? * (1.0 - x) + grey(1, 1)? * x;
    Some(upper * (1.0 - y) + lower * y)
}

/// The tag that differs least from data, by how many quarter turns it is turned anticlockwise, and in how many cells it differs.
fn nearest(seen: u64) -> Option<(u16, usize, u32)> {
    static TURNED: OnceLock<Vec<[u64; 4]>> = OnceLock::new();
    let turned = TURNED.get_or_init(|| (0..TAGS).filter_map(data).map(all_turns).collect());
    let each = (0..).zip(turned).flat_map(|(id, turns)| (0..).zip(turns).map(move |(turn, data)| (id, turn, data)));
    each.map(|(id, turn, data)| (id, turn, (data ^ seen).count_ones())).min_by_key(|(.., wrong)| *wrong)
}

/// Data as they are, and after one, two and three quarter turns anticlockwise.
fn all_turns(data: u64) -> [u64; 4] {
    let turn = |data: u64| {
        let bit = |row: usize, column: usize| (data >> (DATA * DATA - 1 - row * DATA - column)) & 1;
        // What was the right column is the upper row.
        (0..DATA * DATA).fold(0, |turned, k| turned << 1 | bit(k % DATA, DATA - 1 - k / DATA))
    };
    let once = turn(data);
    let twice = turn(once);
    [data, once, twice, turn(twice)]
}

#[cfg(test)]
mod tests {
    use super::{all_turns, nearest};
    use crate::family::data;

    #[test]
    fn a_turned_tag_with_two_wrong_cells_is_found() {
        for (turns, seen) in all_turns(data(37).unwrap()).into_iter().enumerate() {
            assert_eq!(nearest(seen ^ 0b1_0000_0100), Some((37, turns, 2)));
        }
    }
}
