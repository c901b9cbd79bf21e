//! Input of the commands of kinematics and dynamics: an arm or a robot, and its postures.

mod calibrated;
mod locks;
mod postures;

use std::path::PathBuf;
use std::sync::Once;

use anyhow::Context as _;
use darm_arm::arm::{Arm, ArmScratch};
use darm_core::actuator::{JointKind, Stage};
use darm_core::chain::Parameter;
use darm_core::se::{Pose, Twist, Wrench, rotation_log};
use darm_diagnose::linearise::model::Predictor;
use darm_diagnose::linearise::model_effects::ModelEffect;
use darm_diagnose::linearise::torque::Transmission;
use darm_robot::mjcf::SITE;
use darm_robot::robot::{Jacobian, Kinematics, Robot, RobotFrame};
use darm_robot::source::{ModelKind, Source};

use crate::failure::Usage;
use crate::number_text::{number, numbers};
pub(crate) use locks::Part;
pub(crate) use postures::{Posture, listed};

/// The file and the postures.
#[derive(clap::Args, Debug)]
pub(crate) struct SubjectArgs {
    /// Arm file, Denavit-Hartenberg table, robot as URDF or MJCF, or its calibrated model from `darm diagnose`
    #[arg(value_name = "MODEL")]
    pub(crate) file: PathBuf,
    /// Joint positions, base first, in deg or mm, or with a unit: 0.5rad,0.2m; default: all 0
    #[arg(long, value_name = "Q,Q,…", allow_hyphen_values = true)]
    pub(crate) q: Option<String>,
    /// Digits of the discrete actuators, base first; default: all 0
    #[arg(long, value_name = "WORD")]
    pub(crate) word: Option<String>,
    /// Table of postures with the columns JOINT_deg, JOINT_mm, JOINT_rad, JOINT_m (or q1_deg, …), word
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["q", "word"])]
    pub(crate) postures: Option<PathBuf>,
    /// Fix a joint of a robot at a position, in deg or mm; the numbers of the joints after it move up
    #[arg(long = "lock", value_name = "JOINT=Q", allow_hyphen_values = true)]
    pub(crate) locks: Vec<String>,
    /// Read one tree of a URDF or MJCF: the one that begins with this link or body
    #[arg(long, value_name = "BODY")]
    pub(crate) root: Option<String>,
    /// Give a URDF or MJCF a floating base
    #[arg(long)]
    pub(crate) floating: bool,
}

/// Contents of the file.
pub(crate) enum Subject {
    /// Stages with discrete actuators and servos.
    Arm(Box<Arm>),
    /// Joints and links.
    Robot(Box<Robot>),
}

/// A coordinate: a joint, a servo or a discrete actuator.
#[derive(Clone, Debug)]
pub(crate) struct Coordinate {
    pub(crate) name: String,
    pub(crate) kind: JointKind,
}

impl Coordinate {
    /// The value in deg or mm.
    pub(crate) fn shown(&self, value: f64) -> f64 {
        match self.kind {
            JointKind::Revolute => value.to_degrees(),
            JointKind::Prismatic => 1e3 * value,
        }
    }

    pub(crate) fn unit(&self) -> &'static str {
        match self.kind {
            JointKind::Revolute => "deg",
            JointKind::Prismatic => "mm",
        }
    }

    /// Unit of the torque or force along it.
    pub(crate) fn load_unit(&self) -> &'static str {
        match self.kind {
            JointKind::Revolute => "N m",
            JointKind::Prismatic => "N",
        }
    }

    /// Parses a number with or without a unit; in rad or m.
    pub(crate) fn typed(&self, text: &str) -> Result<f64, Usage> {
        let text = text.trim();
        let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
        let factor = match (self.kind, text.get(digits.len()..).unwrap_or("")) {
            (JointKind::Revolute, "" | "deg") => std::f64::consts::PI / 180.0,
            (JointKind::Prismatic, "" | "mm") => 1e-3,
            (JointKind::Revolute, "rad") | (JointKind::Prismatic, "m") => 1.0,
            (_, unit) => {
                let units = if self.kind == JointKind::Revolute { "deg or rad" } else { "mm or m" };
                return Err(Usage(format!("{}: unit `{unit}` in `{text}` is invalid; use {units}", self.name)));
            }
        };
        Ok(number(digits, &self.name)? * factor)
    }
}

