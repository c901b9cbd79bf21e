//! Which words bring the tool nearest to a pose, out of all words of an arm.
//!
//! Every word is looked at: the stages' poses are tabulated once, and the words share the products of the stages that
//! they have in common, so that the last stage costs one product a word. Servo joints are solved continuously for each
//! word. The nearest words of the ideal geometry are then judged again by the model with its effects, under working
//! conditions: what effects move has to be small against the distance of the first and the last of them.
//!
//! Distance: d² = |Δp|² + ℓ²θ² with the arm's length scale ℓ.
//!
//! Arms with more words: [`exact`], with more than can be tabulated [`anytime`], with servo joints [`servo`]; where an arm reaches: [`map`]; from word to word: [`path`];
//! what a board needs to answer by itself: [`board`].

pub mod anytime;
pub mod board;
pub mod corrected;
pub mod exact;
mod frames;
pub mod map;
pub mod path;
pub mod servo;
mod tree;

use std::fmt;

use darm_core::actuator::{MAX_LEGS, Setting, Stage};
use darm_core::chain::ChainError;
use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist};
use darm_core::units::Word;
use nalgebra::{DMatrix, DVector};

use crate::arm::{Arm, ArmScratch};

/// Most words that are looked at one by one.
pub const MAX_WORDS: u64 = 1 << 20;

/// So many of the nearest words by the ideal geometry are judged by the model with its effects.
const JUDGED: usize = 64;

/// Angles of each servo that a solution is sought from.
const SERVO_STARTS: usize = 9;

/// Steps of the solution for the servos.
const SERVO_STEPS: usize = 12;

/// A word, and where it brings the tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The word.
    pub word: Word,
    /// Angles of the servo joints, rad.
    pub servos_rad: Vec<f64>,
    /// Where the model predicts the tool.
    pub pose_base_tool: Pose<f64>,
    /// Distance from the wanted pose, m.
    pub distance_m: f64,
    /// Distance of the positions, m.
    pub error_m: f64,
    /// Angle between the orientations, rad.
    pub error_rad: f64,
}

/// Why no words can be named.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReachError {
    /// The arm has too many words to look at each.
    TooManyWords {
        /// Digits of a word.
        digits: usize,
    },
    /// No word puts the arm together.
    NoPose(ChainError),
    /// The cells of a map are too small for its extent.
    TooFine,
    /// The arm has servo joints, and frames are wanted that hold for all of their angles.
    Servos,
    /// None of the allowed settings puts a stage together.
    NoSetting {
        /// Index of the stage.
        stage: usize,
    },
}

impl fmt::Display for ReachError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooManyWords { digits } => write!(f, "words of {digits} digits are too many"),
            Self::TooFine => write!(f, "the cells are too small for the arm: take larger ones"),
            Self::Servos => {
                write!(
                    f,
                    "an arm with servo joints has other frames at every angle: no board holds them, and no search by effects"
                )
            }
            Self::NoSetting { stage } => {
                write!(
                    f,
                    "stage {stage} cannot be assembled in any of its allowed states: change its legs or free an actuator"
                )
            }
            Self::NoPose(reason) => write!(f, "no word gives the arm a pose: {reason}"),
        }
    }
}

impl std::error::Error for ReachError {}

/// The `count` words that bring the tool nearest to `target`, coming from the word `previous`; nearest first.
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
    let mut scratch = ArmScratch::default();
    let mut candidates = Vec::new();
    let mut refused = None;
    for (_, word, servos_rad) in nearest {
        match judge(arm, target, previous, word, servos_rad, &mut scratch) {
            Ok(candidate) => candidates.push(candidate),
            Err(reason) => refused = Some(reason),
        }
    }
    if candidates.is_empty() {
        let rest = arm.model.chain.pose_base_tool(&arm.rest(), &vec![0.0; arm.n_servos()], &mut scratch);
        let reason = refused.or(rest.err());
        return reason.map_or(Ok(candidates), |reason| Err(ReachError::NoPose(reason)));
    }
    candidates.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
    candidates.truncate(count);
    Ok(candidates)
}

