//! Dimensions of a scene: lengths of legs and links, angles of joints and plates, the pose of the tool.

use darm_core::actuator::{JointKind, Stage};
use darm_core::real::Vec3;
use darm_core::se::{Pose, Pose2};
use darm_core::tree::TreeError;

use super::Scene;
use crate::arm::{Arm, ArmScratch};
use darm_robot::robot::{Robot, RobotFrame};

/// A dimension, written beside the picture with a line that leads to its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Dimension {
    /// What and how much, with the unit.
    pub text: String,
    /// Its place in the base frame, m.
    pub at: Vec3<f64>,
}

/// Where the dimension of a leg is read, as a share of its length: above the number of its actuator.
const ON_LEG: f64 = 0.6;

impl Scene {
    /// Adds the dimensions of an arm in the posture that `scratch` was left in. Legs and joints have the number of their actuator.
    pub fn add_dimensions_of_arm(&mut self, arm: &Arm, scratch: &ArmScratch) {
        let chain = &arm.model.chain;
        let (mut actuator, mut servo) = (0, 0);
        let mut below = chain.mount;
        for (index, stage) in chain.stages.iter().enumerate() {
            let (top, value) = (scratch.tops[index], scratch.settings[index][0].value);
            match stage {
                Stage::Planar(_) | Stage::Spatial(_) => {
                    for leg in 0..stage.n_actuators() {
                        let setting = scratch.settings[index][leg];
                        let (from, to) = (below * setting.base, top * setting.top);
                        self.dimension(
                            format!("{}: {}", actuator + leg, mm((to - from).norm())),
                            from + (to - from) * ON_LEG,
                        );
                    }
                    let turned = turn(&scratch.stages[index], self.is_planar);
                    self.dimension(format!("{}: {turned}", arm.stage_name(index)), top.position);
                }
                Stage::Discrete(joint) => {
                    self.dimension(format!("{actuator}: {}", joint_value(joint.axis.kind, value)), top.position);
                }
                Stage::Servo(joint) => {
                    self.dimension(format!("servo {servo}: {}", joint_value(joint.axis.kind, value)), top.position);
                    servo += 1;
                }
                Stage::Link(_) => {
                    let along = top.position - below.position;
                    if along.norm() > 1e-9 {
                        self.dimension(mm(along.norm()), below.position + along * 0.5);
                    }
                }
            }
            actuator += stage.n_actuators();
            below = top;
        }
        self.tool_dimension(&scratch.pose_base_tool);
    }

    /// Adds the dimensions of a robot at the positions `q`, rad or m: lengths between joints, and the joints' positions.
    ///
    /// # Errors
    ///
    /// The joints of the robot make no tree, or are more than are computed.
    pub fn add_dimensions_of_robot(&mut self, robot: &Robot, tool: &RobotFrame, q: &[f64]) -> Result<(), TreeError> {
        let mut origins = Vec::new();
        for (index, (joint, value)) in robot.joints.iter().zip(q).enumerate() {
            let frame = RobotFrame { name: String::new(), joint: Some(index), pose: Pose::identity(), is_end: false };
            let origin = robot.kinematics(&frame, q)?.pose_base_frame.position;
            let parent = joint.joint.parent.map_or(Vec3::zeros(), |parent: usize| origins[parent]);
            let along: Vec3<f64> = origin - parent;
            if along.norm() > 1e-9 {
                self.dimension(mm(along.norm()), parent + along * 0.5);
            }
            self.dimension(format!("{}: {}", joint.name, joint_value(joint.joint.axis.kind, *value)), origin);
            origins.push(origin);
        }
        self.tool_dimension(&robot.kinematics(tool, q)?.pose_base_frame);
        Ok(())
    }

    fn tool_dimension(&mut self, pose: &Pose<f64>) {
        let p = pose.position * 1e3;
        let at = if self.is_planar {
            format!("{:.1}, {:.1} mm", p.x, p.y)
        } else {
            format!("{:.1}, {:.1}, {:.1} mm", p.x, p.y, p.z)
        };
        self.dimension(format!("tool: {at}"), pose.position);
        self.dimension(format!("tool: {}", turn(pose, self.is_planar)), pose.position);
    }

    fn dimension(&mut self, text: String, at: Vec3<f64>) {
        self.dimensions.push(Dimension { text, at });
    }
}

fn mm(length_m: f64) -> String {
    format!("{:.1} mm", 1e3 * length_m)
}

fn joint_value(kind: JointKind, value: f64) -> String {
    match kind {
        JointKind::Revolute => format!("{:.1}°", value.to_degrees()),
        JointKind::Prismatic => mm(value),
    }
}

/// By how much a pose turns: in the plane with its sign.
fn turn(pose: &Pose<f64>, is_planar: bool) -> String {
    let angle_rad = if is_planar { Pose2::projection(pose).angle_rad } else { pose.angle_rad() };
    // A rounding error below zero is no -0.0°.
    format!("{:.1}°", angle_rad.to_degrees() + 0.0).replace("-0.0°", "0.0°")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::svg;
    use super::*;

    #[test]
    fn legs_plates_and_the_tool_have_their_dimensions() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4.toml");
        let arm = Arm::read(&path).unwrap();
        let mut scratch = ArmScratch::default();
        let word = "101000000000".parse().unwrap();
        arm.model.predict(&arm.working_condition(word, &[]), &mut scratch).unwrap();
        let mut scene = Scene::of_arm(&arm, &scratch, word.iter());
        assert!(!svg(&scene, true).contains("1250.0 mm"), "none before they are added");
        scene.add_dimensions_of_arm(&arm, &scratch);
        let texts: Vec<&str> = scene.dimensions.iter().map(|dimension| dimension.text.as_str()).collect();
        assert_eq!(texts[..3], ["0: 1250.0 mm", "1: 1414.2 mm", "2: 1250.0 mm"]);
        assert_eq!(texts.len(), 12 + 4 + 2);
        let picture = svg(&scene, true);
        assert!(texts.iter().all(|text| picture.contains(text)), "{picture}");
    }
}
