//! Pictures: postures as lines in space ([`Scene`]) and their views as SVG ([`svg`]), charts, and the colours of both.

pub mod chart;
mod dimensions;
pub mod page;
pub mod palette;
mod views;

use darm_core::actuator::JointKind;
use darm_core::chain::ChainError;
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::TreeError;

use crate::arm::frames::DesiredFrame;
use crate::arm::{Arm, ArmScratch};
use darm_robot::robot::{Robot, RobotFrame};
pub use dimensions::Dimension;
pub use views::svg;

/// What a line shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// A rigid link.
    Link,
    /// A plate of a platform.
    Plate,
    /// A leg in its shortest state.
    Contracted,
    /// A leg in any other state.
    Extended,
    /// The axis of a joint that turns.
    Revolute,
    /// The axis of a joint that slides.
    Prismatic,
    /// An axis of the tool's frame: 0 is x, 1 is y, 2 is z.
    ToolAxis(u8),
}

impl Part {
    /// Its name: the class of its lines in an SVG, and its key in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Link => "link",
            Self::Plate => "plate",
            Self::Contracted => "contracted",
            Self::Extended => "extended",
            Self::Revolute => "revolute",
            Self::Prismatic => "prismatic",
            Self::ToolAxis(0) => "x",
            Self::ToolAxis(1) => "y",
            Self::ToolAxis(_) => "z",
        }
    }
}

/// A straight line in the base frame, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// What it shows.
    pub part: Part,
    /// Where it starts.
    pub from: Vec3<f64>,
    /// Where it ends.
    pub to: Vec3<f64>,
}

/// A leg with what is written at it.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// Number of its actuator.
    pub actuator: usize,
    /// Its name with its outputs and its state.
    pub label: String,
    /// Its lower end in the base frame, m.
    pub from: Vec3<f64>,
    /// Its upper end.
    pub to: Vec3<f64>,
}

/// One posture as lines.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// What it is a picture of.
    pub title: String,
    /// All lines.
    pub lines: Vec<Line>,
    /// The legs of an arm, whose lines are among `lines`.
    pub legs: Vec<Leg>,
    /// Names and the points they belong to, in the base frame, m.
    pub labels: Vec<(String, Vec3<f64>)>,
    /// Lengths and angles; empty unless they were added.
    pub dimensions: Vec<Dimension>,
    /// The centre of mass in the base frame, m, where there is mass.
    pub com: Option<Vec3<f64>>,
    /// Whether everything lies in the xy-plane.
    pub is_planar: bool,
}

impl Scene {
    /// A robot at the positions `q` (rad or m): joints with their axes, links between them, and the frame `tool`.
    ///
    /// # Errors
    ///
    /// The joints of the robot make no tree, or are more than are computed.
    pub fn of_robot(robot: &Robot, tool: &RobotFrame, q: &[f64]) -> Result<Self, TreeError> {
        let at =
            |joint: Option<usize>| RobotFrame { name: String::new(), joint, pose: Pose::identity(), is_end: false };
        let poses: Result<Vec<_>, _> = (0..robot.joints.len())
            .map(|joint| Ok::<_, TreeError>(robot.kinematics(&at(Some(joint)), q)?.pose_base_frame))
            .collect();
        let poses = poses?;
        let mut scene = Self { title: robot.name.clone(), ..Self::default() };
        let origin = |joint: Option<usize>| joint.map_or(Vec3::zeros(), |joint| poses[joint].position);
        for (joint, pose) in robot.joints.iter().zip(&poses) {
            scene.line(Part::Link, origin(joint.joint.parent), pose.position);
        }
        for (frame, pose) in robot.frames.iter().zip(robot.poses(q)?).filter(|(frame, _)| frame.is_end) {
            scene.line(Part::Link, origin(frame.joint), pose.position);
        }
        let arm = 0.05 * scene.size();
        for (joint, pose) in robot.joints.iter().zip(&poses) {
            let along = pose.rotation * joint.joint.axis.direction * arm;
            let part = match joint.joint.axis.kind {
                JointKind::Revolute => Part::Revolute,
                JointKind::Prismatic => Part::Prismatic,
            };
            scene.line(part, pose.position - along, pose.position + along);
            scene.labels.push((joint.name.clone(), pose.position));
        }
        let com = robot.com(q)?;
        scene.com = (com.mass_kg > 0.0).then_some(com.position);
        scene.axes(&robot.kinematics(tool, q)?.pose_base_frame);
        scene.is_planar = scene.lines.iter().filter(|line| line.part == Part::Link).all(Line::is_flat)
            && robot.joints.iter().zip(&poses).all(|(joint, pose)| {
                let z = (pose.rotation * joint.joint.axis.direction).z;
                let [turning, sliding] = [z.abs() > 1.0 - 1e-9, z.abs() < 1e-9];
                if joint.joint.axis.kind == JointKind::Revolute { turning } else { sliding }
            });
        Ok(scene)
    }

