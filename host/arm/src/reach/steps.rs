//! What each stage of an arm does to the frame that it is mounted on.

use darm_core::actuator::{MAX_LEGS, Setting, Stage};
use darm_core::se::{Pose, Twist};

use crate::arm::Arm;

/// What one stage does to the frame that it is mounted on.
pub(super) enum Step {
    /// It is in one of these poses, each for the digits of its actuators.
    Poses(Vec<(Vec<u8>, Pose<f64>)>),
    /// It turns by any angle: the unit motion, and the angle at which the servo is at zero.
    Servo { axis: Twist<f64>, offset: f64 },
}

/// The pose of each stage for each setting of its actuators; settings that cannot be assembled are left out.
pub(super) fn tabulate(arm: &Arm) -> Vec<Step> {
    arm.model.chain.stages.iter().map(step).collect()
}

/// What a stage does, in each setting of its actuators that can be assembled.
fn step(stage: &Stage<f64>) -> Step {
    if let Stage::Servo(joint) = stage {
        return Step::Servo { axis: joint.axis.twist(), offset: joint.offset };
    }
    let count = (0..stage.n_actuators()).map(|leg| stage.n_states(leg)).product();
    Step::Poses((0..count).filter_map(|index| pose(stage, index)).collect())
}

/// The digits of the setting with this index, the first digit changing fastest, and the pose of the stage in it.
fn pose(stage: &Stage<f64>, index: usize) -> Option<(Vec<u8>, Pose<f64>)> {
    let legs = stage.n_actuators();
    let mut rest = index;
    let mut settings = [Setting::of_joint(0.0); MAX_LEGS];
    let mut digits = Vec::with_capacity(legs);
    for (leg, setting) in settings.iter_mut().enumerate().take(legs) {
        let digit = (rest % stage.n_states(leg)) as u8;
        rest /= stage.n_states(leg);
        *setting = stage.setting(leg, digit)?;
        digits.push(digit);
    }
    Some((digits, stage.pose(&settings).ok()?))
}
