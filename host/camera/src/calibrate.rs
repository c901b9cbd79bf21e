//! Calibration of a lens from views of the board, by least squares over the lens and the pose of the board in each view.
//!
//! The corners' covariance (see [`crate::edges`]) weighs them; what the fit leaves, χ² by its degrees of freedom, is a factor on
//! the covariance of the result, so that it also holds where the picture's noise is not what an edge shows: compression, a board
//! that is not quite flat.

use darm_core::real::{Mat6, Vec2, Vec3};
use darm_core::se::Pose;
use nalgebra::{DMatrix, DVector, Dyn, SMatrix, SVector};

use crate::homography::homography;
use crate::least_squares::{Minimum, NormalEquations, Problem, minimise};
use crate::lens::{Lens, NAMES, PARAMETERS};
use crate::tag_pose::{moved, seen};
use crate::view::{BoardTag, View};
use crate::zhang::{board_pose, first_lens};

/// Numbers of a pose.
const POSE: usize = 6;

/// Steps of the least squares: ten are usual.
const MAX_STEPS: usize = 100;

/// The lens of a camera from views of the board.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// The estimate.
    pub lens: Lens,
    /// Its covariance, in the order of [`NAMES`].
    pub covariance: SMatrix<f64, PARAMETERS, PARAMETERS>,
    /// T_camera_board of each view.
    pub poses: Vec<Pose<f64>>,
    /// Root mean square of the distance between seen and predicted corners, of each view, px.
    pub reprojection_px: Vec<f64>,
    /// The same of all views.
    pub overall_px: f64,
    /// χ² by its degrees of freedom: 1 where the corners' covariance explains everything.
    pub noise_scale: f64,
}

/// Why views give no calibration.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CalibrateError {
    /// A view does not determine where the board is.
    #[error("view {view} does not show where the board is; leave it out")]
    View {
        /// Its number, from 0.
        view: usize,
    },
    /// The views leave numbers of the lens free.
    #[error("the views do not determine the lens; add views of the board with other tilts and at other places")]
    NotDetermined,
    /// The search did not end.
    #[error(
        "no lens of this model fits the views: after {MAX_STEPS} steps the error still falls; is every view of one camera, with one focus?"
    )]
    NoFit,
}

/// A first guess of the lens and of the poses of the board.
///
/// # Errors
///
/// A view does not show where the board is.
pub fn guess(views: &[View], width: usize, height: usize) -> Result<(Lens, Vec<Pose<f64>>), CalibrateError> {
    let of_view = |(view, pairs): (usize, Vec<_>)| homography(&pairs).ok_or(CalibrateError::View { view });
    let pairs = views.iter().map(|view| view.pairs().collect::<Vec<_>>());
    let homographies = pairs.enumerate().map(of_view).collect::<Result<Vec<_>, _>>()?;
    let lens = first_lens(&homographies, width, height).ok_or(CalibrateError::NotDetermined)?;
    let pose = |(view, seen): (usize, &View)| {
        let direction = |(point, pixel): (Vec2<f64>, Vec2<f64>)| Some((point, lens.direction(&pixel)?));
        let pairs: Option<Vec<_>> = seen.pairs().map(direction).collect();
        let pose = homography(&pairs.unwrap_or_default()).and_then(|h| board_pose(&h));
        pose.ok_or(CalibrateError::View { view })
    };
    let poses = views.iter().enumerate().map(pose).collect::<Result<Vec<_>, _>>()?;
    Ok((lens, poses))
}

/// Fits a lens to views, from a guess of it and of the poses of the board.
///
/// # Errors
///
/// The views do not determine the lens.
pub fn calibrate(views: &[View], lens: Lens, poses: Vec<Pose<f64>>) -> Result<Calibration, CalibrateError> {
    let informations = |view: &View| view.tags.iter().map(|tag| tag.corners.covariance.try_inverse()).collect();
    let informations =
        views.iter().map(informations).collect::<Option<Vec<_>>>().ok_or(CalibrateError::NotDetermined)?;
    let fit = BoardFit { views, informations: &informations, lens, poses };
    let minimum = minimise(fit, MAX_STEPS).ok_or(CalibrateError::NotDetermined)?;
    if !minimum.converged {
        return Err(CalibrateError::NoFit);
    }
    let numbers: usize = 8 * views.iter().map(|view| view.tags.len()).sum::<usize>();
    let freedom = numbers.checked_sub(PARAMETERS + POSE * views.len()).filter(|freedom| *freedom > 0);
    let noise_scale = minimum.equations.cost / freedom.ok_or(CalibrateError::NotDetermined)? as f64;
    let covariance = lens_covariance(&minimum).ok_or(CalibrateError::NotDetermined)? * noise_scale.max(1.0);
    let Minimum { point: BoardFit { lens, poses, .. }, .. } = minimum;
    let squares: Vec<(f64, usize)> = views.iter().zip(&poses).map(|(view, pose)| squares(view, &lens, pose)).collect();
    let rms = |(sum, count): (f64, usize)| (sum / count as f64).sqrt();
    let all = squares.iter().fold((0.0, 0), |all, view| (all.0 + view.0, all.1 + view.1));
    let reprojection_px = squares.into_iter().map(rms).collect();
    Ok(Calibration { lens, covariance, poses, reprojection_px, overall_px: rms(all), noise_scale })
}

impl Calibration {
    /// Standard deviation of each number of the lens, in the order of [`NAMES`].
    pub fn deviations(&self) -> SVector<f64, PARAMETERS> {
        self.covariance.diagonal().map(|variance| variance.max(0.0).sqrt())
    }

