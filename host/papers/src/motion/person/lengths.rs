//! Lengths of the links from the markers: angles and lengths in turn.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use nalgebra::{DMatrix, DVector, Matrix3, SVD};

use super::SPREAD;
use super::groups::Groups;
use crate::motion::markers::Capture;
use crate::motion::placed::Placed;
use crate::motion::trajectory::{Problem, Trajectory, TrajectoryError, solve};
use crate::motion::{BodyPoint, Posture};
use darm_robot::robot::Robot;
use darm_robot::svd::svd;

/// Markers on skin are this good, m.
const MARKER_M: f64 = 0.01;
/// Accelerations of a person, rad/s² and m/s².
const ACCELERATION: f64 = 20.0;
/// Frames that lengths are found from, and rounds of angles and lengths.
const LENGTH_FRAMES: usize = 9;
const LENGTH_ROUNDS: usize = 12;

/// The tree's motion by the markers, from a first frame that is found by itself.
pub(super) fn follow(tree: &Robot, markers: &[BodyPoint], capture: &Capture) -> Result<Trajectory, TrajectoryError> {
    let start = walk(tree, markers, &capture.places)?;
    let problem = problem(tree, markers, &capture.places, capture.step_s());
    solve(&problem, &start)
}

fn problem<'a>(
    tree: &'a Robot,
    markers: &'a [BodyPoint],
    targets: &'a [Vec<Option<Vec3<f64>>>],
    step_s: f64,
) -> Problem<'a> {
    Problem {
        robot: tree,
        step_s,
        markers,
        targets,
        feet: &[],
        chair: None,
        com: None,
        marker_m: MARKER_M,
        acceleration: ACCELERATION,
    }
}

/// A posture for every frame, each from the one before; the walk begins at the end that fits the tree's zero posture better.
fn walk(
    tree: &Robot,
    markers: &[BodyPoint],
    targets: &[Vec<Option<Vec3<f64>>>],
) -> Result<Vec<Posture>, TrajectoryError> {
    let one = |frame: usize, start: &Posture| {
        let alone = problem(tree, markers, &targets[frame..=frame], 1.0);
        solve(&alone, std::slice::from_ref(start))
    };
    let last = targets.len() - 1;
    let (at_first, at_last) =
        (one(0, &laid_on(tree, markers, &targets[0])?)?, one(last, &laid_on(tree, markers, &targets[last])?)?);
    let backwards = at_last.marker_rms_m < at_first.marker_rms_m;
    let mut posture = if backwards { at_last } else { at_first }.postures[0].clone();
    let mut all = vec![posture.clone()];
    for step in 1..targets.len() {
        let frame = if backwards { last - step } else { step };
        posture = one(frame, &posture)?.postures[0].clone();
        all.push(posture.clone());
    }
    if backwards {
        all.reverse();
    }
    Ok(all)
}

/// The zero posture with its base laid on the markers: the rotation that turns one cloud of points onto the other (Kabsch).
fn laid_on(tree: &Robot, markers: &[BodyPoint], targets: &[Option<Vec3<f64>>]) -> Result<Posture, TrajectoryError> {
    let q = tree.joints.iter().map(|j| j.limits.map_or(0.0, |[low, high]| 0.0f64.clamp(low, high))).collect();
    let mut posture = Posture { base: Pose::identity(), q };
    let mut placed = Placed::new(tree)?;
    placed.place(&posture);
    let pairs: Vec<(Vec3<f64>, Vec3<f64>)> =
        markers.iter().zip(targets).filter_map(|(m, t)| Some((placed.point(m), (*t)?))).collect();
    let count = pairs.len().max(1) as f64;
    let (own, seen) = pairs.iter().fold((Vec3::zeros(), Vec3::zeros()), |(a, b), (own, seen)| (a + own, b + seen));
    let (own, seen) = (own / count, seen / count);
    let across: Matrix3<f64> = pairs.iter().map(|(a, b)| (b - seen) * (a - own).transpose()).sum();
    let svd = across.svd(true, true);
    if let (Some(u), Some(v_t)) = (svd.u, svd.v_t) {
        let proper = Matrix3::from_diagonal(&Vec3::new(1.0, 1.0, (u * v_t).determinant().signum()));
        let rotation = u * proper * v_t;
        posture.base = Pose { rotation, position: seen - rotation * own };
    }
    Ok(posture)
}

/// The average person, with the markers on it.
pub(super) struct Average<'a> {
    pub(super) tree: &'a Robot,
    pub(super) markers: &'a [BodyPoint],
    pub(super) groups: &'a Groups,
}