/// Transmission and effects of a model of torques.
pub(crate) struct Effects {
    pub(crate) transmission: Option<Transmission>,
    pub(crate) known: Vec<ModelEffect>,
}

impl SubjectArgs {
    /// Reads the file; of a model of torques, as `darm diagnose` uses it, with its effects.
    pub(crate) fn with_effects(&self) -> anyhow::Result<(Subject, Option<Effects>)> {
        let source = Source::read::<String>(&self.file)?;
        if source.kind() != ModelKind::Experiment {
            return Ok((self.subject_of(&source)?, None));
        }
        let (model, _) = self.part().model_of(&source)?;
        let Predictor::Torque(robot, transmission) = model.what else {
            let shown = self.file.display();
            let what = format!("{shown}: the model does not observe torques; add observed = \"torque\"");
            return Err(Usage(what).into());
        };
        if let Some(joint) = robot.joints.iter().find(|joint| joint.mimic.is_some()) {
            let what =
                format!("joint `{}` mimics another, and torques of a model do not; lock it in the model", joint.name);
            return Err(Usage(what).into());
        }
        if self.floating {
            return Err(Usage("--floating needs a URDF or MJCF".into()).into());
        }
        let effects = Effects { transmission, known: model.effects };
        Ok((Subject::Robot(Box::new(robot)), Some(effects).filter(|effects| !effects.known.is_empty())))
    }

    fn part(&self) -> Part<'_> {
        Part { locks: &self.locks, root: self.root.as_deref() }
    }

    /// Reads the file.
    pub(crate) fn subject(&self) -> anyhow::Result<Subject> {
        self.subject_of(&Source::read::<String>(&self.file)?)
    }

    fn subject_of(&self, source: &Source) -> anyhow::Result<Subject> {
        let robot = match source.kind() {
            ModelKind::Robot => self.part().robot_of(source)?,
            ModelKind::Experiment => calibrated::robot(source, self.part())?,
            ModelKind::Arm => {
                if self.floating || !self.locks.is_empty() || self.root.is_some() {
                    return Err(Usage("--floating, --lock and --root need a URDF or MJCF".into()).into());
                }
                return Ok(Subject::Arm(Box::new(Arm::of_source(source)?)));
            }
        };
        Ok(Subject::Robot(Box::new(Robot { floating: robot.floating || self.floating, ..robot })))
    }
}

