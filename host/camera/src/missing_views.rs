//! Which views a calibration still needs: places in the picture where the board was not seen, and tilts that it did not have.

use std::fmt;

use darm_core::real::{Vec2, Vec3};
use darm_core::se::Pose;

/// Views that a calibration needs.
pub const MIN_VIEWS: usize = 15;

/// The picture is cut into 3 x 3 zones, each of which must have shown this number of the board's corners.
const ZONES: usize = 3;
const MIN_CORNERS: usize = 8;

/// Tilt of the board against the picture to each side, that one view at least should have.
const TILT_DEG: f64 = 15.0;

/// Two views at least must differ in the direction of the board by this angle: with one direction, a longer focal length and a
/// larger distance cannot be distinguished.
const MIN_SPREAD_DEG: f64 = 15.0;

/// A side of the board or of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The left side.
    Left,
    /// The right side.
    Right,
    /// The upper side.
    Upper,
    /// The lower side.
    Lower,
}

/// A kind of view that is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// Any views.
    Views {
        /// How many more.
        count: usize,
    },
    /// The board in a part of the picture.
    Zone {
        /// 0 left, 1 middle, 2 right.
        column: usize,
        /// 0 top, 1 middle, 2 bottom.
        row: usize,
    },
    /// The board with a side of it turned to the camera.
    Tilt {
        /// The side that is nearer.
        nearer: Side,
    },
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Views { count: 1 } => write!(f, "one more view"),
            Self::Views { count } => write!(f, "{count} more views"),
            Self::Zone { column, row } => {
                let (row, column) =
                    (["upper", "middle", "lower"][row % ZONES], ["left", "centre", "right"][column % ZONES]);
                write!(f, "the board in the {row} {column} of the picture")
            }
            Self::Tilt { nearer } => {
                let side = match nearer {
                    Side::Left => "left",
                    Side::Right => "right",
                    Side::Upper => "upper",
                    Side::Lower => "lower",
                };
                write!(
                    f,
                    "the board with its side at the {side} of the picture nearer to the camera, tilted by 20 to 45°"
                )
            }
        }
    }
}

/// What of the picture views have covered.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    corners: [[usize; ZONES]; ZONES],
}

impl Coverage {
    /// Counts a corner, at a pixel of a picture of this width and height.
    pub fn add(&mut self, pixel: &Vec2<f64>, width: usize, height: usize) {
        let zone = |at: f64, length: usize| ((at / length as f64 * ZONES as f64).max(0.0) as usize).min(ZONES - 1);
        self.corners[zone(pixel.y, height)][zone(pixel.x, width)] += 1;
    }

    /// The zones without enough corners.
    pub fn missing(&self) -> Vec<Missing> {
        let zones = (0..ZONES * ZONES).map(|k| (k / ZONES, k % ZONES));
        let empty = zones.filter(|(row, column)| self.corners[*row][*column] < MIN_CORNERS);
        empty.map(|(row, column)| Missing::Zone { column, row }).collect()
    }
}

/// The direction that the board faces, in the camera.
fn facing(pose: &Pose<f64>) -> Vec3<f64> {
    pose.rotation.column(2).into_owned()
}

/// The tilts that no view has.
pub fn missing_tilts(poses: &[Pose<f64>]) -> Vec<Missing> {
    let enough = TILT_DEG.to_radians().sin();
    // A board whose left side is nearer faces to the right, towards positive x; y points down.
    let sides = [(Side::Left, 0, 1.0), (Side::Right, 0, -1.0), (Side::Upper, 1, 1.0), (Side::Lower, 1, -1.0)];
    let is_missing =
        |(_, axis, sign): &(Side, usize, f64)| !poses.iter().any(|pose| sign * facing(pose)[*axis] >= enough);
    sides.into_iter().filter(is_missing).map(|(nearer, ..)| Missing::Tilt { nearer }).collect()
}

/// The largest angle between the directions of the board in two views, rad.
pub fn spread_rad(poses: &[Pose<f64>]) -> f64 {
    let angle = |a: &Pose<f64>, b: &Pose<f64>| facing(a).angle(&facing(b));
    poses.iter().flat_map(|a| poses.iter().map(move |b| angle(a, b))).fold(0.0, f64::max)
}

/// Whether views are too much alike in the direction of the board to determine a focal length.
pub fn is_one_tilt(poses: &[Pose<f64>]) -> bool {
    spread_rad(poses) < MIN_SPREAD_DEG.to_radians()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use darm_core::real::{Vec2, Vec3};
    use darm_core::se::Pose;

    use super::{Coverage, Missing, Side, is_one_tilt, missing_tilts};

    /// The board facing the camera, then turned about the vertical axis of the picture so that its left side comes nearer.
    fn left_nearer(angle_rad: f64) -> Pose<f64> {
        let facing = Pose::new(&Vec3::new(PI, 0.0, 0.0), Vec3::new(0.0, 0.0, 0.5));
        Pose {
            rotation: Pose::new(&Vec3::new(0.0, -angle_rad, 0.0), Vec3::zeros()).rotation * facing.rotation,
            ..facing
        }
    }

    #[test]
    fn a_side_that_comes_nearer_is_named_as_it_is_seen() {
        let pose = left_nearer(0.5);
        let left_side = pose.rotation * Vec3::new(-0.1, 0.0, 0.0);
        assert!(left_side.z < 0.0 && left_side.x < 0.0, "nearer, and at the left of the picture");
        let missing = missing_tilts(&[pose]);
        assert_eq!(missing.len(), 3);
        assert!(!missing.contains(&Missing::Tilt { nearer: Side::Left }));
    }

    #[test]
    fn views_of_one_tilt_are_recognised() {
        assert!(is_one_tilt(&[left_nearer(0.5), left_nearer(0.6)]));
        assert!(!is_one_tilt(&[left_nearer(0.5), left_nearer(-0.3)]));
    }

    #[test]
    fn a_zone_is_covered_by_corners_in_it() {
        let mut coverage = Coverage::default();
        for _ in 0..8 {
            coverage.add(&Vec2::new(1270.0, -0.4), 1280, 720);
        }
        let missing = coverage.missing();
        assert_eq!(missing.len(), 8);
        assert!(!missing.contains(&Missing::Zone { column: 2, row: 0 }));
    }
}