    /// The lens in a line for each number: value with its 95 % interval.
    pub fn lines(&self) -> impl Iterator<Item = (&'static str, f64, f64)> {
        let (values, deviations) = (self.lens.parameters(), self.deviations());
        NAMES.iter().enumerate().map(move |(k, name)| (*name, values[k], deviations[k]))
    }
}

/// The part of the covariance that is the lens's: of the inverse of the complete information.
fn lens_covariance(minimum: &Minimum<BoardFit>) -> Option<SMatrix<f64, PARAMETERS, PARAMETERS>> {
    let all = minimum.covariance()?;
    Some(all.fixed_view::<PARAMETERS, PARAMETERS>(0, 0).into_owned())
}

/// Sum of the squared distances of a view's corners from where they are predicted, px², and their number.
fn squares(view: &View, lens: &Lens, pose: &Pose<f64>) -> (f64, usize) {
    let square = |point: &Vec3<f64>, pixel: &Vec2<f64>| {
        seen(lens, pose, point).map_or(f64::INFINITY, |(predicted, _)| (predicted - pixel).norm_squared())
    };
    let corners = view.tags.iter().flat_map(|tag| tag.corners_m.iter().zip(&tag.corners.pixels));
    corners.fold((0.0, 0), |(sum, count), (point, pixel)| (sum + square(point, pixel), count + 1))
}

/// A lens and poses with the views that they have to fit.
struct BoardFit<'a> {
    views: &'a [View],
    /// Inverse of the covariance of the corners of each tag of each view.
    informations: &'a [Vec<SMatrix<f64, 8, 8>>],
    lens: Lens,
    poses: Vec<Pose<f64>>,
}

/// What one tag adds to the normal equations.
struct TagTerms {
    residual: SVector<f64, 8>,
    by_lens: SMatrix<f64, 8, PARAMETERS>,
    by_pose: SMatrix<f64, 8, POSE>,
}

fn tag_terms(lens: &Lens, pose: &Pose<f64>, tag: &BoardTag) -> Option<TagTerms> {
    let mut terms = TagTerms { residual: SVector::zeros(), by_lens: SMatrix::zeros(), by_pose: SMatrix::zeros() };
    for (k, (point, pixel)) in tag.corners_m.iter().zip(&tag.corners.pixels).enumerate() {
        let (predicted, by_pose) = seen(lens, pose, point)?;
        let (projection, _) = lens.project_point(&(pose.rotation * point + pose.position))?;
        terms.residual.fixed_rows_mut::<2>(2 * k).copy_from(&(predicted - pixel));
        terms.by_lens.fixed_rows_mut::<2>(2 * k).copy_from(&projection.by_lens);
        terms.by_pose.fixed_rows_mut::<2>(2 * k).copy_from(&by_pose);
    }
    Some(terms)
}

impl Problem for BoardFit<'_> {
    type Size = Dyn;

    fn normal_equations(&self) -> Option<NormalEquations<Dyn>> {
        let size = PARAMETERS + POSE * self.views.len();
        let (mut gradient, mut information) = (DVector::zeros(size), DMatrix::zeros(size, size));
        let (mut cost, mut of_lens) = (0.0, SMatrix::<f64, PARAMETERS, PARAMETERS>::zeros());
        let mut by_lens = SVector::<f64, PARAMETERS>::zeros();
        for (k, ((view, pose), weights)) in self.views.iter().zip(&self.poses).zip(self.informations).enumerate() {
            let (mut of_pose, mut by_pose) = (Mat6::zeros(), SVector::<f64, POSE>::zeros());
            let mut of_both = SMatrix::<f64, POSE, PARAMETERS>::zeros();
            for (tag, weight) in view.tags.iter().zip(weights) {
                let terms = tag_terms(&self.lens, pose, tag)?;
                let weighted = weight * terms.residual;
                cost += terms.residual.dot(&weighted);
                by_lens += terms.by_lens.transpose() * weighted;
                by_pose += terms.by_pose.transpose() * weighted;
                let lens_weighted = weight * terms.by_lens;
                of_lens += terms.by_lens.transpose() * lens_weighted;
                of_both += terms.by_pose.transpose() * lens_weighted;
                of_pose += terms.by_pose.transpose() * weight * terms.by_pose;
            }
            let row = PARAMETERS + POSE * k;
            gradient.fixed_rows_mut::<POSE>(row).copy_from(&by_pose);
            information.fixed_view_mut::<POSE, POSE>(row, row).copy_from(&of_pose);
            information.fixed_view_mut::<POSE, PARAMETERS>(row, 0).copy_from(&of_both);
            information.fixed_view_mut::<PARAMETERS, POSE>(0, row).copy_from(&of_both.transpose());
        }
        gradient.fixed_rows_mut::<PARAMETERS>(0).copy_from(&by_lens);
        information.fixed_view_mut::<PARAMETERS, PARAMETERS>(0, 0).copy_from(&of_lens);
        Some(NormalEquations { cost, gradient, information })
    }

    fn moved(&self, step: &DVector<f64>) -> Option<Self> {
        let lens = Lens::new(&(self.lens.parameters() + step.fixed_rows::<PARAMETERS>(0))).ok()?;
        let errors = (0..self.poses.len()).map(|k| step.fixed_rows::<POSE>(PARAMETERS + POSE * k).into_owned());
        let poses = self.poses.iter().zip(errors).map(|(pose, error)| moved(pose, &error)).collect();
        Some(Self { lens, poses, ..*self })
    }
}