impl Subject {
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Arm(arm) => &arm.name,
            Self::Robot(robot) => &robot.name,
        }
    }

    /// The joints or servos, base first, as in `--q`.
    pub(crate) fn coordinates(&self) -> Vec<Coordinate> {
        match self {
            Self::Robot(robot) => {
                let joints = robot.coordinates().map(|joint| &robot.joints[joint]);
                joints.map(|j| Coordinate { name: j.name.clone(), kind: j.joint.axis.kind }).collect()
            }
            Self::Arm(arm) => servo_joints(arm),
        }
    }

    /// The columns of a Jacobian: the coordinates, then the discrete actuators of an arm.
    pub(crate) fn columns(&self) -> Vec<Coordinate> {
        let mut columns = self.coordinates();
        if let Self::Arm(arm) = self {
            let chain = &arm.model.chain;
            columns.extend(chain.actuators().enumerate().map(|(actuator, (stage, _))| {
                let kind = match chain.stages.get(stage) {
                    Some(Stage::Discrete(joint)) => joint.axis.kind,
                    _ => JointKind::Prismatic,
                };
                Coordinate { name: arm.actuator_name(actuator), kind }
            }));
        }
        columns
    }

    /// The robot; an error for an arm.
    pub(crate) fn into_robot(self, command: &str) -> Result<Robot, Usage> {
        match self {
            Self::Robot(robot) => Ok(*robot),
            Self::Arm(_) => Err(Usage(format!(
                "darm {command} needs a robot: a URDF, an MJCF or a Denavit-Hartenberg table; for the words of an arm file use `darm \
                 nearest` and `darm path`"
            ))),
        }
    }

    /// Pose and Jacobians of a frame in one posture.
    pub(crate) fn kinematics(&self, frame: Option<&str>, posture: &Posture) -> anyhow::Result<Kinematics> {
        match self {
            Self::Robot(robot) => Ok(robot.kinematics(frame_of(robot, frame)?, &posture.q)?),
            Self::Arm(arm) => {
                if frame.is_some() {
                    return Err(Usage("--frame needs a robot; an arm file has one tool".into()).into());
                }
                arm_kinematics(arm, posture)
            }
        }
    }

    /// Name of the frame of [`kinematics`](Self::kinematics).
    pub(crate) fn frame_name(&self, frame: Option<&str>) -> Result<String, Usage> {
        match self {
            Self::Robot(robot) => Ok(frame_of(robot, frame)?.name.clone()),
            Self::Arm(_) => Ok("tool".into()),
        }
    }
}

/// The servo joints of an arm, base first.
pub(crate) fn servo_joints(arm: &Arm) -> Vec<Coordinate> {
    let stages = arm.model.chain.stages.iter().enumerate();
    let servos = stages.filter_map(|(stage, kind)| match kind {
        Stage::Servo(joint) => Some(Coordinate { name: arm.stage_name(stage), kind: joint.axis.kind }),
        _ => None,
    });
    servos.collect()
}

/// The robot of a file on a floating base, each of whose joints moves independently.
pub(crate) fn floating(path: &std::path::Path, root: Option<&str>) -> anyhow::Result<Robot> {
    let robot = Part { locks: &[], root }.robot_of(&Source::read::<String>(path)?)?;
    if let Some(joint) = robot.joints.iter().find(|joint| joint.mimic.is_some()) {
        let what = format!("{}: joint `{}` mimics another; remove its <mimic>", path.display(), joint.name);
        return Err(Usage(what).into());
    }
    Ok(Robot { floating: true, ..robot })
}

/// The frame of this name; default: the most likely tool.
pub(crate) fn frame_of<'a>(robot: &'a Robot, name: Option<&str>) -> Result<&'a RobotFrame, Usage> {
    let none = || Usage(format!("no frame `{}`; the frames are {}", name.unwrap_or("tool"), robot.frame_names()));
    if let Some(site) = name.and_then(|name| robot.frame(&format!("{SITE}{name}"))) {
        // Once, however often a command asks for the frame.
        static SAID: Once = Once::new();
        SAID.call_once(|| eprintln!("note: the frame is the body of this name; that of the site is `{}`", site.name));
    }
    robot.frame_or_tool(name).ok_or_else(none)
}

fn arm_kinematics(arm: &Arm, posture: &Posture) -> anyhow::Result<Kinematics> {
    let chain = &arm.model.chain;
    let mut scratch = ArmScratch::default();
    let pose = arm
        .model
        .predict(&arm.working_condition(posture.word, &posture.q), &mut scratch)
        .with_context(|| format!("{} has no pose for the word {}", arm.name, posture.word))?;
    let stops = (0..arm.n_actuators())
        .map(|actuator| Parameter::Stop { actuator: actuator as u8, state: posture.word.digit(actuator) });
    let discrete: Vec<_> = stops.map(|stop| chain.derivative(stop, &scratch)).collect();
    let turned =
        |twist: &Twist<f64>| Twist { angular: pose.rotation * twist.angular, linear: pose.rotation * twist.linear };
    let twists: Vec<_> = chain.servo_jacobian(&scratch).chain(discrete).collect();
    let jacobian_tool = Jacobian::from_fn(twists.len(), |row, column| twists[column].to_vector()[row]);
    let jacobian_base = Jacobian::from_fn(twists.len(), |row, column| turned(&twists[column]).to_vector()[row]);
    Ok(Kinematics { pose_base_frame: pose, jacobian_base, jacobian_tool })
}

