//! The nearest words of an arm, out of all of them.

use darm_core::se::{Pose, Twist};
use darm_core::units::Word;

use super::judge::{JUDGED, Judge};
use super::refine::{range, refine};
use super::steps::{Step, tabulate};
use super::{Candidate, ReachError};
use crate::arm::{Arm, ArmScratch};

/// Most words that are looked at one by one.
pub const MAX_WORDS: u64 = 1 << 20;

/// Angles of each servo that a solution is sought from.
const SERVO_STARTS: usize = 9;

/// The `count` words that bring the tool nearest to `target`, coming from the word `previous`; nearest first.
///
/// # Errors
///
/// [`ReachError::TooManyWords`]: the arm has too many words to look at each. [`ReachError::NoPose`]: the model has no
/// pose for any of them.
pub fn best_words(arm: &Arm, target: &Pose<f64>, previous: &Word, count: usize) -> Result<Vec<Candidate>, ReachError> {
    let digits = arm.n_actuators();
    let words = (0..digits).try_fold(1u64, |words, k| words.checked_mul(arm.model.chain.n_states(k) as u64));
    if words.is_none_or(|words| words > MAX_WORDS) {
        return Err(ReachError::TooManyWords { digits });
    }
    let mut walk = Walk {
        arm,
        target,
        stages: tabulate(arm),
        links: vec![arm.model.chain.mount],
        axes: Vec::new(),
        nearest: Vec::new(),
        keep: count.max(JUDGED),
    };
    walk.visit(0, 0, arm.rest());
    let mut nearest = walk.nearest;
    nearest.sort_by(|a, b| a.0.total_cmp(&b.0));
    nearest.truncate(count.max(JUDGED));
    let mut judge = Judge::new(arm, target, previous);
    let mut candidates = Vec::new();
    let mut refused = None;
    for (_, word, servos_rad) in nearest {
        match judge.judge(word, servos_rad) {
            Ok(candidate) => candidates.push(candidate),
            Err(reason) => refused = Some(reason),
        }
    }
    if candidates.is_empty() {
        let rest = arm.model.chain.pose_base_tool(&arm.rest(), &vec![0.0; arm.n_servos()], &mut ArmScratch::default());
        let reason = refused.or(rest.err());
        return reason.map_or(Ok(candidates), |reason| Err(ReachError::NoPose(reason)));
    }
    candidates.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
    candidates.truncate(count);
    Ok(candidates)
}

/// A walk through all words: the product of the stages so far, cut at each servo joint.
struct Walk<'a> {
    arm: &'a Arm,
    target: &'a Pose<f64>,
    stages: Vec<Step>,
    /// The poses before, between and after the servo joints.
    links: Vec<Pose<f64>>,
    axes: Vec<Twist<f64>>,
    /// Distance, word and servo angles of the nearest so far: at most twice as many as are kept.
    nearest: Vec<(f64, Word, Vec<f64>)>,
    keep: usize,
}

