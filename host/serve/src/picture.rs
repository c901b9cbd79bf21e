//! The arm as lines in space, as its model predicts it for the word that the board drives.

use darm_arm::arm::{Arm, ArmScratch};
use darm_arm::draw::{Line, Scene};
use darm_core::model::Condition;
use darm_core::se::{Pose, rotation_exp, rotation_log};
use darm_core::units::Word;
use serde::Serialize;

/// A posture of the arm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Picture {
    /// Name of the arm.
    pub name: String,
    /// Whether all of it is in the xy-plane.
    pub is_planar: bool,
    /// The word.
    pub word: String,
    /// Pose of the tool in the base.
    pub tool: Tool,
    /// The arm.
    pub lines: Vec<Stroke>,
}

/// Pose of the tool in the base.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tool {
    /// Position, m.
    pub position_m: [f64; 3],
    /// Rotation vector, rad.
    pub rotation_rad: [f64; 3],
}

/// A straight line in the base frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Stroke {
    /// What it shows: `link`, `plate`, `contracted`, `extended`, `revolute`, `prismatic`, `x`, `y` or `z`.
    pub part: &'static str,
    /// Where it starts, m.
    pub from_m: [f64; 3],
    /// Where it ends, m.
    pub to_m: [f64; 3],
}

/// What decides the posture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Posture {
    /// The word that the board drives.
    pub word: Word,
    /// The word before it.
    pub previous: Word,
    /// Joint angles of the servos, rad.
    pub servos_rad: Vec<f64>,
}

impl Picture {
    /// The arm in this posture, under its working supply and temperature.
    ///
    /// # Errors
    ///
    /// The model has no pose for it, in a sentence.
    pub(crate) fn of(arm: &Arm, posture: &Posture) -> Result<Self, String> {
        Self::under(arm, &arm.model.working(posture.word, posture.previous, &posture.servos_rad))
    }

    /// The arm under this condition.
    ///
    /// # Errors
    ///
    /// The model has no pose for it, in a sentence.
    pub(crate) fn under(arm: &Arm, condition: &Condition<'_, f64>) -> Result<Self, String> {
        let mut scratch = ArmScratch::default();
        let tool = arm.model.predict(condition, &mut scratch).map_err(|error| error.to_string())?;
        let scene = Scene::of_arm(arm, &scratch, condition.word.iter());
        Ok(Self {
            name: arm.name.clone(),
            is_planar: scene.is_planar,
            word: condition.word.to_string(),
            tool: Tool::of(&tool),
            lines: scene.lines.iter().map(Stroke::of).collect(),
        })
    }
}

impl Tool {
    /// A pose as position and rotation vector.
    pub fn of(pose: &Pose<f64>) -> Self {
        Self { position_m: pose.position.into(), rotation_rad: rotation_log(&pose.rotation).into() }
    }

    /// The pose in the base.
    pub fn pose(&self) -> Pose<f64> {
        Pose { position: self.position_m.into(), rotation: rotation_exp(&self.rotation_rad.into()) }
    }
}

impl Stroke {
    fn of(line: &Line) -> Self {
        Self { part: line.part.name(), from_m: line.from.into(), to_m: line.to.into() }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_arm::arm::Arm;

    use super::{Picture, Posture};

    #[test]
    fn extended_legs_are_named_and_the_tool_is_where_the_model_has_it() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4.toml");
        let arm = Arm::read(&path).unwrap();
        let word = "101000000000".parse().unwrap();
        let picture = Picture::of(&arm, &Posture { word, previous: arm.rest(), servos_rad: vec![] }).unwrap();
        let count = |part| picture.lines.iter().filter(|line| line.part == part).count();
        assert_eq!((count("extended"), count("contracted")), (2, 10));
        let mut scratch = darm_arm::arm::ArmScratch::default();
        let pose = arm.model.chain.pose_base_tool(&word, &[], &mut scratch).unwrap();
        assert!(picture.is_planar && (picture.tool.position_m[1] - pose.position.y).abs() < 1e-9);
        let short = Posture { word: "1".parse().unwrap(), previous: arm.rest(), servos_rad: vec![] };
        assert!(Picture::of(&arm, &short).unwrap_err().contains("digits"));
    }
}
