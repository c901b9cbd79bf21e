//! Inverse kinematics of a robot by name: the sizes of [`ik`](crate::ik) behind one function.

use darm_core::se::Pose;
use darm_core::tree::TreeError;

use super::{MAX_JOINTS, Robot, RobotFrame};
use crate::ik::configurations::{Configurations, configurations};
use crate::ik::search::Settings;
use crate::ik::trials::{self, Experiment, Trials};
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

/// The joints between the base and a frame as a robot of their own.
struct Serial {
    robot: Robot,
    tool: RobotFrame,
    /// The number of each of its joints in the robot that it was taken from.
    path: Vec<usize>,
}

impl Serial {
    /// The joints that move `frame`, where the robot has more joints than a [`Tree`](darm_core::tree::Tree) may have.
    fn of_large(robot: &Robot, frame: &RobotFrame) -> Option<Self> {
        if robot.joints.len() <= MAX_JOINTS {
            return None;
        }
        let path = robot.path(frame);
        let mut joints: Vec<_> = path.iter().map(|&joint| robot.joints[joint].clone()).collect();
        joints.iter_mut().enumerate().for_each(|(k, joint)| joint.joint.parent = k.checked_sub(1));
        let tool = RobotFrame { joint: joints.len().checked_sub(1), ..frame.clone() };
        let robot = Robot { joints, frames: vec![tool.clone()], ..robot.clone() };
        Some(Self { robot, tool, path })
    }

    fn start(&self, q: &[f64]) -> Vec<f64> {
        self.path.iter().map(|&joint| q.get(joint).copied().unwrap_or(0.0)).collect()
    }

    /// Positions of all joints of the robot: those that do not move the frame stay as they were.
    fn expand(&self, of: &Robot, q: &[f64], found: &[f64]) -> Vec<f64> {
        let mut all: Vec<f64> = (0..of.joints.len()).map(|joint| q.get(joint).copied().unwrap_or(0.0)).collect();
        self.path.iter().zip(found).for_each(|(&joint, position)| all[joint] = *position);
        all
    }
}

impl Robot {
    /// Joint positions that bring `frame` to `target` in the base, from the start `q` (rad or m): see [`ik::solve`].
    ///
    /// # Errors
    ///
    /// More than [`MAX_JOINTS`] joints between the base and the frame; of a robot with more joints than that, those that
    /// do not move the frame stay at `q`.
    pub fn inverse(
        &self,
        method: Method,
        frame: &RobotFrame,
        target: &Pose<f64>,
        q: &[f64],
        options: &Options<f64>,
    ) -> Result<Inverse, TreeError> {
        let Some(serial) = Serial::of_large(self, frame) else {
            return in_its_size!(self.inverse_of(method, frame, target, q, options));
        };
        let mut found =
            serial.robot.inverse_of::<MAX_JOINTS>(method, &serial.tool, target, &serial.start(q), options)?;
        found.q = serial.expand(self, q, &found.q);
        Ok(found)
    }

    /// The runs of an experiment that brings `frame` to `target`: see [`trials::run`].
    pub fn trials(
        &self,
        frame: &RobotFrame,
        target: &Pose<f64>,
        experiment: &Experiment<'_>,
    ) -> Result<Trials, TreeError> {
        let Some(serial) = Serial::of_large(self, frame) else {
            return in_its_size!(self.trials_of(frame, target, experiment));
        };
        let mut found = serial.robot.trials_of::<MAX_JOINTS>(&serial.tool, target, experiment)?;
        found.runs.iter_mut().for_each(|run| run.x = serial.expand(self, &[], &run.x));
        Ok(found)
    }

    /// All postures that bring `frame` to `target`, those nearest to `q` first: see [`configurations`]. Joints that
    /// do not move the frame stay at `q`.
    pub fn configurations(
        &self,
        frame: &RobotFrame,
        target: &Pose<f64>,
        q: &[f64],
        options: &Options<f64>,
        max_count: usize,
    ) -> Result<Configurations, TreeError> {
        let Some(serial) = Serial::of_large(self, frame) else {
            return in_its_size!(self.configurations_of(frame, target, q, (options, max_count)));
        };
        let start = serial.start(q);
        let mut found =
            serial.robot.configurations_of::<MAX_JOINTS>(&serial.tool, target, &start, (options, max_count))?;
        found.postures.iter_mut().for_each(|posture| posture.q = serial.expand(self, q, &posture.q));
        Ok(found)
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
        frame: &RobotFrame,
        target: &Pose<f64>,
        experiment: &Experiment<'_>,
    ) -> Result<Trials, TreeError> {
        let &Experiment { method, options, settings, runs } = experiment;
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
        (options, max_count): (&Options<f64>, usize),
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
        let mut found = configurations(&arm, target, &start, options, max_count);
        found.postures.iter_mut().for_each(|posture| posture.q.truncate(self.joints.len()));
        Ok(found)
    }

    /// The limits of all joints, infinite where there are none; joints past the last stand at 0.
    fn limits<const N: usize>(&self) -> [[f64; 2]; N] {
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        std::array::from_fn(|k| self.joints.get(k).map_or([0.0; 2], |joint| joint.limits.unwrap_or(free)))
    }
}
