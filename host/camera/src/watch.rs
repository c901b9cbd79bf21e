//! Watching an arm: the pose of the tool's tag in the base's tag, with its covariance, picture by picture; or why a picture is
//! no measurement.
//!
//! The covariance holds what differs from picture to picture. What the calibration leaves of the lens is the same in all of
//! them, and is not in it.

use std::fmt;

use crate::camera::Camera;
use crate::detect::{Detection, detect};
use crate::edges::{Corners, EdgeError, refine};
use crate::grey::GreyImage;
use crate::tag_pose::{Solution, TagPose, tag_pose};
use crate::target::Tag;
use crate::uncertain_pose::UncertainPose;

/// Blur by which a picture may exceed those of the calibration: beyond it the camera has lost its focus, or the tag moves.
const BLUR_FACTOR: f64 = 2.0;

/// Blur that is always allowed, px.
const ALLOWED_BLUR_PX: f64 = 1.0;

/// χ² of two degrees of freedom that normal errors exceed once in a million pictures: the tag is bent, or the lens another.
const MISFIT: f64 = 27.6;

/// Difference of a measured from a known distance that is put down to the print, as a part of it, and in standard deviations.
const SCALE_TOLERANCE: f64 = 0.01;
const SCALE_DEVIATIONS: f64 = 4.0;

/// Why a picture is no measurement.
#[derive(Clone, Debug, PartialEq)]
pub enum Flag {
    /// A tag is not seen.
    Missing {
        /// Its number.
        id: u16,
    },
    /// A tag is seen more than once.
    Repeated {
        /// Its number.
        id: u16,
    },
    /// A tag is seen, and its edges cannot be measured.
    Edge {
        /// Its number.
        id: u16,
        /// Why.
        error: EdgeError,
    },
    /// A tag is blurred.
    Blurred {
        /// Its number.
        id: u16,
        /// By how much, px.
        blur_px: f64,
        /// Largest blur that is measured, px.
        allowed_px: f64,
    },
    /// The corners of a tag are not those of a flat square.
    Misfit {
        /// Its number.
        id: u16,
        /// χ² of two degrees of freedom.
        chi_squared: f64,
    },
    /// Two poses of a tag fit.
    Ambiguous {
        /// Its number.
        id: u16,
    },
    /// Only the mirror image shows the tags.
    Mirrored,
    /// The tags are not as far apart as they are known to be.
    WrongSize {
        /// By what the sizes of the tags have to be multiplied.
        scale: f64,
        /// Standard deviation of it.
        deviation: f64,
    },
}

impl fmt::Display for Flag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing { id } => write!(f, "tag {id} is not seen"),
            Self::Repeated { id } => write!(f, "tag {id} is seen more than once; remove the other print"),
            Self::Edge { id, error } => write!(f, "tag {id}: {error}"),
            Self::Blurred { id, blur_px, allowed_px } => {
                write!(
                    f,
                    "tag {id} is blurred by {blur_px:.1} px, at most {allowed_px:.1} px; it moves, or the focus changed"
                )
            }
            Self::Misfit { id, chi_squared } => {
                write!(
                    f,
                    "tag {id} does not look flat and square (χ² {chi_squared:.0}); is it bent, or the lens another?"
                )
            }
            Self::Ambiguous { id } => {
                write!(f, "two poses of tag {id} fit; tilt it against the camera, or come nearer")
            }
            Self::Mirrored => write!(f, "the picture is mirrored; switch mirroring off in the camera's settings"),
            Self::WrongSize { scale, deviation } => {
                write!(
                    f,
                    "the tags are {scale:.3} ± {deviation:.3} of their size; give the printed ruler with --ruler-mm"
                )
            }
        }
    }
}

/// A tag in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenTag {
    /// The tag.
    pub tag: Tag,
    /// Its corners.
    pub corners: Corners,
    /// Its poses in the camera.
    pub pose: TagPose,
}

/// A picture with what it shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// The tags that were measured.
    pub tags: Vec<SeenTag>,
    /// T_base_tool of each combination of the tags' solutions that fits; the best first.
    pub candidates: Vec<UncertainPose>,
    /// Why the picture is no measurement; empty where it is one.
    pub flags: Vec<Flag>,
}

impl Observation {
    /// T_base_tool, where the picture is a measurement.
    pub fn measured(&self) -> Option<&UncertainPose> {
        self.candidates.first().filter(|_| self.flags.is_empty())
    }
}

/// Why a picture cannot be searched.
#[derive(Debug, thiserror::Error)]
pub enum WatchError {
    /// It is not of the size that was calibrated.
    #[error("a picture of {}x{} pixels, but the camera was calibrated with {}x{}; set this resolution, or calibrate again", .found[0], .found[1], .expected[0], .expected[1])]
    Size {
        /// Size of the picture.
        found: [usize; 2],
        /// Size that was calibrated.
        expected: [usize; 2],
    },
}

