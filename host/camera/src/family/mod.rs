//! The tag family AprilTag 36h11: which cells of a tag are white.
//!
//! A tag has 6 x 6 cells of data within a black border one cell wide, and needs a white margin of one cell around it. Any two
//! of the 587 tags differ in at least 11 cells, in each of the four orientations.
//!
//! Source: E. Olson, ICRA 2011, 3400; J. Wang, E. Olson, IROS 2016, 4193.

mod codes;

use codes::CODES;

/// Cells along a tag with its border, without the margin.
pub const CELLS: usize = 8;

/// Cells along the data of a tag.
pub const DATA: usize = 6;

/// Number of tags.
pub const TAGS: u16 = CODES.len() as u16;

/// Column and row of the bits of a code in the first quarter of a tag, the highest bit first. The other three quarters have the
/// same places, turned by 90° clockwise from quarter to quarter.
const QUARTER: [(usize, usize); 9] = [(0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (1, 1), (2, 1), (3, 1), (2, 2)];

/// The data of a tag, row by row from the top: the first cell is bit 35. `None` of an id that does not exist.
pub fn data(id: u16) -> Option<u64> {
    let code = CODES.get(usize::from(id))?;
    let mut data = 0;
    for bit in 0..DATA * DATA {
        let (mut column, mut row) = QUARTER[bit % QUARTER.len()];
        for _ in 0..bit / QUARTER.len() {
            (column, row) = (DATA - 1 - row, column);
        }
        data |= ((code >> (DATA * DATA - 1 - bit)) & 1) << (DATA * DATA - 1 - row * DATA - column);
    }
    Some(data)
}

/// White or black of each cell of a tag, row by row from the top, with the border; `None` of an id that does not exist.
pub fn cells(id: u16) -> Option<[[bool; CELLS]; CELLS]> {
    let data = data(id)?;
    let mut cells = [[false; CELLS]; CELLS];
    for cell in 0..DATA * DATA {
        cells[1 + cell / DATA][1 + cell % DATA] = (data >> (DATA * DATA - 1 - cell)) & 1 == 1;
    }
    Some(cells)
}

#[cfg(test)]
mod tests {
    use super::{CELLS, TAGS, cells};

    #[test]
    fn every_tag_has_a_black_border_and_differs_from_the_others() {
        let all: Vec<_> = (0..TAGS).map(|id| cells(id).unwrap()).collect();
        assert!(all.iter().all(|tag| (0..CELLS).all(|k| !(tag[0][k] || tag[7][k] || tag[k][0] || tag[k][7]))));
        let distance = |a: usize, b: usize| (0..64).filter(|k| all[a][k / 8][k % 8] != all[b][k / 8][k % 8]).count();
        assert!((1..all.len()).all(|id| distance(0, id) >= 11));
        assert_eq!(cells(TAGS), None);
    }

    /// pupil-apriltags 1.0.4 and OpenCV 5.0 read this picture as tag 0, upright.
    #[test]
    fn tag_0_is_as_it_is_printed() {
        let drawn: Vec<String> = cells(0).unwrap()[1..7]
            .iter()
            .map(|row| row[1..7].iter().map(|white| if *white { '#' } else { '.' }).collect())
            .collect();
        assert_eq!(drawn, ["##.#.#", ".###.#", ".##...", "#.#...", ".#.##.", "...#.."].map(str::to_owned));
    }
}
