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
    let step = |stage: &Stage<f64>| {
        if let Stage::Servo(joint) = stage {
            return Step::Servo { axis: joint.axis.twist(), offset: joint.offset };
        }
        let legs = stage.n_actuators();
        let count = (0..legs).map(|leg| stage.n_states(leg)).product();
        let poses = (0..count).filter_map(|index| {
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
        });
        Step::Poses(poses.collect())
    };
    arm.model.chain.stages.iter().map(step).collect()
}