impl Walk<'_> {
    fn visit(&mut self, stage: usize, actuator: usize, word: Word) {
        let Some(last) = self.links.last().copied() else { return };
        match self.stages.get(stage) {
            None => self.arrive(word),
            Some(&Step::Servo { axis, offset }) => {
                let end = self.links.len() - 1;
                self.links[end] = last * Pose::exp(&(axis * offset));
                self.links.push(Pose::identity());
                self.axes.push(axis);
                self.visit(stage + 1, actuator, word);
                self.links.pop();
                self.axes.pop();
                self.links[end] = last;
            }
            Some(Step::Poses(poses)) => {
                let end = self.links.len() - 1;
                for index in 0..poses.len() {
                    let Step::Poses(poses) = &self.stages[stage] else { return };
                    let (digits, pose) = &poses[index];
                    let place = |word: Word, (leg, &digit): (usize, &u8)| word.with_digit(actuator + leg, digit);
                    let next = digits.iter().enumerate().fold(word, place);
                    let actuators = digits.len();
                    self.links[end] = last * *pose;
                    self.visit(stage + 1, actuator + actuators, next);
                }
                self.links[end] = last;
            }
        }
    }

    fn arrive(&mut self, word: Word) {
        let Some(last) = self.links.last_mut() else { return };
        let before = *last;
        *last = before * self.arm.model.chain.tool;
        let mut servos_rad = Vec::new();
        if !self.axes.is_empty() {
            servos_rad = self.solve_servos();
        }
        let distance = self.pose(&servos_rad).distance(self.target, self.arm.length_scale_m);
        if let Some(last) = self.links.last_mut() {
            *last = before;
        }
        self.keep(distance, word, servos_rad);
    }

    fn keep(&mut self, distance: f64, word: Word, servos_rad: Vec<f64>) {
        self.nearest.push((distance, word, servos_rad));
        if self.nearest.len() >= 2 * self.keep {
            self.nearest.select_nth_unstable_by(self.keep - 1, |a, b| a.0.total_cmp(&b.0));
            self.nearest.truncate(self.keep);
        }
    }

    fn pose(&self, servos_rad: &[f64]) -> Pose<f64> {
        let joints = self.axes.iter().zip(servos_rad).map(|(axis, angle)| Pose::exp(&(*axis * *angle)));
        joints.zip(&self.links[1..]).fold(self.links[0], |pose, (joint, link)| pose * joint * *link)
    }

    /// The angles within their ranges that bring the tool nearest: the best of a grid, made better step by step.
    fn solve_servos(&self) -> Vec<f64> {
        let n = self.axes.len();
        let angle = |servo: usize, step: usize| {
            let (min, max) = range(self.arm, servo);
            min + (max - min) * (step as f64 + 0.5) / SERVO_STARTS as f64
        };
        let grid = (0..SERVO_STARTS.pow(n as u32)).map(|index| {
            (0..n).map(|servo| angle(servo, index / SERVO_STARTS.pow(servo as u32) % SERVO_STARTS)).collect::<Vec<_>>()
        });
        let distance = |angles: &Vec<f64>| self.pose(angles).distance(self.target, self.arm.length_scale_m);
        let best = grid.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        refine(self.arm, self.target, best.expect("the grid has a point at least"), |angles| {
            let pose = self.pose(angles);
            let mut columns = Vec::with_capacity(n);
            let mut tail = Pose::identity();
            for (link, axis) in self.links[1..].iter().zip(&self.axes).rev() {
                // The axis of a joint is the same before and after it turns.
                tail = *link * tail;
                columns.push(tail.adjoint_inverse(axis));
                let servo = n - columns.len();
                tail = Pose::exp(&(*axis * angles[servo])) * tail;
            }
            columns.reverse();
            Some((pose, columns))
        })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_core::se::Pose2;

    use darm_core::effect::Effect;

    use super::*;

    fn arm(name: &str) -> Arm {
        Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)).unwrap()
    }

    fn predicted(arm: &Arm, word: &Word, servos: &[f64]) -> Pose<f64> {
        let condition = arm.model.working(*word, arm.rest(), servos);
        arm.model.predict(&condition, &mut ArmScratch::default()).unwrap()
    }

    #[test]
    fn a_reachable_pose_is_found_and_ranked_as_by_trying_all() {
        let mut arm = arm("planar4.toml");
        arm.model.effects.push(Effect::StrokeLoss { actuator: 4, state: 1, loss_m: 4e-3 }).unwrap();
        for bits in [0b0101_1001_1010u16, 0b1110_0001_0111] {
            let word: Word = format!("{bits:012b}").parse().unwrap();
            let target = predicted(&arm, &word, &[]) * Pose::from(Pose2::new(2e-3, -1e-3, 0.004));
            let all = (0..4096u16).filter_map(|bits| {
                let word = format!("{bits:012b}").parse().ok()?;
                let condition = arm.model.working(word, arm.rest(), &[]);
                let pose = arm.model.predict(&condition, &mut ArmScratch::default()).ok()?;
                Some(pose.distance(&target, arm.length_scale_m))
            });
            let mut distances: Vec<f64> = all.collect();
            distances.sort_by(f64::total_cmp);
            let found = best_words(&arm, &target, &arm.rest(), 8).unwrap();
            for (candidate, distance) in found.iter().zip(distances) {
                assert!((candidate.distance_m - distance).abs() < 1e-12, "{} {distance}", candidate.distance_m);
            }
        }
    }

    #[test]
    fn servos_are_solved_with_the_word() {
        let arm = arm("planar4-hybrid.toml");
        let word = "010110011101".parse().unwrap();
        let target = predicted(&arm, &word, &[0.31]);
        let found = best_words(&arm, &target, &arm.rest(), 3).unwrap();
        let exact = found.iter().find(|candidate| candidate.word == word).unwrap();
        assert!(exact.distance_m < 1e-9 && (exact.servos_rad[0] - 0.31).abs() < 1e-9, "{exact:?}");
    }

    #[test]
    fn more_words_than_can_be_tried_are_refused() {
        let mut arm = arm("planar4.toml");
        for stage in arm.model.chain.stages.clone() {
            arm.model.chain.stages.push(stage).unwrap();
        }
        let error = best_words(&arm, &Pose::identity(), &arm.rest(), 1).unwrap_err();
        assert_eq!(error, ReachError::TooManyWords { digits: 24 });
    }
}
