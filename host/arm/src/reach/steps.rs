//! What each stage of an arm does to the frame that it is mounted on.

use darm_core::actuator::Stage;
use darm_core::se::{Pose, Twist};

use crate::arm::Arm;
use crate::stage_settings::{pose, settings};

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
    let assembled = settings(stage).filter_map(|digits| pose(stage, &digits).map(|pose| (digits, pose)));
    Step::Poses(assembled.collect())
}
