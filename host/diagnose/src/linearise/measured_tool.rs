//! The tool of a serial robot, measured from outside: its position by a laser tracker, its pose by a camera.
//!
//! The residual of a row is predicted less measured, in the instrument's frame: x, y, z, and of a pose the rotation vector
//! of R·R'ᵀ with R predicted and R' measured. With S the pose of the robot's base in the instrument's frame, the prediction
//! is S times the tool of the module `serial_chain`.
//!
//! Where the instrument measures in the robot's base frame, S is the identity, and what it is off by is the law
//! `sensor-frame`: S = (exp θ, d). Where its frame is unknown, S is no effect: at any values it is what brings the robot
//! nearest to the training rows (W. Kabsch, Acta Cryst. A32 (1976) 922), and the columns are those that are left beside
//! its own (G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, variable projection).
//!
//! Law `scale`: the instrument shows lengths 1 + s times as long, so that the tool is at 1 + s times its place in the robot.

use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, Twist, rotation_exp, rotation_jacobian, rotation_log};
use nalgebra::{DMatrix, DVector, Quaternion, UnitQuaternion};

use crate::effect::{LawName, Place, Site};
use crate::linearise::experiment::{Axis, Candidate, CandidateValue, Curvature, Experiment, Moving, TableColumns};
use crate::linearise::serial_chain::{self, FrameChain, SerialChain};
use crate::measured::Measured;
use crate::prepare::signals::{PrepareError, Prepared};
use darm_measure::rigid_motion::{nearest_motion, nearest_rotation};
use darm_measure::trimmed_root_mean_square;
use darm_robot::robot::Robot;

/// Columns of the tool's position.
const POSITION: [&str; 3] = ["x", "y", "z"];
/// Columns of its orientation, a quaternion.
const ORIENTATION: [&str; 4] = ["qx", "qy", "qz", "qw"];
/// How far the instrument's frame may be off: m, rad.
const FRAME_PRIORS: [f64; 2] = [0.02, 0.02];
/// Singular values of the frame's columns below this share of the largest say nothing: positions in a line.
const RANK_TOL: f64 = 1e-9;
/// Values of the instrument's frame: d, θ.
const FRAME_VALUES: usize = 6;
/// How far its scale may be off: bars that photogrammetry takes its lengths from are a few tenths of a millimetre in a metre off.
const SCALE_PRIOR: f64 = 1e-3;

/// How the tool was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredTool {
    /// The frame that is measured; `None`: the robot's tool.
    pub tool: Option<String>,
    /// Whether its orientation was measured besides its position.
    pub oriented: bool,
    /// Whether the instrument's frame is the robot's base, nearly; else it is fitted before anything is predicted.
    pub in_base_frame: bool,
}

struct ToolRows {
    chain: SerialChain,
    measured: Vec<Pose<f64>>,
    oriented: bool,
    /// Where the instrument's frame is unknown: whether each row takes part in its fit.
    fits_frame: Option<Vec<bool>>,
}

/// A prediction: the robot's base in the instrument's frame, the tool in each row, and how long the instrument shows 1 m.
struct Predicted {
    chains: Vec<FrameChain>,
    base: Pose<f64>,
    tools: Vec<Pose<f64>>,
    scale: f64,
}

