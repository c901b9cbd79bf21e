//! The robot that a point-contact calibration found: its joints and its tool where the effects put them.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_robot::robot::Robot;

use super::{Points, across, site_of_joint};
use crate::effect::Law;
use crate::linearise::model_effects::ModelEffect;

/// Why a calibrated model is no robot of rigid links.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NotRigid {
    /// An effect changes with the posture or the load.
    #[error(
        "{law} at {place} depends on the {on}, and this command computes rigid links: use a copy of the file without this \
         [[effect]], if what it explains is small enough to neglect"
    )]
    Depends {
        /// The law.
        law: Law,
        /// Where it acts.
        place: String,
        /// What it depends on.
        on: &'static str,
    },
    /// An effect at a place that the robot does not have.
    #[error("the model has {law} at {place}, and its robot has no such place: is this the right URDF?")]
    NoSuchPlace {
        /// The law.
        law: Law,
        /// The place.
        place: String,
    },
}

/// The robot with the geometric effects of a calibration in its joints and its tool: `joint-offset`, `axis-error`,
/// `link-error`, `tool-frame`. Positions are those that the encoders show, limits stay as they are.
///
/// # Errors
///
/// Effects that depend on posture or load, or that the robot has no place for.
pub fn calibrated(robot: &Robot, points: &Points, effects: &[ModelEffect]) -> Result<Robot, NotRigid> {
    let mut calibrated = robot.clone();
    let tool = robot.frame_or_tool(points.tool.as_deref());
    let path = tool.map_or(Vec::new(), |tool| robot.path(tool));
    let nominal: Vec<Pose<f64>> = robot.joints.iter().map(|joint| joint.joint.placement).collect();
    let mut changes = vec![(Vec3::zeros(), Vec3::zeros(), 0.0); path.len()];
    for effect in effects {
        let value = |name: &str| effect.values.get(name).copied().unwrap_or(0.0);
        let vector = || Vec3::new(value("x"), value("y"), value("z"));
        let depends = |on| NotRigid::Depends { law: effect.law, place: effect.place.clone(), on };
        let none = || NotRigid::NoSuchPlace { law: effect.law, place: effect.place.clone() };
        let joint = path.iter().enumerate().position(|(k, &joint)| site_of_joint(robot, k, joint).code == effect.place);
        match effect.law {
            Law::ToolFrame => {
                let name = tool.map(|tool| tool.name.clone()).ok_or_else(none)?;
                let frame = calibrated.frames.iter_mut().find(|frame| frame.name == name).ok_or_else(none)?;
                frame.pose = frame.pose * Pose::at(vector());
            }
            Law::JointOffset => changes[joint.ok_or_else(none)?].2 += value("offset"),
            Law::LinkError => changes[joint.ok_or_else(none)?].0 += vector(),
            Law::AxisError => {
                let k = joint.ok_or_else(none)?;
                let [first, second] = across(&robot.joints[path[k]].joint.axis.direction);
                changes[k].1 += first * value("first turn across") + second * value("second turn across");
            }
            Law::JointCompliance | Law::LinkCompliance => return Err(depends("load")),
            _ => return Err(depends("posture")),
        }
    }
    for (&joint, (shift, turn, offset)) in path.iter().zip(changes) {
        let own = &mut calibrated.joints[joint].joint;
        let turned = Pose::new(&turn, Vec3::zeros()) * Pose::new(&(own.axis.direction * offset), Vec3::zeros());
        own.placement = Pose::at(shift) * nominal[joint] * turned;
    }
    Ok(calibrated)
}
