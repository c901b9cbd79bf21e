//! Poses of the tool that a camera or another program measures, and the residual against the prediction.
//!
//! Residual: predicted less measured pose, position in the axes of the base in m, rotation as the vector of
//! R_predicted · R_measuredᵀ in rad, as in the diagnosis. It is formed of poses that were measured while the arm rested in the
//! posture of the picture, by their mean: a pose of a moving arm, or of an earlier word, is compared with nothing.

use darm_core::real::Vec3;
use darm_core::se::{Pose, rotation_exp, rotation_log};
use serde::Serialize;

use crate::picture::Tool;

/// About how many poses the mean is of: what drifts is followed.
const MEAN_OF: u32 = 100;

/// Where measured poses come from.
pub struct PoseSource {
    /// As a person named it.
    pub name: String,
    /// Opens it; the error is a sentence.
    pub open: Box<dyn FnMut() -> Result<Box<dyn PoseReader>, String> + Send>,
}

/// An open source.
pub trait PoseReader {
    /// What was measured since the last call, oldest first.
    ///
    /// # Errors
    ///
    /// The source is lost, or sends what cannot be read; in a sentence.
    fn read(&mut self) -> Result<Vec<MeasuredPose>, String>;
}

/// One measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredPose {
    /// Unix time.
    pub time_s: f64,
    /// Pose of the tool in the base.
    pub pose: Pose<f64>,
    /// Supply; `None` where the source does not measure it.
    pub supply_bar: Option<f64>,
    /// Temperature of the arm, °C; `None` as well.
    pub temperature_c: Option<f64>,
}

/// What was measured, and of which posture.
#[derive(Debug, Default)]
pub(crate) struct Measured {
    source: Option<String>,
    problem: Option<String>,
    newest: Option<MeasuredPose>,
    /// Unix time since which the arm rests in the posture of the picture.
    rests_since_s: f64,
    rest: Option<Rest>,
}

/// Mean of the poses of one rest.
#[derive(Clone, Copy, Debug)]
struct Rest {
    first: Pose<f64>,
    n: u32,
    position: Vec3<f64>,
    /// Rotation vector from the first pose, in the base.
    turn: Vec3<f64>,
}

/// What pages show of measured poses.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeasuredView {
    /// Where they come from.
    pub source: String,
    /// Why none arrive.
    pub problem: Option<String>,
    /// Age of the newest, s.
    pub age_s: Option<f64>,
    /// Number of poses that the mean is of; 0 while the arm moves, or before a pose of this rest.
    pub n: u32,
    /// The mean of this rest, else the newest pose.
    pub tool: Option<Tool>,
    /// Predicted less measured pose, of this rest.
    pub residual: Option<Residual>,
    /// The newest supply, bar.
    pub supply_bar: Option<f64>,
    /// The newest temperature, °C.
    pub temperature_c: Option<f64>,
}

/// Predicted less measured pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Residual {
    /// Along x, y and z of the base, m.
    pub position_m: [f64; 3],
    /// Rotation vector in the base, rad.
    pub rotation_rad: [f64; 3],
}

impl Residual {
    /// Of two poses.
    pub fn of(predicted: &Pose<f64>, measured: &Pose<f64>) -> Self {
        let turn = rotation_log(&(predicted.rotation * measured.rotation.transpose()));
        Self { position_m: (predicted.position - measured.position).into(), rotation_rad: turn.into() }
    }
}

impl Rest {
    fn new(first: &Pose<f64>) -> Self {
        Self { first: *first, n: 0, position: first.position, turn: Vec3::zeros() }
    }

    fn add(mut self, pose: &Pose<f64>) -> Self {
        self.n += 1;
        let share = 1.0 / f64::from(self.n.min(MEAN_OF));
        self.position += (pose.position - self.position) * share;
        let turn = rotation_log(&(pose.rotation * self.first.rotation.transpose()));
        self.turn += (turn - self.turn) * share;
        self
    }

    fn mean(&self) -> Pose<f64> {
        Pose { position: self.position, rotation: rotation_exp(&self.turn) * self.first.rotation }
    }
}

impl Measured {
    pub(crate) fn set_source(&mut self, name: &str) {
        self.source = Some(name.to_owned());
    }

    /// The source is lost.
    pub(crate) fn set_problem(&mut self, problem: String) {
        self.problem = Some(problem);
    }

    /// The arm goes to another posture, and rests there from then on.
    pub(crate) fn moves(&mut self, rests_since_s: f64) {
        (self.rests_since_s, self.rest) = (rests_since_s, None);
    }

    pub(crate) fn add(&mut self, poses: &[MeasuredPose]) {
        self.problem = None;
        self.newest = poses.last().copied().or(self.newest);
        for MeasuredPose { pose, .. } in poses.iter().filter(|pose| pose.time_s >= self.rests_since_s) {
            self.rest = Some(self.rest.unwrap_or_else(|| Rest::new(pose)).add(pose));
        }
    }

    /// What pages show; `None` without a source.
    pub(crate) fn view(&self, predicted: Option<&Tool>, now_s: f64) -> Option<MeasuredView> {
        let mean = self.rest.map(|rest| rest.mean());
        let residual = predicted.zip(mean).map(|(predicted, mean)| Residual::of(&predicted.pose(), &mean));
        Some(MeasuredView {
            source: self.source.clone()?,
            problem: self.problem.clone(),
            age_s: self.newest.map(|newest| (now_s - newest.time_s).max(0.0)),
            n: self.rest.map_or(0, |rest| rest.n),
            tool: mean.or(self.newest.map(|newest| newest.pose)).map(|pose| Tool::of(&pose)),
            residual,
            supply_bar: self.newest.and_then(|newest| newest.supply_bar),
            temperature_c: self.newest.and_then(|newest| newest.temperature_c),
        })
    }
}

#[cfg(test)]
mod tests {
    use darm_core::real::Vec3;
    use darm_core::se::Pose;

    use super::{Measured, MeasuredPose};
    use crate::picture::Tool;

    /// 1 µm and 1 µrad.
    const NEAR: f64 = 1e-6;

    fn pose(time_s: f64, x: f64, turn: f64) -> MeasuredPose {
        let pose = Pose::new(&Vec3::new(0.0, 0.0, turn), Vec3::new(x, 2.0, 0.0));
        MeasuredPose { time_s, pose, supply_bar: None, temperature_c: None }
    }

    #[test]
    fn the_residual_is_of_the_mean_of_the_poses_of_this_rest() {
        let mut measured = Measured::default();
        let predicted = Tool::of(&pose(0.0, 1.0, 0.5).pose);
        assert!(measured.view(Some(&predicted), 0.0).is_none(), "no source");
        measured.set_source("sim");
        measured.moves(10.0);
        measured.add(&[pose(9.0, 5.0, 0.0)]);
        let view = measured.view(Some(&predicted), 11.0).unwrap();
        assert_eq!((view.residual, view.n, view.age_s), (None, 0, Some(2.0)), "it was measured before the arm rested");
        measured.add(&[pose(10.0, 1.2, 0.4), pose(10.1, 1.4, 0.2)]);
        let residual = measured.view(Some(&predicted), 11.0).unwrap().residual.unwrap();
        assert!((residual.position_m[0] + 0.3).abs() < NEAR && residual.position_m[1].abs() < NEAR, "{residual:?}");
        assert!((residual.rotation_rad[2] - 0.2).abs() < NEAR, "{residual:?}");
        measured.moves(20.0);
        assert_eq!(measured.view(Some(&predicted), 11.0).unwrap().residual, None, "the arm moves");
    }
}