/// What one stage does to the frame that it stands on.
enum Step {
    /// It stands in one of these poses, each for the digits of its actuators.
    Poses(Vec<(Vec<u8>, Pose<f64>)>),
    /// It turns by any angle: the unit motion, and the angle at which the servo is at zero.
    Servo { axis: Twist<f64>, offset: f64 },
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
        refine(self.arm, self.target, best.unwrap_or_default(), |angles| {
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

/// Judges a word by the model with its effects.
fn judge(
    arm: &Arm,
    target: &Pose<f64>,
    previous: &Word,
    word: Word,
    servos_rad: Vec<f64>,
    scratch: &mut ArmScratch,
) -> Result<Candidate, ChainError> {
    let mut predict = |servos: &[f64]| {
        let condition = arm.model.working(word, *previous, servos);
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

/// Makes servo angles better by Gauss–Newton steps, halved where they do not help, within the servos' ranges.
fn refine(
    arm: &Arm,
    target: &Pose<f64>,
    mut angles_rad: Vec<f64>,
    mut look: impl FnMut(&[f64]) -> Option<(Pose<f64>, Vec<Twist<f64>>)>,
) -> Vec<f64> {
    let scale_m = arm.length_scale_m;
    let Some((mut pose, mut columns)) = look(&angles_rad) else { return angles_rad };
    for _ in 0..SERVO_STEPS {
        if angles_rad.is_empty() {
            break;
        }
        let step = servo_step(&pose.to(target), &columns, scale_m);
        let before = pose.distance(target, scale_m);
        let mut share = 1.0;
        let better = (0..5).find_map(|_| {
            let clamp = |(servo, angle): (usize, &f64)| {
                let (min, max) = range(arm, servo);
                (angle + share * step[servo]).clamp(min, max)
            };
            let next: Vec<f64> = angles_rad.iter().enumerate().map(clamp).collect();
            share *= 0.5;
            let (pose, columns) = look(&next)?;
            (pose.distance(target, scale_m) < before).then_some((next, pose, columns))
        });
        let Some((next, next_pose, next_columns)) = better else { break };
        let moved = next.iter().zip(&angles_rad).fold(0.0, |most: f64, (next, angle)| most.max((next - angle).abs()));
        (angles_rad, pose, columns) = (next, next_pose, next_columns);
        if moved < 1e-12 {
            break;
        }
    }
    angles_rad
}

/// The least-squares step of the angles for what the tool lacks.
fn servo_step(lacking: &Pose<f64>, columns: &[Twist<f64>], scale_m: f64) -> DVector<f64> {
    let six = |angular: Vec3<f64>, linear: Vec3<f64>| {
        let w = angular * scale_m;
        DVector::from_row_slice(&[w.x, w.y, w.z, linear.x, linear.y, linear.z])
    };
    let lacking_turn = lacking.log().angular;
    let columns: Vec<_> =
        columns.iter().map(|twist| six(twist.angular, twist.linear + twist.angular.cross(&lacking.position))).collect();
    let jacobian = DMatrix::from_columns(&columns);
    let normal = jacobian.tr_mul(&jacobian) + DMatrix::identity(columns.len(), columns.len()) * 1e-12;
    let right = jacobian.tr_mul(&six(lacking_turn, lacking.position));
    normal.cholesky().map_or_else(|| DVector::zeros(columns.len()), |cholesky| cholesky.solve(&right))
}

/// The range of a servo joint, rad.
fn range(arm: &Arm, servo: usize) -> (f64, f64) {
    arm.servos.get(servo).map_or((0.0, 0.0), |servo| (servo.min_rad.into(), servo.max_rad.into()))
}

/// The pose of each stage for each setting of its actuators; settings that cannot be assembled are left out.
fn tabulate(arm: &Arm) -> Vec<Step> {
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_core::effect::stroke_loss::StrokeLoss;
    use darm_core::se::Pose2;

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
        arm.model.effects.push(StrokeLoss { actuator: 4, state: 1, loss_m: 4e-3 }.into()).unwrap();
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
