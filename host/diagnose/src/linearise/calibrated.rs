//! The robot that a calibration found: its joints and its tool where the effects put them.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_robot::robot::Robot;

use crate::effect::Law;
use crate::linearise::model_effects::ModelEffect;
use crate::linearise::serial_chain::{across, site_of_joint};

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
pub fn calibrated(robot: &Robot, tool: Option<&str>, effects: &[ModelEffect]) -> Result<Robot, NotRigid> {
    let mut calibrated = robot.clone();
    let tool = robot.frame_or_tool(tool);
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
                let turn = Vec3::new(value("turn about x"), value("turn about y"), value("turn about z"));
                frame.pose = frame.pose * Pose::new(&turn, vector());
            }
            Law::JointOffset => changes[joint.ok_or_else(none)?].2 += value("offset"),
            Law::LinkError => changes[joint.ok_or_else(none)?].0 += vector(),
            Law::AxisError => {
                let k = joint.ok_or_else(none)?;
                let [first, second] = across(&robot.joints[path[k]].joint.axis.direction);
                changes[k].1 += first * value("first turn across") + second * value("second turn across");
            }
            // Where the instrument is moves no part of the robot.
            Law::SensorFrame => {}
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linearise::faulty_robot::panda;
    use crate::linearise::serial_chain::{PER_JOINT, SerialChain};

    #[test]
    fn the_calibrated_robot_is_where_the_effects_put_the_tool() {
        let robot = panda();
        let tool = robot.frame("ball_link").unwrap();
        let (path, q) = (robot.path(tool), [0.1, -0.4, 0.3, -1.2, 0.2, 0.9, -0.5]);
        let chain = SerialChain::in_postures(&robot, tool, [q.to_vec()].into_iter(), true);
        let mut values = vec![0.0; chain.n_values()];
        for k in 0..path.len() {
            (0..6).for_each(|value| values[k * PER_JOINT + value] = 1e-3 * (k * 6 + value) as f64);
        }
        values[path.len() * PER_JOINT + 1] = 0.02;
        values[path.len() * PER_JOINT + 4] = 0.01;
        let expected = chain.frames(&values)[0].tool;
        let named = |law, place: &str, names: &[&str], first: usize| ModelEffect {
            law,
            place: place.into(),
            constant: None,
            values: names.iter().enumerate().map(|(k, name)| ((*name).to_owned(), values[first + k])).collect(),
            points: Vec::new(),
        };
        const TOOL: [&str; 6] = ["x", "y", "z", "turn about x", "turn about y", "turn about z"];
        let mut effects = vec![named(Law::ToolFrame, "the tool", &TOOL, path.len() * PER_JOINT)];
        for (k, &joint) in path.iter().enumerate() {
            let place = site_of_joint(&robot, k, joint).code;
            effects.push(named(Law::JointOffset, &place, &["offset"], k * PER_JOINT));
            effects.push(named(
                Law::AxisError,
                &place,
                &["first turn across", "second turn across"],
                k * PER_JOINT + 1,
            ));
            effects.push(named(Law::LinkError, &place, &["x", "y", "z"], k * PER_JOINT + 3));
        }
        let found = calibrated(&robot, Some("ball_link"), &effects).unwrap();
        let all = [&q[..], &vec![0.0; robot.joints.len() - q.len()]].concat();
        let pose = found.kinematics(found.frame("ball_link").unwrap(), &all).unwrap().pose_base_frame;
        assert!((pose.position - expected.position).norm() < 1e-12, "{} {}", pose.position, expected.position);
        assert!((pose.rotation - expected.rotation).norm() < 1e-12);
        effects[1].law = Law::JointCompliance;
        let error = calibrated(&robot, Some("ball_link"), &effects).unwrap_err().to_string();
        assert!(error.starts_with("joint-compliance at joint 1 (panda_joint1) depends on the load"), "{error}");
        effects[1].place = "joint 9 (x)".into();
        effects[1].law = Law::JointOffset;
        assert!(matches!(calibrated(&robot, Some("ball_link"), &effects), Err(NotRigid::NoSuchPlace { .. })));
    }
}