/// The experiment of measured tool positions or poses.
pub(crate) fn experiment(data: &Prepared, robot: &Robot, how: &MeasuredTool) -> Result<Experiment, PrepareError> {
    let chain = SerialChain::new(data, robot, how.tool.as_deref(), how.oriented)?;
    let measured = poses(data, how.oriented)?;
    let fits_frame = (!how.in_base_frame).then(|| data.rows.iter().map(|row| !row.held_out).collect());
    let rows = ToolRows { chain, measured, oriented: how.oriented, fits_frame };
    let findings = rows.chain.finding().into_iter().collect();
    let (residuals, columns) = rows.at(&vec![0.0; rows.n_values()]);
    let mut columns = columns.into_iter();
    let mut candidates = rows.chain.candidates(&mut columns);
    if how.in_base_frame {
        candidates.push(instrument_frame(&mut columns));
    }
    candidates.push(instrument_scale(columns));
    let mut axes: Vec<Axis> = POSITION.map(|name| Axis::new(name, "m")).into();
    if how.oriented {
        axes.extend(["about x", "about y", "about z"].map(|name| Axis::new(name, "rad")));
    }
    let positions = rows.positions();
    let mut channels = rows.chain.channels();
    channels.push(("time".into(), data.time_s.clone()));
    let curvature = Curvature::Relinearise(Box::new(move |values| rows.at(values)));
    Ok(Experiment {
        kind: if how.oriented { Measured::ToolPose } else { Measured::ToolPosition },
        axes,
        n_norm: 3,
        rows: data.rows.clone(),
        residuals,
        measured: Some(positions),
        candidates,
        channels,
        bodies: Vec::new(),
        findings,
        curvature,
    })
}

/// The columns that a log may have exchanged or in another unit.
pub(crate) fn columns(data: &Prepared, robot: &Robot, how: &MeasuredTool) -> TableColumns {
    let path = robot.frame_or_tool(how.tool.as_deref()).map_or(Vec::new(), |tool| robot.path(tool));
    let joints = serial_chain::columns(data, robot, &path);
    TableColumns {
        measured: POSITION.map(|name| vec![name.to_string()]).into(),
        moving: joints.into_iter().map(|column| Moving { columns: vec![column], turns: true }).collect(),
    }
}

/// What was measured in each row.
fn poses(data: &Prepared, oriented: bool) -> Result<Vec<Pose<f64>>, PrepareError> {
    let channels = |names: &[&str]| names.iter().map(|name| data.channel(name)).collect::<Result<Vec<_>, _>>();
    let position = channels(&POSITION)?;
    let turn = if oriented { channels(&ORIENTATION)? } else { Vec::new() };
    let pose =
        |row: usize| Pose { position: Vec3::from_fn(|axis, _| position[axis][row]), rotation: rotation(&turn, row) };
    Ok((0..data.rows.len()).map(pose).collect())
}

/// How far the tool turns other than predicted in the training rows, rad, with its quaternion as in `read`, the rows of the experiment
/// read in some way: root mean square without the farthest rows, after the best turn of the tool on the flange, of which a model
/// may know nothing. `None` where only its position was measured.
pub(crate) fn turn_error(data: &Prepared, experiment: &Experiment, read: &Prepared) -> Option<f64> {
    if experiment.kind != Measured::ToolPose {
        return None;
    }
    let [measured, read] = [poses(data, true).ok()?, poses(read, true).ok()?];
    let training = (0..measured.len()).filter(|row| !experiment.rows[*row].held_out);
    let pairs: Vec<(Mat3<f64>, Mat3<f64>)> = training
        .map(|row| {
            let off = Vec3::from_column_slice(&experiment.residuals[6 * row + 3..6 * row + 6]);
            (rotation_exp(&off) * measured[row].rotation, read[row].rotation)
        })
        .collect();
    let on_flange = nearest_rotation(&pairs.iter().map(|(own, seen)| own.transpose() * seen).sum());
    let angle = |(own, seen): &(Mat3<f64>, Mat3<f64>)| rotation_log(&((own * on_flange).transpose() * seen)).norm();
    (!pairs.is_empty()).then(|| trimmed_root_mean_square(pairs.iter().map(angle).collect()))
}

/// The rotation in a row by the columns x, y, z and w of its quaternion; the identity without columns.
fn rotation(quaternion: &[Vec<f64>], row: usize) -> Mat3<f64> {
    let [x, y, z, w] = quaternion else { return Mat3::identity() };
    UnitQuaternion::from_quaternion(Quaternion::new(w[row], x[row], y[row], z[row])).to_rotation_matrix().into()
}

