//! A view of the calibration board: the tags of the board that an image shows, with their corners.

use darm_core::real::{Vec2, Vec3};

use crate::detect::detect;
use crate::edges::{Corners, refine};
use crate::grey::GreyImage;
use crate::lens::Lens;
use crate::target::{CORNERS, Target};

/// Tags without which a view determines little.
const MIN_TAGS: usize = 4;

/// Blur above which a view is not used, px: that of a camera which is out of focus or moves.
pub const MAX_BLUR_PX: f64 = 2.0;

/// A tag of the board with its corners in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardTag {
    /// Its number.
    pub id: u16,
    /// Its corners in the frame of the board, m.
    pub corners_m: [Vec3<f64>; CORNERS],
    /// The same in the image.
    pub corners: Corners,
}

/// The board in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Tags with all corners in the image, at least four.
    pub tags: Vec<BoardTag>,
    /// Median of the tags' blur, px.
    pub blur_px: f64,
}

/// Why an image is no view of the board.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// Too few tags of the board.
    #[error(
        "shows {found} tags of the board completely, expected at least {MIN_TAGS}; show more of it, larger, in more light"
    )]
    FewTags {
        /// Tags of the board that could be measured.
        found: usize,
    },
    /// Only the mirror image shows tags.
    #[error("is mirrored: switch mirroring off in the camera's settings")]
    Mirrored,
    /// The camera moved or is not in focus.
    #[error("is blurred by {blur_px:.1} px, at most {MAX_BLUR_PX} px; hold still, focus, or add light")]
    Blurred {
        /// Median of the tags.
        blur_px: f64,
    },
}

impl View {
    /// Finds the board in an image; with a lens, edges are fitted as if it had no distortion.
    ///
    /// # Errors
    ///
    /// The image shows too little of the board, or is blurred or mirrored.
    pub fn find(image: &GreyImage, target: &Target, lens: Option<&Lens>) -> Result<Self, ViewError> {
        let detections = detect(image);
        let measured = detections.iter().filter_map(|found| {
            let corners_m = target.board_corners_m(found.id)?;
            Some(BoardTag { id: found.id, corners_m, corners: refine(image, found.id, &found.corners, lens).ok()? })
        });
        let tags: Vec<BoardTag> = measured.collect();
        if tags.len() < MIN_TAGS {
            let is_mirrored = detections.is_empty() && detect(&image.mirrored()).len() >= MIN_TAGS;
            return Err(if is_mirrored { ViewError::Mirrored } else { ViewError::FewTags { found: tags.len() } });
        }
        let mut blurs: Vec<f64> = tags.iter().map(|tag| tag.corners.blur_px).collect();
        blurs.sort_by(f64::total_cmp);
        let blur_px = blurs[blurs.len() / 2];
        if blur_px > MAX_BLUR_PX {
            return Err(ViewError::Blurred { blur_px });
        }
        Ok(Self { tags, blur_px })
    }

    /// The same view with its corners fitted again, as if the lens had no distortion; a tag whose fit fails is left out.
    #[must_use]
    pub fn refined(&self, image: &GreyImage, lens: &Lens) -> Self {
        let refined = |tag: &BoardTag| {
            let corners = refine(image, tag.id, &tag.corners.pixels, Some(lens)).ok()?;
            Some(BoardTag { corners, ..tag.clone() })
        };
        Self { tags: self.tags.iter().filter_map(refined).collect(), blur_px: self.blur_px }
    }

    /// Pairs of a point of the board and where it is seen, m and px.
    pub fn pairs(&self) -> impl Iterator<Item = (Vec2<f64>, Vec2<f64>)> {
        self.tags.iter().flat_map(|tag| tag.corners_m.iter().zip(&tag.corners.pixels)).map(|(m, px)| (m.xy(), *px))
    }
}
