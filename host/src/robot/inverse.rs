//! Inverse kinematics of a robot by name: the sizes of [`ik`](crate::ik) behind one function.

use darm_core::se::Pose;
use darm_core::tree::TreeError;

use super::{MAX_JOINTS, Robot, RobotFrame};
use crate::ik::{self, Method, Options, Residual, Status};

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
        // Those of most arms in their own size, which J⁻¹ needs and which is faster.
        match self.joints.len() {
            6 => self.inverse_of::<6>(method, frame, target, q, options),
            7 => self.inverse_of::<7>(method, frame, target, q, options),
            _ => self.inverse_of::<MAX_JOINTS>(method, frame, target, q, options),
        }
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
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        let limits = std::array::from_fn(|k| self.joints.get(k).map_or([0.0; 2], |joint| joint.limits.unwrap_or(free)));
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
}