/// Where the instrument is; its columns are the next ones.
fn instrument_frame(mut columns: impl Iterator<Item = Vec<f64>>) -> Candidate {
    let [shift, turn] = FRAME_PRIORS;
    let moved = POSITION.map(|name| (name, "m", shift));
    let turned = ["turn about x", "turn about y", "turn about z"].map(|name| (name, "rad", turn));
    let value = |(name, unit, prior): (&str, &str, f64)| CandidateValue {
        name: name.into(),
        unit: unit.into(),
        prior,
        min: f64::NEG_INFINITY,
        column: columns.next().expect("a column for each value"),
    };
    let values = moved.into_iter().chain(turned).map(value).collect();
    Candidate { law: LawName::SensorFrame, site: instrument(), shape: None, values }
}

/// By how much the instrument shows lengths too long; its column is the last one.
fn instrument_scale(mut columns: impl Iterator<Item = Vec<f64>>) -> Candidate {
    let column = columns.next().expect("a column for the scale");
    let value =
        CandidateValue { name: "stretch".into(), unit: "1".into(), prior: SCALE_PRIOR, min: f64::NEG_INFINITY, column };
    Candidate { law: LawName::Scale, site: instrument(), shape: None, values: vec![value] }
}

fn instrument() -> Site {
    Site::new(Place::Instrument, "the measuring instrument")
}

impl ToolRows {
    fn n_values(&self) -> usize {
        self.chain.n_values() + if self.fits_frame.is_none() { FRAME_VALUES } else { 0 } + 1
    }

    /// Residuals and columns at these values.
    fn at(&self, values: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let (own, of_instrument) = values.split_at(self.chain.n_values());
        let (stretch, frame) = of_instrument.split_last().expect("the scale is the last value");
        let frame = if frame.is_empty() { [0.0; FRAME_VALUES].as_slice() } else { frame };
        let (shift, turn) = (Vec3::from_column_slice(&frame[..3]), Vec3::from_column_slice(&frame[3..]));
        let predicted = self.predicted(own, Pose { rotation: rotation_exp(&turn), position: shift }, 1.0 + stretch);
        let pairs = predicted.tools.iter().zip(&self.measured);
        let residuals = pairs.flat_map(|(predicted, measured)| self.axes(residual(predicted, measured))).collect();
        let mut columns = self.chain_columns(own, &predicted);
        let of_frame = self.frame_columns(&predicted, &turn);
        let of_scale = self.scale_column(&predicted);
        match &self.fits_frame {
            None => {
                columns.extend(of_frame);
                columns.push(of_scale);
            }
            Some(fits) => {
                columns.push(of_scale);
                self.project_out(&mut columns, &of_frame, fits);
            }
        }
        (residuals, columns)
    }

    fn predicted(&self, own: &[f64], base: Pose<f64>, scale: f64) -> Predicted {
        let chains = self.chain.frames(own);
        let base = self.fits_frame.as_ref().map_or(base, |fits| self.nearest_base(&chains, scale, fits));
        let seen = |tool: &Pose<f64>| Pose { position: tool.position * scale, ..*tool };
        let tools = chains.iter().map(|chain| base * seen(&chain.tool)).collect();
        Predicted { chains, base, tools, scale }
    }

    /// The base that brings the tool nearest to what was measured in the rows that take part.
    fn nearest_base(&self, chains: &[FrameChain], scale: f64, fits: &[bool]) -> Pose<f64> {
        let at = |position: Vec3<f64>| Pose { rotation: Mat3::identity(), position };
        let pair = |row: usize| (at(chains[row].tool.position * scale), at(self.measured[row].position));
        let pairs: Vec<_> = (0..chains.len()).filter(|row| fits[*row]).map(pair).collect();
        nearest_motion(&pairs, &vec![1.0; pairs.len()], 0.0)
    }

