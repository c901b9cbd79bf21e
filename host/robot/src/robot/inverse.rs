//! Inverse kinematics of a robot by name: the sizes of [`ik`](crate::ik) behind one function.

use darm_core::se::Pose;
use darm_core::tree::TreeError;

use super::{MAX_JOINTS, Robot, RobotFrame};
use crate::ik::configurations::{Configurations, configurations};
use crate::ik::search::Settings;
use crate::ik::trials::{self, Trials};
use crate::ik::{self, Method, Options, Residual, Status};

/// Calls a method of const size with the least size that there is: those of most arms in their own, which J⁻¹ needs
/// and which is faster.
macro_rules! in_its_size {
    ($robot:ident.$call:ident($($argument:expr),*)) => {
        match $robot.joints.len() {
            4 => $robot.$call::<4>($($argument),*),
            6 => $robot.$call::<6>($($argument),*),
            7 => $robot.$call::<7>($($argument),*),
            _ => $robot.$call::<MAX_JOINTS>($($argument),*),
        }
    };
}

/// Joint positions that bring a frame to its target, or as near as was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Inverse {
    /// How the search ended.
    pub status: Status,
    /// Positions within the limits, rad or m.
    pub q: Vec<f64>,
    /// Where they bring the frame.
    pub pose: Pose<f64>,
    /// Distance from the target, m.
    pub error_m: f64,
    /// Angle from the target, rad.
    pub error_rad: f64,
    /// Steps of all starts.
    pub steps: usize,
    /// Starts.
    pub starts: usize,
    /// The error before each step of the last start, and at its end.
    pub history: Vec<Residual>,
}

impl Robot {
    /// Joint positions that bring `frame` to `target` in the base, from the start `q` (rad or m): see [`ik::solve`].
    pub fn inverse(
        &self,
        method: Method,
        frame: &RobotFrame,
        target: &Pose<f64>,
        q: &[f64],
        options: &Options<f64>,
    ) -> Result<Inverse, TreeError> {
        in_its_size!(self.inverse_of(method, frame, target, q, options))
    }

    /// `runs` runs of a method with the seeds from `settings.seed` on, each from a start of its own: see
    /// [`trials::run`].
    pub fn trials(
        &self,
        method: Method,
        frame: &RobotFrame,
        target: &Pose<f64>,
        options: &Options<f64>,
        settings: &Settings,
        runs: usize,
    ) -> Result<Trials, TreeError> {
        in_its_size!(self.trials_of(method, frame, target, (options, settings, runs)))
    }

    /// All postures that bring `frame` to `target`, those nearest to `q` first: see [`configurations`]. Joints that
    /// do not move the frame stay at `q`.
    pub fn configurations(
        &self,
        frame: &RobotFrame,
        target: &Pose<f64>,
        q: &[f64],
        options: &Options<f64>,
        most: usize,
    ) -> Result<Configurations, TreeError> {
        in_its_size!(self.configurations_of(frame, target, q, (options, most)))
    }

    fn inverse_of<const N: usize>(
        &self,
        method: Method,
        frame: &RobotFrame,
        target: &Pose<f64>,
        q: &[f64],
        options: &Options<f64>,
    ) -> Result<Inverse, TreeError> {
        let tree = self.tree::<N>()?;
        let tool = frame.in_tree(&tree);
        let limits = self.limits();
        let arm = ik::Arm { tree: &tree, tool: &tool, limits: &limits };
        let start = std::array::from_fn(|k| q.get(k).copied().unwrap_or(0.0));
        let ik::Traced { solution, history } = ik::solve(method, &arm, target, &start, options);
        Ok(Inverse {
            status: solution.status,
            q: solution.q[..self.joints.len()].to_vec(),
            pose: solution.pose,
            error_m: solution.error_m,
            error_rad: solution.error_rad,
            steps: solution.steps,
            starts: solution.starts,
            history,
        })
    }

    fn trials_of<const N: usize>(
        &self,
        method: Method,
        frame: &RobotFrame,
        target: &Pose<f64>,
        (options, settings, runs): (&Options<f64>, &Settings, usize),
    ) -> Result<Trials, TreeError> {
        let tree = self.tree::<N>()?;
        let tool = frame.in_tree(&tree);
        let limits = self.limits();
        let arm = ik::Arm { tree: &tree, tool: &tool, limits: &limits };
        let run = |seed| trials::run(method, &arm, target, options, &Settings { seed, ..*settings });
        let mut trials = Trials::new(runs, settings.seed, run);
        trials.runs.iter_mut().for_each(|run| run.x.truncate(self.joints.len()));
        Ok(trials)
    }

    fn configurations_of<const N: usize>(
        &self,
        frame: &RobotFrame,
        target: &Pose<f64>,
        q: &[f64],
        (options, most): (&Options<f64>, usize),
    ) -> Result<Configurations, TreeError> {
        let tree = self.tree::<N>()?;
        let tool = frame.in_tree(&tree);
        let start = std::array::from_fn(|k| q.get(k).copied().unwrap_or(0.0));
        let path = self.path(frame);
        let mut limits = self.limits();
        for (k, (limits, q)) in limits.iter_mut().zip(&start).enumerate() {
            if !path.contains(&k) {
                *limits = [*q; 2];
            }
        }
        let arm = ik::Arm { tree: &tree, tool: &tool, limits: &limits };
        let mut found = configurations(&arm, target, &start, options, most);
        found.postures.iter_mut().for_each(|posture| posture.q.truncate(self.joints.len()));
        Ok(found)
    }

    /// The limits of all joints, infinite where there are none; joints past the last stand at 0.
    fn limits<const N: usize>(&self) -> [[f64; 2]; N] {
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        std::array::from_fn(|k| self.joints.get(k).map_or([0.0; 2], |joint| joint.limits.unwrap_or(free)))
    }
}