    /// An arm of stages in the posture that `scratch` was left in, and the digits that it was made with.
    pub fn of_arm(arm: &Arm, scratch: &ArmScratch, digits: impl Iterator<Item = u8>) -> Self {
        let chain = &arm.model.chain;
        let mut scene = Self { title: arm.name.clone(), is_planar: chain.is_planar(), ..Self::default() };
        let (mut digits, mut actuator) = (digits, 0);
        let mut below = chain.mount;
        for (index, stage) in chain.stages.iter().enumerate() {
            let top = scratch.tops[index];
            let legs = if stage.leg(0).is_some() { stage.n_actuators() } else { 0 };
            let settings = &scratch.settings[index][..legs];
            for (leg, setting) in settings.iter().enumerate() {
                let part = if digits.next().unwrap_or(0) > 0 { Part::Extended } else { Part::Contracted };
                let (from, to) = (below * setting.base, top * setting.top);
                scene.line(part, from, to);
                let label = format!("{}, {}", arm.actuator_label(actuator + leg), part.name());
                scene.legs.push(Leg { actuator: actuator + leg, label, from, to });
            }
            actuator += stage.n_actuators();
            scene.plate(&below, settings.iter().map(|setting| setting.base).collect());
            scene.plate(&top, settings.iter().map(|setting| setting.top).collect());
            if legs == 0 {
                digits.by_ref().take(stage.n_actuators()).for_each(drop);
                scene.line(Part::Link, below.position, top.position);
            }
            let outermost = settings.iter().map(|setting| top * setting.top).max_by(|a, b| a.x.total_cmp(&b.x));
            scene.labels.push((arm.stage_name(index), outermost.unwrap_or(top.position)));
            below = top;
        }
        scene.line(Part::Link, below.position, scratch.pose_base_tool.position);
        scene.axes(&scratch.pose_base_tool);
        scene
    }

    /// An arm as its model predicts it for the word of a desired frame, with the axes of that frame.
    ///
    /// # Errors
    ///
    /// The model has no pose for the frame's word and servo positions.
    pub fn of_frame(arm: &Arm, frame: &DesiredFrame) -> Result<Self, ChainError> {
        let mut scratch = ArmScratch::default();
        arm.model.predict(&arm.model.working(frame.word, frame.previous, &frame.servos_rad), &mut scratch)?;
        let mut scene = Self::of_arm(arm, &scratch, frame.word.iter());
        scene.title = format!("{}, {}, word {}", arm.name, frame.name, frame.word);
        scene.axes(&frame.pose_base_tool);
        scene.labels.push(("desired".to_owned(), frame.pose_base_tool.position));
        Ok(scene)
    }

    fn line(&mut self, part: Part, from: Vec3<f64>, to: Vec3<f64>) {
        if (to - from).norm() > 1e-9 {
            self.lines.push(Line { part, from, to });
        }
    }

    /// The outline of a plate: its anchors in the order of their angle about their middle, each once.
    fn plate(&mut self, frame: &Pose<f64>, mut anchors: Vec<Vec3<f64>>) {
        let middle = anchors.iter().sum::<Vec3<f64>>() / anchors.len().max(1) as f64;
        let angle = |anchor: &Vec3<f64>| (anchor.y - middle.y).atan2(anchor.x - middle.x);
        anchors.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
        anchors.dedup_by(|a, b| (*a - *b).norm() < 1e-9);
        for (k, anchor) in anchors.iter().enumerate() {
            let next = anchors[(k + 1) % anchors.len()];
            self.line(Part::Plate, *frame * *anchor, *frame * next);
        }
    }

    /// The axes of a frame, as those of the tool.
    pub fn axes(&mut self, pose: &Pose<f64>) {
        let arm = 0.12 * self.size();
        for axis in 0..3 {
            let along = Vec3::from(pose.rotation.column(axis)) * arm;
            self.line(Part::ToolAxis(axis as u8), pose.position, pose.position + along);
        }
    }

    /// Diagonal of the box around all lines, m.
    fn size(&self) -> f64 {
        let points = || self.lines.iter().flat_map(|line| [line.from, line.to]);
        let corner = |pick: fn(f64, f64) -> f64| points().reduce(|a, b| a.zip_map(&b, pick));
        match (corner(f64::min), corner(f64::max)) {
            (Some(low), Some(high)) => (high - low).norm().max(1e-6),
            _ => 1.0,
        }
    }
}

impl Line {
    fn is_flat(&self) -> bool {
        self.from.z.abs() < 1e-9 && self.to.z.abs() < 1e-9
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darm_robot::urdf::{self, Locks};

    fn panda() -> Robot {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/urdf/panda.urdf");
        urdf::read(&path, &Locks::new()).unwrap()
    }

    #[test]
    fn a_robot_in_space_is_shown_from_four_sides() {
        let robot = panda();
        let scene =
            Scene::of_robot(&robot, robot.tool().unwrap(), &[0.0, 0.5, 0.0, -1.6, 0.0, 2.0, 0.8, 0.02]).unwrap();
        assert!(!scene.is_planar);
        let count = |part| scene.lines.iter().filter(|line| line.part == part).count();
        assert_eq!((count(Part::Revolute), count(Part::Prismatic)), (7, 2));
        let picture = svg(&scene, true);
        for view in ["isometric", "front: x, z", "side: y, z", "top: x, y"] {
            assert!(picture.contains(view), "{view}");
        }
        assert!(!picture.contains("NaN") && !picture.contains("inf"));
    }

    #[test]
    fn a_robot_without_joints_is_a_picture_too() {
        let bare =
            urdf::parse(std::path::Path::new("b.urdf"), "<robot name=\"b\"><link name=\"l\"/></robot>", &Locks::new());
        let bare = bare.unwrap();
        let scene = Scene::of_robot(&bare, &bare.frames[0], &[]).unwrap();
        assert!(svg(&scene, true).starts_with("<svg"));
    }
}