/// A pose as JSON.
#[derive(Clone, Debug, serde::Serialize)]
pub(crate) struct PoseReport {
    pub(crate) position_m: [f64; 3],
    /// Axis times angle.
    pub(crate) rotation_vector_rad: [f64; 3],
    /// Rows of the rotation matrix.
    pub(crate) rotation_matrix: [[f64; 3]; 3],
    /// Z-Y-X Euler angles: about z, the new y, the newest x.
    pub(crate) euler_zyx_rad: [f64; 3],
}

impl From<&Pose<f64>> for PoseReport {
    fn from(pose: &Pose<f64>) -> Self {
        let angles = darm_core::tree::euler::PoseVector::from(pose).angles;
        Self {
            position_m: pose.position.into(),
            rotation_vector_rad: rotation_log(&pose.rotation).into(),
            rotation_matrix: std::array::from_fn(|row| std::array::from_fn(|column| pose.rotation[(row, column)])),
            euler_zyx_rad: [angles.x, angles.y, angles.z],
        }
    }
}

/// The external wrench on the tool.
#[derive(clap::Args, Debug)]
pub(crate) struct WrenchArgs {
    /// Wrench that the environment exerts on the frame, along the axes of the base: moments in N m, then forces in N
    #[arg(long, value_name = "MX,MY,MZ,FX,FY,FZ", allow_hyphen_values = true)]
    external_wrench: Option<String>,
}

impl WrenchArgs {
    /// What the environment exerts on the frame, if given.
    pub(crate) fn external(&self) -> Result<Option<Wrench<f64>>, Usage> {
        self.external_wrench.as_deref().map(wrench).transpose()
    }
}

/// Six numbers separated by commas: moments, then forces.
fn wrench(text: &str) -> Result<Wrench<f64>, Usage> {
    let option = "--external-wrench";
    match numbers(text, option)?[..] {
        [a, b, c, x, y, z] => Ok(Wrench { moment: [a, b, c].into(), force: [x, y, z].into() }),
        _ => Err(Usage(format!(
            "{option} {text}: give six numbers, moments in N m, then forces in N, such as 0,0,0,0,0,-10"
        ))),
    }
}

/// Six numbers of a twist separated by commas, in deg/s, then in mm/s.
pub(crate) fn twist(text: &str, option: &str) -> Result<Twist<f64>, Usage> {
    match numbers(text, option)?[..] {
        [a, b, c, x, y, z] => Ok(Twist {
            angular: [a, b, c].map(f64::to_radians).into(),
            linear: [x, y, z].map(|speed| 1e-3 * speed).into(),
        }),
        _ => Err(Usage(format!("{option} {text}: give six numbers, in deg/s, then in mm/s, such as 0,0,0,100,0,0"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_parsed_with_or_without_a_unit() {
        let turning = Coordinate { name: "j".into(), kind: JointKind::Revolute };
        let sliding = Coordinate { name: "s".into(), kind: JointKind::Prismatic };
        assert_eq!(turning.typed(" 180 ").ok(), Some(std::f64::consts::PI));
        assert_eq!(turning.typed("-0.5rad").ok(), Some(-0.5));
        assert_eq!((sliding.typed("20").ok(), sliding.typed("0.02m").ok()), (Some(0.02), Some(0.02)));
        assert!(sliding.typed("1deg").is_err() && turning.typed("nan").is_err() && turning.typed("").is_err());
    }
}
