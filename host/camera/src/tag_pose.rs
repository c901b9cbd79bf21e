//! Pose of a planar tag from its corners: both solutions in closed form, then least squares with the corners' covariance.
//!
//! A small tag that faces the camera looks nearly the same when it is tilted by the same angle to the other side. Both
//! solutions are kept; [`TagPose::is_ambiguous`] says when the corners do not determine which is right.
//!
//! Frames: the pose is that of the tag in the camera, T_camera_tag; see [`crate::lens`] and [`crate::target`].
//! Source: T. Collins, A. Bartoli, "Infinitesimal plane-based pose estimation", IJCV 109 (2014) 252.

use darm_core::real::{Mat3, Vec2, Vec3, Vec6};
use darm_core::se::{Pose, rotation_exp};
use nalgebra::{Matrix2, SMatrix, SVector, U6};

use crate::edges::Corners;
use crate::homography::homography;
use crate::least_squares::{NormalEquations, Problem, minimise};
use crate::lens::Lens;
use crate::target::{CORNERS, Tag};
use crate::uncertain_pose::UncertainPose;

/// χ² by which the other solution must fit worse to be excluded: with normal errors a wrong one is then chosen in less than one
/// of 10 000 pictures.
const EXCLUDED: f64 = 16.0;

/// Poses closer to each other than this number of standard deviations, squared, are one.
const SAME: f64 = 1.0;

/// Steps of the least squares: from the closed form a few suffice.
const MAX_STEPS: usize = 50;

/// A pose that fits the corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// T_camera_tag.
    pub pose: UncertainPose,
    /// What is left of the corners in units of their covariance; two degrees of freedom.
    pub chi_squared: f64,
}

/// The poses that a tag may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TagPose {
    /// The solution that fits better.
    pub best: Solution,
    /// The other solution, if there is one.
    pub other: Option<Solution>,
}

impl TagPose {
    /// Whether the corners do not determine which solution is right.
    pub fn is_ambiguous(&self) -> bool {
        self.other.is_some_and(|other| other.chi_squared - self.best.chi_squared < EXCLUDED)
    }
}

/// The poses of a tag that is seen with these corners; `None` where no pose in front of the camera fits.
pub fn tag_pose(lens: &Lens, tag: &Tag, corners: &Corners) -> Option<TagPose> {
    let points = tag.corners_m();
    let mut directions = [Vec2::zeros(); CORNERS];
    for (direction, pixel) in directions.iter_mut().zip(&corners.pixels) {
        *direction = lens.direction(pixel)?;
    }
    // Invertible: the four edges determine the corners independently.
    let information = corners.covariance.try_inverse()?;
    let pixels = SVector::from_iterator(corners.pixels.iter().flat_map(|pixel| [pixel.x, pixel.y]));
    let refined = closed_form(&points, &directions)?.into_iter().flatten().filter_map(|pose| {
        let minimum = minimise(TagFit { lens, points, pixels, information, pose }, MAX_STEPS)?;
        let pose = UncertainPose { pose: minimum.point.pose, covariance: minimum.covariance()? };
        Some(Solution { pose, chi_squared: minimum.equations.cost })
    });
    let mut found: Vec<Solution> = refined.collect();
    found.sort_by(|a, b| a.chi_squared.total_cmp(&b.chi_squared));
    let best = *found.first()?;
    let is_other = |other: &&Solution| best.pose.chi_squared(&other.pose.pose).is_some_and(|distance| distance > SAME);
    Some(TagPose { best, other: found.get(1).filter(is_other).copied() })
}