/// A camera that watches the tags of an arm.
pub struct Watcher {
    camera: Camera,
    base: Tag,
    tool: Tag,
    /// Distance between the centres of both tags, where it is known, m.
    known_m: Option<f64>,
}

impl Watcher {
    /// Watches these two tags; where the distance between their centres is known, m, it shows whether their size is right.
    pub fn new(camera: Camera, base: Tag, tool: Tag, known_m: Option<f64>) -> Self {
        Self { camera, base, tool, known_m }
    }

    /// Measures a picture.
    ///
    /// # Errors
    ///
    /// The picture has another size than those of the calibration.
    pub fn observe(&self, image: &GreyImage) -> Result<Observation, WatchError> {
        let (found, expected) = ([image.width(), image.height()], self.camera.size());
        if found != expected {
            return Err(WatchError::Size { found, expected });
        }
        let detections = detect(image);
        if detections.is_empty() && !detect(&image.mirrored()).is_empty() {
            return Ok(Observation { tags: Vec::new(), candidates: Vec::new(), flags: vec![Flag::Mirrored] });
        }
        let (mut tags, mut flags) = (Vec::new(), Vec::new());
        for tag in [self.base, self.tool] {
            match self.see(image, &detections, tag) {
                Ok(seen) => {
                    flags.extend(self.doubts(&seen));
                    tags.push(seen);
                }
                Err(flag) => flags.push(flag),
            }
        }
        let candidates = candidates(&tags);
        let wrong = self.known_m.zip(candidates.first()).and_then(|(known_m, pose)| wrong_size(pose, known_m));
        flags.extend(wrong);
        Ok(Observation { tags, candidates, flags })
    }

    fn see(&self, image: &GreyImage, detections: &[Detection], tag: Tag) -> Result<SeenTag, Flag> {
        let id = tag.id;
        let mut found = detections.iter().filter(|found| found.id == id);
        let first = found.next().ok_or(Flag::Missing { id })?;
        if found.next().is_some() {
            return Err(Flag::Repeated { id });
        }
        let mut corners =
            refine(image, id, &first.corners, Some(self.camera.lens())).map_err(|error| Flag::Edge { id, error })?;
        corners.covariance *= self.camera.quality().noise_scale.max(1.0);
        let pose =
            tag_pose(self.camera.lens(), &tag, &corners).ok_or(Flag::Misfit { id, chi_squared: f64::INFINITY })?;
        Ok(SeenTag { tag, corners, pose })
    }

    /// Why a tag that was measured is no measurement.
    fn doubts(&self, seen: &SeenTag) -> impl Iterator<Item = Flag> {
        let (id, blur_px, chi_squared) = (seen.tag.id, seen.corners.blur_px, seen.pose.best.chi_squared);
        let allowed_px = (BLUR_FACTOR * self.camera.quality().blur_px).max(ALLOWED_BLUR_PX);
        let blurred = (blur_px > allowed_px).then_some(Flag::Blurred { id, blur_px, allowed_px });
        let misfit = (chi_squared > MISFIT).then_some(Flag::Misfit { id, chi_squared });
        let ambiguous = seen.pose.is_ambiguous().then_some(Flag::Ambiguous { id });
        [blurred, misfit, ambiguous].into_iter().flatten()
    }
}

/// T_base_tool of the solutions of both tags that are not excluded, the best first.
fn candidates(tags: &[SeenTag]) -> Vec<UncertainPose> {
    let [base, tool] = tags else { return Vec::new() };
    let solutions = |seen: &SeenTag| -> Vec<Solution> {
        let other = seen.pose.other.filter(|_| seen.pose.is_ambiguous());
        std::iter::once(seen.pose.best).chain(other).collect()
    };
    let tools = solutions(tool);
    let pairs = solutions(base).into_iter().flat_map(|base| tools.iter().map(move |tool| (base, *tool)));
    let mut all: Vec<(f64, UncertainPose)> =
        pairs.map(|(b, t)| (b.chi_squared + t.chi_squared, b.pose.inverse().then(&t.pose))).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().map(|(_, pose)| pose).collect()
}

/// Compares the distance of the tags with what it is known to be, m.
fn wrong_size(pose_base_tool: &UncertainPose, known_m: f64) -> Option<Flag> {
    let distance_m = pose_base_tool.pose.position.norm();
    let (scale, deviation) = (known_m / distance_m, pose_base_tool.distance_deviation_m() / distance_m);
    let is_right = (scale - 1.0).abs() <= SCALE_TOLERANCE.max(SCALE_DEVIATIONS * deviation);
    (!is_right).then_some(Flag::WrongSize { scale, deviation })
}
