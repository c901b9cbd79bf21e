//! Inverse kinematics of a robot by name: its joints before a frame as an [`Arm`], and back to its coordinates.

use darm_core::actuator::JointKind;
use darm_core::ik::error;
use darm_core::se::Pose;
use darm_core::tree::TreeError;

use super::{Robot, RobotFrame};
use crate::ik::arm::{Arm, ArmJoint, Problem, Variable};
use crate::ik::configurations::{Configurations, configurations};
use crate::ik::method::{Solution, solve};
use crate::ik::search::Settings;
use crate::ik::trials::{self, Experiment, Trials};
use crate::ik::{Method, Options, Residual, Status};

/// Joint positions that bring a frame to its target, or as near as was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Inverse {
    /// How the search ended.
    pub status: Status,
    /// Coordinates within the limits, rad or m.
    pub q: Vec<f64>,
    /// Where they bring the frame in the base.
    pub pose: Pose<f64>,
    /// Distance from the target, m.
    pub error_m: f64,
    /// Angle from the target, rad.
    pub error_rad: f64,
    /// Whether no small motion within the limits brings the frame nearer: √(|Δp|² + ℓ²θ²) of the options that count.
    pub is_minimum: bool,
    /// Steps of all starts.
    pub steps: usize,
    /// Starts.
    pub starts: usize,
    /// The error before each step of the last start, and at its end. Of a population the least √(|Δp|² + ℓ²θ²) after
    /// each iteration, expressed as a distance.
    pub history: Vec<Residual>,
}

/// The joints that move a frame, and the coordinates of the robot that are their variables.
struct Chain {
    arm: Arm,
    variables: Vec<usize>,
    /// All coordinates within their limits.
    start: Vec<f64>,
}

impl Chain {
    fn of(robot: &Robot, frame: &RobotFrame, q: &[f64]) -> Self {
        let coupling = robot.coupling();
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        let limits: Vec<_> =
            coupling.coordinates().iter().map(|&joint| robot.joints[joint].limits.unwrap_or(free)).collect();
        let inside = |(k, [low, high]): (usize, &[f64; 2])| q.get(k).copied().unwrap_or(0.0).max(*low).min(*high);
        let start: Vec<f64> = limits.iter().enumerate().map(inside).collect();
        let path = robot.path(frame);
        let mut variables: Vec<usize> = path.iter().map(|&joint| coupling.rows()[joint].coordinate).collect();
        variables.sort_unstable();
        variables.dedup();
        variables.retain(|&coordinate| limits[coordinate][0] < limits[coordinate][1]);
        let joint = |&joint: &usize| {
            let (row, geometry) = (coupling.rows()[joint], &robot.joints[joint].joint);
            let variable = variables.binary_search(&row.coordinate).ok();
            let constant = if variable.is_none() { row.factor * start[row.coordinate] } else { 0.0 };
            let (axis, placement, offset) = (geometry.axis, geometry.placement, row.offset + constant);
            ArmJoint { axis, placement, variable, factor: row.factor, offset }
        };
        let is_angle =
            |coordinate: usize| robot.joints[coupling.coordinates()[coordinate]].joint.axis.kind == JointKind::Revolute;
        let arm = Arm {
            joints: path.iter().map(joint).collect(),
            tool: frame.pose,
            variables: variables.iter().map(|&k| Variable { limits: limits[k], is_angle: is_angle(k) }).collect(),
        };
        Self { arm, variables, start }
    }

    /// The variables at the start.
    fn x(&self) -> Vec<f64> {
        self.variables.iter().map(|&coordinate| self.start[coordinate]).collect()
    }

    /// All coordinates of the robot: those that do not move the frame stay at the start.
    fn expand(&self, x: &[f64]) -> Vec<f64> {
        let mut all = self.start.clone();
        self.variables.iter().zip(x).for_each(|(&coordinate, x)| all[coordinate] = *x);
        all
    }
}

impl Robot {
    /// Coordinates that bring `frame` to `target` in the base, from the start `q` (rad or m): see [`solve`]. Coordinates
    /// that do not move the frame stay at `q`, within their limits.
    ///
    /// # Errors
    ///
    /// A robot that [`Robot::link_tree`] refuses.
    pub fn inverse(
        &self,
        method: Method,
        frame: &RobotFrame,
        target: &Pose<f64>,
        q: &[f64],
        options: &Options<f64>,
    ) -> Result<Inverse, TreeError> {
        self.link_tree()?;
        let chain = Chain::of(self, frame, q);
        let (mut history, mut last) = (Vec::new(), 0);
        let problem = Problem { arm: &chain.arm, target, options };
        let found = solve(method, problem, &chain.x(), |start, error| {
            if start != last {
                history.clear();
                last = start;
            }
            history.push(error.into());
        });
        let Solution { status, x, is_minimum, steps, starts } = found;
        let pose = chain.arm.pose(&x);
        let Residual { error_m, error_rad } = Residual::from(&error(target, &pose));
        let q = chain.expand(&x);
        Ok(Inverse { status, q, pose, error_m, error_rad, is_minimum, steps, starts, history })
    }

    /// The runs of an experiment that brings `frame` to `target`: see [`trials::run`].
    ///
    /// # Errors
    ///
    /// As [`link_tree`](Self::link_tree).
    pub fn trials(
        &self,
        frame: &RobotFrame,
        target: &Pose<f64>,
        experiment: &Experiment<'_>,
    ) -> Result<Trials, TreeError> {
        self.link_tree()?;
        let &Experiment { method, options, settings, runs } = experiment;
        let chain = Chain::of(self, frame, &[]);
        let problem = Problem { arm: &chain.arm, target, options };
        let run = |seed| trials::run(method, problem, &Settings { seed, ..*settings });
        let mut trials = Trials::new(runs, settings.seed, run);
        trials.runs.iter_mut().for_each(|run| run.x = chain.expand(&run.x));
        Ok(trials)
    }

    /// All postures that bring `frame` to `target`, those nearest to `q` first: see [`configurations`]. Coordinates that
    /// do not move the frame stay at `q`.
    ///
    /// # Errors
    ///
    /// As [`link_tree`](Self::link_tree).
    pub fn configurations(
        &self,
        frame: &RobotFrame,
        target: &Pose<f64>,
        q: &[f64],
        options: &Options<f64>,
        max_count: usize,
    ) -> Result<Configurations, TreeError> {
        self.link_tree()?;
        let chain = Chain::of(self, frame, q);
        let problem = Problem { arm: &chain.arm, target, options };
        let mut found = configurations(problem, &chain.x(), max_count);
        found.postures.iter_mut().for_each(|posture| posture.q = chain.expand(&posture.q));
        Ok(found)
    }
}