/// The two poses that fit directions to the corners of a square; `None` where they are on a line.
fn closed_form(points: &[Vec3<f64>; CORNERS], directions: &[Vec2<f64>; CORNERS]) -> Option<[Option<Pose<f64>>; 2]> {
    let pairs: Vec<_> = points.iter().zip(directions).map(|(point, direction)| (point.xy(), *direction)).collect();
    let h = homography(&pairs)?;
    // v is where the tag's origin is seen, and the first-order change around it is J.
    let v = Vec2::new(h[(0, 2)], h[(1, 2)]);
    let change = |row: usize, column: usize| h[(row, column)] - h[(2, column)] * v[row];
    let j = Matrix2::new(change(0, 0), change(0, 1), change(1, 0), change(1, 1));
    // R_v turns the optical axis to (v, 1).
    let axis = Vec3::new(-v.y, v.x, 0.0);
    let to_origin = rotation_exp(&axis.try_normalize(0.0).map_or(axis, |axis| axis * v.norm().atan()));
    let b = SMatrix::<f64, 2, 3>::new(1.0, 0.0, -v.x, 0.0, 1.0, -v.y) * to_origin.fixed_columns::<2>(0);
    let a = b.try_inverse()? * j;
    let gamma = a.singular_values().max();
    let upper = a / gamma;
    // The first two columns of a rotation have length 1 and are orthogonal: that leaves the sign of their third entries.
    let rest = Matrix2::identity() - upper.transpose() * upper;
    let third = Vec2::new(rest[(0, 0)].max(0.0).sqrt(), rest[(1, 1)].max(0.0).sqrt().copysign(rest[(0, 1)]));
    Some([1.0, -1.0].map(|sign| {
        let column = |k: usize| upper.column(k).push(sign * third[k]);
        let (x, y) = (column(0), column(1));
        let rotation = to_origin * Mat3::from_columns(&[x, y, x.cross(&y)]);
        Some(Pose { rotation, position: position(&rotation, points, directions)? })
    }))
}

/// The position that fits best with a rotation: linear least squares of direction × (R X + p) = 0; `None` behind the camera.
fn position(rotation: &Mat3<f64>, points: &[Vec3<f64>; 4], directions: &[Vec2<f64>; 4]) -> Option<Vec3<f64>> {
    let (mut products, mut right) = (Mat3::zeros(), Vec3::zeros());
    for (point, direction) in points.iter().zip(directions) {
        let rows = SMatrix::<f64, 2, 3>::new(1.0, 0.0, -direction.x, 0.0, 1.0, -direction.y);
        products += rows.transpose() * rows;
        right -= rows.transpose() * rows * (rotation * point);
    }
    Some(products.try_inverse()? * right).filter(|position| position.z > 0.0)
}

/// A pose with the corners that it has to fit.
struct TagFit<'a> {
    lens: &'a Lens,
    points: [Vec3<f64>; CORNERS],
    pixels: SVector<f64, 8>,
    information: SMatrix<f64, 8, 8>,
    pose: Pose<f64>,
}

impl Problem for TagFit<'_> {
    type Size = U6;

    fn normal_equations(&self) -> Option<NormalEquations<U6>> {
        let (mut residual, mut jacobian) = (-self.pixels, SMatrix::<f64, 8, 6>::zeros());
        for (k, point) in self.points.iter().enumerate() {
            let (pixel, by_pose) = seen(self.lens, &self.pose, point)?;
            let mut rows = residual.fixed_rows_mut::<2>(2 * k);
            rows += pixel;
            jacobian.fixed_rows_mut::<2>(2 * k).copy_from(&by_pose);
        }
        let weighted = jacobian.transpose() * self.information;
        let cost = residual.dot(&(self.information * residual));
        Some(NormalEquations { cost, gradient: weighted * residual, information: weighted * jacobian })
    }

    fn moved(&self, step: &Vec6<f64>) -> Option<Self> {
        Some(Self { pose: moved(&self.pose, step), ..*self })
    }
}

/// Where a point of a posed frame is seen, px, with the derivative by the error (ω, v) of the pose.
pub(crate) fn seen(lens: &Lens, pose: &Pose<f64>, point: &Vec3<f64>) -> Option<(Vec2<f64>, SMatrix<f64, 2, 6>)> {
    let turned = pose.rotation * point;
    let (projection, by_point) = lens.project_point(&(turned + pose.position))?;
    let mut by_pose = SMatrix::<f64, 2, 6>::zeros();
    by_pose.fixed_columns_mut::<3>(0).copy_from(&(by_point * -turned.cross_matrix()));
    by_pose.fixed_columns_mut::<3>(3).copy_from(&by_point);
    Some((projection.pixel, by_pose))
}

/// The pose with an error (ω, v).
pub(crate) fn moved(pose: &Pose<f64>, error: &Vec6<f64>) -> Pose<f64> {
    let [wx, wy, wz, vx, vy, vz] = (*error).into();
    let rotation = rotation_exp(&Vec3::new(wx, wy, wz)) * pose.rotation;
    Pose { rotation, position: pose.position + Vec3::new(vx, vy, vz) }
}
