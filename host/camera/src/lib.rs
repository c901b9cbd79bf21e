//! From pictures of printed tags to poses with their covariance.
//!
//! ```text
//! target ─► drawing (SVG)                            print it
//!    │
//! source ─► grey image ─► detect ─► edges ─► corners with covariance
//!    │                                          │
//!    ├─ collector: view ─► zhang ─► calibrate ──┼─► camera (lens, covariance, file)
//!    │             missing views                │        │
//!    └─ watch ──────────────────────────────────┴► tag pose ─► uncertain pose of the tool in the base, or flags
//! ```
//!
//! Conventions: pixels from the centre of the first one ([`grey`]); the camera looks along z, x to the right, y down ([`lens`]); a
//! tag has x to the right, y up, z out of the paper ([`target`]). Lengths in m, angles in rad, in the image px.
//!
//! The crate reads no clock and no device: pictures come from a [`source`], and who takes them knows when. With the feature
//! `render` it also draws pictures of tags through a lens, by code that is not that of the estimator.
//!
//! # Why a detector in this crate
//!
//! Of the detectors on crates.io, `aprilgrid` 0.8 looks for the corners between the squares of a grid and needs 163 packages, and
//! `kornia-apriltag` 0.2 needs 137, one of them with a licence that `deny.toml` does not allow. [`detect`] needs none. In the three
//! photographs of the AprilTag library's tests it finds 46 of the 47 published tags, pupil-apriltags 1.0.4 29 and OpenCV 5.0 25
//! (`eval/camera/compare.py photographs`).

pub mod calibrate;
pub mod camera;
pub mod collector;
pub mod detect;
pub mod drawing;
pub mod edges;
pub mod family;
pub mod grey;
pub mod homography;
pub mod image_file;
pub mod least_squares;
pub mod lens;
pub mod missing_views;
#[cfg(feature = "render")]
pub mod render;
pub mod source;
pub mod tag_pose;
pub mod target;
pub mod uncertain_pose;
pub mod view;
pub mod watch;
pub mod zhang;