impl Average<'_> {
    /// With these scales of the lengths.
    fn scaled(&self, lengths: &[f64]) -> (Robot, Vec<BodyPoint>) {
        let even = vec![1.0; lengths.len()];
        (self.groups.scaled(self.tree, lengths, &even), self.groups.markers(self.markers, lengths))
    }

    /// Scales of the lengths: angles and lengths in turn, over frames spread evenly.
    pub(super) fn lengths(&self, capture: &Capture) -> Result<Vec<f64>, TrajectoryError> {
        let last = capture.places.len() - 1;
        let chosen: Vec<Vec<Option<Vec3<f64>>>> =
            (0..LENGTH_FRAMES).map(|k| capture.places[k * last / (LENGTH_FRAMES - 1)].clone()).collect();
        let mut lengths = vec![1.0; self.groups.names.len()];
        let mut postures = walk(self.tree, self.markers, &chosen)?;
        for round in 0..LENGTH_ROUNDS {
            if round > 0 {
                let (scaled, on) = self.scaled(&lengths);
                for (posture, targets) in postures.iter_mut().zip(&chosen) {
                    let alone = problem(&scaled, &on, std::slice::from_ref(targets), 1.0);
                    *posture = solve(&alone, std::slice::from_ref(posture))?.postures[0].clone();
                }
            }
            let change = self.lengthen(&lengths, &postures, &chosen)?;
            lengths.iter_mut().zip(&change).for_each(|(length, change)| *length += change);
            if change.amax() < 1e-4 {
                break;
            }
        }
        Ok(lengths)
    }

    /// The change of the scales that brings the markers nearer, with base and angles free to follow.
    fn lengthen(
        &self,
        lengths: &[f64],
        postures: &[Posture],
        targets: &[Vec<Option<Vec3<f64>>>],
    ) -> Result<DVector<f64>, TrajectoryError> {
        const SMALL: f64 = 1e-4;
        let g = lengths.len();
        let spread = SPREAD.0.powi(-2);
        let mut matrix = DMatrix::from_diagonal_element(g, g, spread);
        let mut right = DVector::from_iterator(g, lengths.iter().map(|length| (1.0 - length) * spread));
        let placed = |lengths: &[f64]| -> Result<(Placed, Vec<BodyPoint>), TrajectoryError> {
            let (tree, markers) = self.scaled(lengths);
            Ok((Placed::new(&tree)?, markers))
        };
        let grown = |k: usize| {
            let mut own = lengths.to_vec();
            own[k] += SMALL;
            placed(&own)
        };
        let mut now = placed(lengths)?;
        let mut others = (0..g).map(grown).collect::<Result<Vec<_>, _>>()?;
        for (posture, targets) in postures.iter().zip(targets) {
            let points = |(placed, on): &mut (Placed, Vec<BodyPoint>)| -> DVector<f64> {
                placed.place(posture);
                let seen = on.iter().zip(targets).filter(|(_, target)| target.is_some());
                DVector::from_vec(seen.flat_map(|(marker, _)| placed.point(marker).data.0[0]).collect())
            };
            let here = points(&mut now);
            let aim =
                DVector::from_vec(targets.iter().flatten().flat_map(|target| target.data.0[0]).collect::<Vec<_>>());
            let columns: Vec<DVector<f64>> = others.iter_mut().map(|other| (points(other) - &here) / SMALL).collect();
            let slopes = DMatrix::from_columns(&columns);
            let seen = now.1.iter().zip(targets).filter(|(_, target)| target.is_some());
            let moves: Vec<_> = seen
                .map(|(marker, _)| now.0.jacobian(marker.joint, &Pose::at(marker.point)).rows(3, 3).into_owned())
                .collect();
            let mut jacobian = DMatrix::zeros(here.len(), 6 + posture.q.len());
            moves.iter().enumerate().for_each(|(k, rows)| jacobian.rows_mut(3 * k, 3).copy_from(rows));
            // What base and angles can follow is no matter of lengths.
            let axes = svd(&jacobian).and_then(|SVD { u, singular_values, .. }| {
                let followed = (0..singular_values.len()).filter(|&k| singular_values[k] > 1e-3).collect::<Vec<_>>();
                Some(u?.select_columns(&followed))
            });
            let axes = axes.unwrap_or_else(|| DMatrix::zeros(here.len(), 0));
            let rest = |m: &DMatrix<f64>| m - &axes * axes.tr_mul(m);
            let (slopes, left) = (rest(&slopes), aim - here);
            matrix += slopes.tr_mul(&slopes) / MARKER_M.powi(2);
            right += slopes.tr_mul(&left) / MARKER_M.powi(2);
        }
        let factor = matrix.cholesky().expect("a positive diagonal was added");
        Ok(factor.solve(&right))
    }
}
