//! Why no geometry was found that meets all frames: what keeps the nearest one from them.

use std::fmt;

use darm_core::actuator::Stage;
use nalgebra::DVector;
use serde::Serialize;

use super::assembly::digits;
use super::problem::Problem;

/// A bound that is as near as this, m or rad, holds.
const AT_A_BOUND: f64 = 1e-6;
/// A platform whose scaled determinant is smaller is singular, or so near that its legs hardly hold it.
const SINGULAR: f64 = 0.03;
/// The search has settled where the error falls by less than this share per share of the stops altered.
const SETTLED: f64 = 1e-4;

/// What keeps the nearest geometry from the frames.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Infeasibility {
    /// Bounds on the stops of these actuators, by their names.
    Bounds(Vec<String>),
    /// A platform is about to leave its assembly mode.
    Singular {
        /// The module, by its name.
        module: String,
        /// The frame, by its name.
        frame: String,
    },
    /// A step nearer would leave a module without a pose in a setting of its actuators.
    Words {
        /// The module, by its name.
        module: String,
        /// A digit for each of its actuators.
        setting: String,
    },
    /// No small change of any stop brings the tool nearer: the arm is stretched towards frames that are out of reach, or
    /// is in a hollow that only another start leads out of.
    OutOfReach,
    /// The search stopped where a small change of the stops still brings the tool nearer, but too little to be followed.
    Unsettled,
}

impl fmt::Display for Infeasibility {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bounds(names) => write!(f, "bounds hold back {}: widen them", names.join(", ")),
            Self::Singular { module, frame } => {
                write!(f, "{module} is about to leave its assembly mode in {frame}: move its anchors, or that frame")
            }
            Self::Words { module, setting } => write!(
                f,
                "{module} could hardly be assembled with its actuators at {setting}: give the words that tables use with \
                 --table-words, or move its anchors"
            ),
            Self::OutOfReach => write!(
                f,
                "no bound holds them back and no small change of a stop brings the tool nearer: they are out of reach, or \
                 more --starts find another way"
            ),
            Self::Unsettled => {
                write!(f, "no bound holds them back, but no step leads on: they are too far off, or need more --starts")
            }
        }
    }
}

/// What keeps the geometry of `unknowns` from the frames.
pub(super) fn of(problem: &mut Problem, unknowns: &DVector<f64>) -> Infeasibility {
    let at_bounds = problem.at_bounds(unknowns, AT_A_BOUND);
    if !at_bounds.is_empty() {
        return Infeasibility::Bounds(at_bounds);
    }
    if let Some((stage, frame)) = singular(problem, unknowns) {
        let module = problem.base_line().stage_name(stage);
        return Infeasibility::Singular { module, frame: problem.targets[frame].name.clone() };
    }
    if let Some((stage, setting)) = problem.nearly_lost(unknowns) {
        return Infeasibility::Words { module: problem.base_line().stage_name(stage), setting: digits(&setting) };
    }
    match problem.linearise(unknowns) {
        Ok((residual, jacobian)) => {
            let falls = jacobian.tr_mul(&residual).norm();
            if falls < SETTLED * jacobian.norm() * residual.norm() {
                Infeasibility::OutOfReach
            } else {
                Infeasibility::Unsettled
            }
        }
        Err(_) => Infeasibility::Unsettled,
    }
}

/// The stage and the frame of the platform that is nearest to singular, if it is.
fn singular(problem: &mut Problem, unknowns: &DVector<f64>) -> Option<(usize, usize)> {
    let postures = problem.postures(unknowns).ok()?;
    let stages = &problem.base_line().model.chain.stages;
    let determinants = postures.iter().enumerate().flat_map(|(frame, poses)| {
        stages.iter().zip(poses).enumerate().filter_map(move |(stage, (platform, pose))| match platform {
            Stage::Planar(platform) => Some((platform.determinant(pose).abs(), stage, frame)),
            Stage::Spatial(platform) => Some((platform.determinant(pose).abs(), stage, frame)),
            _ => None,
        })
    });
    let smallest = determinants.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (smallest.0 < SINGULAR).then_some((smallest.1, smallest.2))
}
