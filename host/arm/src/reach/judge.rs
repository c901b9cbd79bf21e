//! Words judged by the model with its effects.

use darm_core::chain::ChainError;
use darm_core::se::Pose;
use darm_core::units::Word;

use super::Candidate;
use super::refine::refine;
use crate::arm::{Arm, ArmScratch};

/// How many of the nearest words by the ideal geometry are judged by the model with its effects.
pub(super) const JUDGED: usize = 64;

/// Judges words by where the model has the tool, in place of the ideal geometry.
pub(super) struct Judge<'a> {
    arm: &'a Arm,
    target: &'a Pose<f64>,
    previous: &'a Word,
    scratch: ArmScratch,
}

impl<'a> Judge<'a> {
    /// For a tool that shall reach `target`, coming from the word `previous`.
    pub(super) fn new(arm: &'a Arm, target: &'a Pose<f64>, previous: &'a Word) -> Self {
        Self { arm, target, previous, scratch: ArmScratch::default() }
    }

    /// The word with the best servo angles near `servos_rad`.
    pub(super) fn judge(&mut self, word: Word, servos_rad: Vec<f64>) -> Result<Candidate, ChainError> {
        let Self { arm, target, previous, scratch } = self;
        let mut predict = |servos: &[f64]| {
            let condition = arm.model.working(word, **previous, servos);
            let pose = arm.model.predict(&condition, scratch)?;
            Ok((pose, arm.model.chain.servo_jacobian(scratch).collect::<Vec<_>>()))
        };
        let servos_rad = refine(arm, target, servos_rad, |angles| predict(angles).ok());
        let (pose_base_tool, _) = predict(&servos_rad)?;
        let apart = pose_base_tool.to(target);
        Ok(Candidate {
            word,
            servos_rad,
            pose_base_tool,
            distance_m: pose_base_tool.distance(target, arm.length_scale_m),
            error_m: apart.position.norm(),
            error_rad: apart.angle_rad(),
        })
    }
}