    /// A column for each value of the chain.
    fn chain_columns(&self, own: &[f64], predicted: &Predicted) -> Vec<Vec<f64>> {
        let Predicted { base: Pose { rotation, .. }, scale, .. } = predicted;
        let slopes = self.chain.slopes(own, &predicted.chains);
        let of =
            |twist: &Twist<f64>| Twist { angular: rotation * twist.angular, linear: rotation * twist.linear * *scale };
        (0..own.len()).map(|k| slopes.iter().flat_map(|row| self.axes(of(&row[k]))).collect()).collect()
    }

    /// The column of the instrument's scale.
    fn scale_column(&self, predicted: &Predicted) -> Vec<f64> {
        let rotation = &predicted.base.rotation;
        let moved = |chain: &FrameChain| Twist { angular: Vec3::zeros(), linear: rotation * chain.tool.position };
        predicted.chains.iter().flat_map(|chain| self.axes(moved(chain))).collect()
    }

    /// A column for each value of the instrument's frame, turned by the rotation vector `turn`.
    fn frame_columns(&self, predicted: &Predicted, turn: &Vec3<f64>) -> Vec<Vec<f64>> {
        // The left Jacobian of SO(3) at θ is the right one at −θ.
        let turns = rotation_jacobian(&-turn);
        let slope = |k: usize, tool: &Pose<f64>| match k {
            0..3 => Twist { angular: Vec3::zeros(), linear: Vec3::ith(k, 1.0) },
            _ => {
                let angular: Vec3<f64> = turns.column(k - 3).into();
                Twist { angular, linear: angular.cross(&(tool.position - predicted.base.position)) }
            }
        };
        let column = |k: usize| predicted.tools.iter().flat_map(|tool| self.axes(slope(k, tool))).collect();
        (0..FRAME_VALUES).map(column).collect()
    }

    /// Takes out of each column what the frame's columns have of it in the positions of the rows that take part.
    fn project_out(&self, columns: &mut [Vec<f64>], of_frame: &[Vec<f64>], fits: &[bool]) {
        let n_axes = self.n_axes();
        let counts: Vec<usize> =
            (0..fits.len() * n_axes).filter(|entry| fits[entry / n_axes] && entry % n_axes < 3).collect();
        let frame = DMatrix::from_fn(counts.len(), FRAME_VALUES, |row, k| of_frame[k][counts[row]]);
        let svd = frame.svd(true, true);
        for column in columns {
            let own = DVector::from_iterator(counts.len(), counts.iter().map(|&entry| column[entry]));
            let Ok(sizes) = svd.solve(&own, RANK_TOL * svd.singular_values.max()) else { continue };
            for (size, frame) in sizes.iter().zip(of_frame) {
                column.iter_mut().zip(frame).for_each(|(own, frame)| *own -= size * frame);
            }
        }
    }

    fn n_axes(&self) -> usize {
        if self.oriented { 6 } else { 3 }
    }

    /// The axes of a motion of the tool: x, y, z, and of a pose those about x, y, z.
    /// The measured positions, rows × axes.
    fn positions(&self) -> Vec<f64> {
        let of = |pose: &Pose<f64>| Twist { linear: pose.position, angular: Vec3::zeros() };
        self.measured.iter().flat_map(|pose| self.axes(of(pose))).collect()
    }

    fn axes(&self, Twist { linear, angular }: Twist<f64>) -> impl Iterator<Item = f64> {
        [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z].into_iter().take(self.n_axes())
    }
}

/// The motion from a measured pose to the predicted one, in the instrument's frame.
fn residual(predicted: &Pose<f64>, measured: &Pose<f64>) -> Twist<f64> {
    Twist {
        angular: rotation_log(&(predicted.rotation * measured.rotation.transpose())),
        linear: predicted.position - measured.position,
    }
}

#[cfg(test)]
mod tests;
