//! Finding tags in an image, with corners to about a pixel; [`crate::edges`] refines them.
//!
//! The steps are those of the AprilTag library, up to the quadrilaterals in full resolution, where small tags are found, and in
//! half of it, where noise and blur are less:
//!
//! 1. `binary`: black and white by a threshold from the neighbourhood;
//! 2. `borders`: connected pixels of one colour, and the points between a black and a white region;
//! 3. `quad`: regions whose border is four straight lines, black inside;
//! 4. `decode`: the cells are read in full resolution, and compared with the codes of the family.
//!
//! Unlike there, the black border and the white margin must be there, cell by cell: random pictures then give no false tags.
//!
//! Source: J. Wang, E. Olson, "AprilTag 2: efficient and robust fiducial detection", IROS 2016, 4193.

mod binary;
mod borders;
mod decode;
mod quad;

use darm_core::real::Vec2;

use crate::grey::GreyImage;
use crate::target::CORNERS;

/// Smallest side of an image that is searched, px: the smallest tag with its margin.
const MIN_SIDE: usize = 16;

/// A tag that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Detection {
    /// Number in the family 36h11.
    pub id: u16,
    /// Its corners, px, in the order of [`crate::target`].
    pub corners: [Vec2<f64>; CORNERS],
    /// Number of cells that were read wrongly and corrected.
    pub wrong_cells: u32,
}

/// The tags in an image, by number and place.
pub fn detect(image: &GreyImage) -> Vec<Detection> {
    if image.width().min(image.height()) < MIN_SIDE {
        return Vec::new();
    }
    let mut found: Vec<Detection> = Vec::new();
    for level in [binary::Level::full(image), binary::Level::half(image)] {
        for border in borders::borders(&level.colours()) {
            let Some(corners) = quad::corners(&level, &border) else { continue };
            let Some(detection) = decode::decode(image, &corners) else { continue };
            match found.iter_mut().find(|other| overlap(other, &detection)) {
                // A tag of the other level, or the border of a frame around a tag.
                Some(other) if detection.wrong_cells < other.wrong_cells => *other = detection,
                Some(_) => {}
                None => found.push(detection),
            }
        }
    }
    found.sort_by(|a, b| a.id.cmp(&b.id).then(a.corners[0].x.total_cmp(&b.corners[0].x)));
    found
}

/// Whether two detections are one tag: of one number, with the centre of one well inside of the other.
fn overlap(first: &Detection, second: &Detection) -> bool {
    let centre = |detection: &Detection| detection.corners.iter().sum::<Vec2<f64>>() / CORNERS as f64;
    let side = (first.corners[1] - first.corners[0]).norm().max((first.corners[2] - first.corners[1]).norm());
    first.id == second.id && (centre(first) - centre(second)).norm() < side / 2.0
}
