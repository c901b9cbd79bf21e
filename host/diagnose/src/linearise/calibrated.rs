//! The robot that a calibration found: its joints and its tool where the effects put them.

use darm_core::actuator::JointKind;
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_robot::robot::Robot;

use crate::effect::LawName;
use crate::error::UnknownValue;
use crate::linearise::model_effects::ModelEffect;
use crate::linearise::serial_chain::{OFFSET, SHIFT, TOOL, TURNS, across, site_of_joint};

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
        law: LawName,
        /// Where it acts.
        place: String,
        /// What it depends on.
        on: &'static str,
    },
    /// An effect at a place that the robot does not have.
    #[error("the model has {law} at {place}, and its robot has no such place: is this the right URDF?")]
    NoSuchPlace {
        /// The law.
        law: LawName,
        /// The place.
        place: String,
    },
    /// A value that the law does not have.
    #[error(transparent)]
    Unknown(#[from] UnknownValue),
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
        let depends = |on| NotRigid::Depends { law: effect.law, place: effect.place.clone(), on };
        let none = || NotRigid::NoSuchPlace { law: effect.law, place: effect.place.clone() };
        let joint = path.iter().enumerate().position(|(k, &joint)| site_of_joint(robot, k, joint).code == effect.place);
        match effect.law {
            LawName::ToolFrame => {
                let name = tool.map(|tool| tool.name.clone()).ok_or_else(none)?;
                let frame = calibrated.frames.iter_mut().find(|frame| frame.name == name).ok_or_else(none)?;
                let [x, y, z, about_x, about_y, about_z] = effect.numbers(TOOL)?;
                frame.pose = frame.pose * Pose::new(&Vec3::new(about_x, about_y, about_z), Vec3::new(x, y, z));
            }
            LawName::JointOffset => changes[joint.ok_or_else(none)?].2 += effect.numbers(OFFSET)?[0],
            LawName::LinkError => changes[joint.ok_or_else(none)?].0 += Vec3::from(effect.numbers(SHIFT)?),
            LawName::AxisError => {
                let k = joint.ok_or_else(none)?;
                let [first, second] = across(&robot.joints[path[k]].joint.axis.direction);
                let turns = effect.numbers(TURNS)?;
                changes[k].1 += first * turns[0] + second * turns[1];
            }
            // Where the instrument is, and how long it shows 1 m, moves no part of the robot.
            LawName::SensorFrame | LawName::Scale => {}
            LawName::JointCompliance | LawName::LinkCompliance => return Err(depends("load")),
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

/// The robot with the joint offsets that its torques showed, and nothing else of a model of torques: of those no friction and no
/// tilt of the base moves the tool in the base's frame.
///
/// # Errors
///
/// An offset at a joint that the robot does not have.
pub fn with_joint_offsets(robot: &Robot, effects: &[ModelEffect]) -> Result<Robot, NotRigid> {
    let mut moved = robot.clone();
    for effect in effects.iter().filter(|effect| effect.law == LawName::JointOffset) {
        let is_meant = |&joint: &usize| site_of_joint(robot, joint, joint).code == effect.place;
        let none = || NotRigid::NoSuchPlace { law: effect.law, place: effect.place.clone() };
        let joint = (0..robot.joints.len()).find(is_meant).ok_or_else(none)?;
        let [offset] = effect.numbers(OFFSET)?;
        let own = &mut moved.joints[joint].joint;
        let along = own.axis.direction * offset;
        own.placement = own.placement
            * match own.axis.kind {
                JointKind::Revolute => Pose::new(&along, Vec3::zeros()),
                JointKind::Prismatic => Pose::at(along),
            };
    }
    Ok(moved)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linearise::faulty_robot_cases::panda;
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
            along: None,
            points: Vec::new(),
        };
        let mut effects = vec![named(LawName::ToolFrame, "the tool", &TOOL, path.len() * PER_JOINT)];
        for (k, &joint) in path.iter().enumerate() {
            let place = site_of_joint(&robot, k, joint).code;
            effects.push(named(LawName::JointOffset, &place, &OFFSET, k * PER_JOINT));
            effects.push(named(LawName::AxisError, &place, &TURNS, k * PER_JOINT + 1));
            effects.push(named(LawName::LinkError, &place, &SHIFT, k * PER_JOINT + 3));
        }
        let found = calibrated(&robot, Some("ball_link"), &effects).unwrap();
        let all = [&q[..], &vec![0.0; robot.joints.len() - q.len()]].concat();
        let pose = found.kinematics(found.frame("ball_link").unwrap(), &all).unwrap().pose_base_frame;
        assert!((pose.position - expected.position).norm() < 1e-12, "{} {}", pose.position, expected.position);
        assert!((pose.rotation - expected.rotation).norm() < 1e-12);
        effects[1].law = LawName::JointCompliance;
        let error = calibrated(&robot, Some("ball_link"), &effects).unwrap_err().to_string();
        assert!(error.starts_with("joint-compliance at joint 1 (panda_joint1) depends on the load"), "{error}");
        effects[1].place = "joint 9 (x)".into();
        effects[1].law = LawName::JointOffset;
        assert!(matches!(calibrated(&robot, Some("ball_link"), &effects), Err(NotRigid::NoSuchPlace { .. })));
        effects[1].place = site_of_joint(&robot, 0, path[0]).code;
        effects[1].values.insert("ofset".into(), 0.01);
        let error = calibrated(&robot, Some("ball_link"), &effects).unwrap_err().to_string();
        assert!(error.starts_with("joint-offset at joint 1 (panda_joint1) has no value \"ofset\""), "{error}");
    }

    #[test]
    fn an_offset_that_torques_showed_moves_the_tool_as_its_joint_would() {
        let robot = panda();
        let (tool, joint, offset) = (robot.frame("ball_link").unwrap(), 3, 0.02);
        let q = vec![0.1; robot.joints.len()];
        let mut moved = q.clone();
        moved[joint] += offset;
        let effect = |law, place: String| ModelEffect {
            law,
            place,
            constant: None,
            values: [("offset".to_owned(), offset)].into(),
            along: None,
            points: Vec::new(),
        };
        let code = site_of_joint(&robot, joint, joint).code;
        let friction = effect(LawName::CoulombFriction, code.clone());
        let found = with_joint_offsets(&robot, &[friction, effect(LawName::JointOffset, code)]).unwrap();
        let pose = |robot: &Robot, q: &[f64]| robot.kinematics(tool, q).unwrap().pose_base_frame.position;
        assert!((pose(&found, &q) - pose(&robot, &moved)).norm() < 1e-12);
        let elsewhere = with_joint_offsets(&robot, &[effect(LawName::JointOffset, "joint 9 (x)".into())]);
        assert!(matches!(elsewhere, Err(NotRigid::NoSuchPlace { .. })));
    }
}
