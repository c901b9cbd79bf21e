//! Sets of frames: every pose that a run of stages can take, with the digits that bring it there.

use darm_core::se::Pose;
use darm_core::units::Word;

use super::ReachError;
use super::steps::{Step, tabulate};
use crate::arm::Arm;
use crate::stage_settings::joined;

/// Frames, each with the digits that make it.
#[derive(Clone, Debug)]
pub(super) struct Frames {
    /// Pose of the end of the run in its start.
    pub(super) poses: Vec<Pose<f64>>,
    /// The digits of the run's actuators; 0 for all other actuators of the arm.
    pub(super) words: Vec<Word>,
    /// How many actuators the run has.
    pub(super) digits: usize,
}

impl Frames {
    /// One frame that needs no digits.
    pub(super) fn one(pose: Pose<f64>, rest: Word) -> Self {
        Self { poses: vec![pose], words: vec![rest], digits: 0 }
    }

    pub(super) fn len(&self) -> usize {
        self.poses.len()
    }

    /// Bytes that they take.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.poses) + size_of_val(&*self.words)
    }

    /// The frames of this run and the next one behind it, the next one's counting fastest.
    pub(super) fn times(&self, next: &Self) -> Self {
        let pairs = || (0..self.len()).flat_map(|i| (0..next.len()).map(move |j| (i, j)));
        Self {
            poses: pairs().map(|(i, j)| self.poses[i] * next.poses[j]).collect(),
            words: pairs().map(|(i, j)| joined(&self.words[i], &next.words[j])).collect(),
            digits: self.digits + next.digits,
        }
    }
}

/// The frames of each stage of `arm` for the digits that are `allowed`, with its servos at `servos_rad`; the mount
/// is in the first, the tool in the last.
pub(super) fn of_stages(
    arm: &Arm,
    servos_rad: &[f64],
    allowed: impl Fn(usize, u8) -> bool,
) -> Result<Vec<Frames>, ReachError> {
    of_steps(arm, tabulate(arm), servos_rad, allowed)
}

/// The same of stages that are tabulated already.
pub(super) fn of_steps(
    arm: &Arm,
    steps: Vec<Step>,
    servos_rad: &[f64],
    allowed: impl Fn(usize, u8) -> bool,
) -> Result<Vec<Frames>, ReachError> {
    let rest = arm.rest();
    let mut stages = vec![Frames::one(arm.model.chain.mount, rest)];
    let (mut actuator, mut servos) = (0, servos_rad.iter());
    for (index, step) in steps.into_iter().enumerate() {
        let frames = match step {
            Step::Servo { axis, offset } => {
                let angle = offset + servos.next().copied().unwrap_or(0.0);
                Frames::one(Pose::exp(&(axis * angle)), rest)
            }
            Step::Poses(poses) => {
                let first = actuator;
                actuator += arm.model.chain.stages[index].n_actuators();
                Frames { digits: actuator - first, ..of_poses(poses, first, rest, &allowed) }
            }
        };
        if frames.len() == 0 {
            return Err(ReachError::NoSetting { stage: index });
        }
        // A stage that does not move is no separate factor.
        match stages.last_mut() {
            Some(last) if last.len() == 1 || frames.len() == 1 => *last = last.times(&frames),
            _ => stages.push(frames),
        }
    }
    if let Some(last) = stages.last_mut() {
        *last = last.times(&Frames::one(arm.model.chain.tool, rest));
    }
    Ok(stages)
}

fn of_poses(poses: Vec<(Vec<u8>, Pose<f64>)>, first: usize, rest: Word, allowed: impl Fn(usize, u8) -> bool) -> Frames {
    let mut frames = Frames { poses: Vec::new(), words: Vec::new(), digits: 0 };
    for (digits, pose) in poses {
        let placed = || digits.iter().enumerate().map(|(leg, &digit)| (first + leg, digit));
        if placed().all(|(actuator, digit)| allowed(actuator, digit)) {
            frames.words.push(placed().fold(rest, |word, (actuator, digit)| word.with_digit(actuator, digit)));
            frames.poses.push(pose);
        }
    }
    frames
}

/// The product of all `stages`, or one frame that is fixed.
pub(super) fn product(stages: &[Frames], rest: Word) -> Frames {
    stages.iter().fold(Frames::one(Pose::identity(), rest), |all, stage| all.times(stage))
}

/// Where to cut `stages` in two such that the larger product is the least.
pub(super) fn middle(stages: &[Frames]) -> usize {
    let size = |stages: &[Frames]| stages.iter().map(|stage| stage.len() as f64).product::<f64>();
    let larger = |cut: &usize| size(&stages[..*cut]).max(size(&stages[*cut..]));
    (0..=stages.len()).min_by(|a, b| larger(a).total_cmp(&larger(b))).unwrap_or(0)
}
