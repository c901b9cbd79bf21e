//! The nearest words of an arm that has too many to look at each, proven by branch and bound.
//!
//! # Method
//!
//! The stages are cut in two: the arm's frames are the products A·B of a head A and a tail B. The distance
//! d² = |Δp|² + ℓ²θ² is left invariant, so d(A·B, T) = d(B, A⁻¹T): for each head the tail nearest to the fixed pose
//! A⁻¹T is sought among the same frames, and what one head finds bounds the search of all others. The tails stand in
//! a k-d tree whose bound is proven in [`tree`](super::tree); a larger tail makes fewer, hardly longer searches, until
//! its tree outgrows the memory. The bound is computed in `f32` with room for rounding, and each word that it leaves
//! is measured in `f64`: the answer is that of looking at all words, without looking at them.

use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;

use darm_core::se::Pose;
use darm_core::units::Word;

use super::ReachError;
use super::frames::{self, Frames, joined};
use super::tree::{Probe, Tree};
use crate::arm::Arm;

/// Most heads that are formed at once; heads beyond them are formed anew in every search.
const MAX_FACTOR: usize = 1 << 18;
/// Of so many heads one looks for a first bound.
const GLANCE_EVERY: usize = 2;

/// What words an index holds, and how it measures.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Actuators that stand still, and the digit that each stands at.
    pub dead: Vec<(usize, u8)>,
    /// Where the servo joints stand, rad.
    pub servos_rad: Vec<f64>,
    /// Length ℓ that one radian weighs as much as, m; 0 compares positions only.
    pub length_scale_m: f64,
    /// Most tails that the index may hold; 2²⁴ take about 90 MB.
    pub max_tails: usize,
}

impl Options {
    /// All words of `arm` with the servos at 0, in an index that is quick to build.
    pub fn of(arm: &Arm) -> Self {
        let (servos_rad, length_scale_m) = (vec![0.0; arm.n_servos()], arm.length_scale_m);
        Self { dead: Vec::new(), servos_rad, length_scale_m, max_tails: 1 << 20 }
    }
}

/// Some words: a digit for each actuator, or `*` for any.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern(Vec<Option<u8>>);

/// A word, and where the arm's geometry brings the tool by it.
#[derive(Clone, Debug, PartialEq)]
pub struct Near {
    /// The word.
    pub word: Word,
    /// Pose of the tool in the base.
    pub pose_base_tool: Pose<f64>,
    /// Distance from the wanted pose, m.
    pub distance_m: f64,
}

/// The frames of an arm, ready to be searched.
#[derive(Debug)]
pub struct Index {
    outer: Frames,
    inner: Frames,
    left: Frames,
    right: Frames,
    tails: Tree,
    length_scale_m: f64,
    /// What `f32` may be wrong by in a distance between points, m.
    rounding_m: f64,
}

impl Index {
    /// Forms the frames of the head and of the tail of `arm`, and sorts those of the tail.
    pub fn new(arm: &Arm, options: &Options) -> Result<Self, ReachError> {
        let dead = |actuator: usize| options.dead.iter().find(|(dead, _)| *dead == actuator).map(|(_, digit)| *digit);
        let allowed = |actuator: usize, digit: u8| dead(actuator).is_none_or(|at| at == digit);
        let stages = frames::of_stages(arm, &options.servos_rad, allowed)?;
        let rest = arm.rest();
        let mut tails = 1;
        let tail = stages.iter().rev().take_while(|stage| {
            tails *= stage.len().next_power_of_two();
            tails <= options.max_tails.max(stage.len().next_power_of_two())
        });
        let (head, tail) = stages.split_at(stages.len() - tail.count());
        let (outer, inner) = head.split_at(frames::middle(head));
        let size = |stages: &[Frames]| stages.iter().map(|stage| stage.len() as f64).product::<f64>();
        if size(outer).max(size(inner)) > MAX_FACTOR as f64 {
            return Err(ReachError::TooManyWords { digits: arm.n_actuators() });
        }
        let (left, right) = tail.split_at(frames::middle(tail));
        let (left, right) = (frames::product(left, rest), frames::product(right, rest));
        let farthest = |frames: &Frames| frames.poses.iter().fold(0.0, |most: f64, pose| most.max(pose.position.norm()));
        let extent = stages.iter().map(farthest).sum::<f64>() + options.length_scale_m;
        Ok(Self {
            outer: frames::product(outer, rest),
            inner: frames::product(inner, rest),
            tails: Tree::new(&left, &right, options.length_scale_m),
            left,
            right,
            length_scale_m: options.length_scale_m,
            rounding_m: 64.0 * f64::from(f32::EPSILON) * extent,
        })
    }

    /// How many words the index stands for.
    pub fn words(&self) -> f64 {
        [&self.outer, &self.inner, &self.left, &self.right].iter().map(|frames| frames.len() as f64).product()
    }

    /// Bytes that the index takes.
    pub fn bytes(&self) -> usize {
        let frames = [&self.outer, &self.inner, &self.left, &self.right];
        let poses = frames.iter().map(|frames| size_of_val(&*frames.poses) + size_of_val(&*frames.words));
        self.tails.bytes() + poses.sum::<usize>()
    }

    /// The `count` words nearest to `target` that no pattern of `forbidden` names; nearest first.
    pub fn nearest(&self, target: &Pose<f64>, count: usize, forbidden: &[Pattern]) -> Vec<Near> {
        let mut seeker = Nearest { count, forbidden, best: Vec::with_capacity(count + 1) };
        if count > 0 {
            self.pass(target, GLANCE_EVERY, |probe, reach, look| probe.glance(reach, look), &mut seeker);
            self.pass(target, 1, |probe, reach, look| probe.search(reach, look), &mut seeker);
        }
        seeker.best
    }

    /// Of the words no further than `tolerance_m` from `target` the one that switches the fewest actuators coming from
    /// `from`, of several the nearest; `None` where no word is as near.
    pub fn fewest_switches(
        &self,
        target: &Pose<f64>,
        tolerance_m: f64,
        from: &Word,
        forbidden: &[Pattern],
    ) -> Option<Near> {
        let head = self.outer.digits + self.inner.digits;
        let mut seeker = FewestSwitches { tolerance_m, from, head, forbidden, best: None };
        self.pass(target, 1, |probe, reach, look| probe.search(reach, look), &mut seeker);
        seeker.best.map(|(_, near)| near)
    }

    /// Shows `seeker` words from every `step`-th head, found `by` a probe of the tails, within its reach.
    fn pass<S: Seeker>(
        &self,
        target: &Pose<f64>,
        step: usize,
        by: impl Fn(&Probe, &mut f32, &mut dyn FnMut(u32) -> f32),
        seeker: &mut S,
    ) {
        let square = |reach_m: f64| (reach_m + self.rounding_m).powi(2) as f32;
        let mut reach = square(seeker.reach_m());
        for (outer, outer_word) in self.outer.poses.iter().zip(&self.outer.words) {
            let from_outer = outer.to(target);
            for (inner, inner_word) in self.inner.poses.iter().zip(&self.inner.words).step_by(step) {
                if !seeker.wants(|| joined(outer_word, inner_word)) {
                    continue;
                }
                let wanted = inner.to(&from_outer);
                let mut look = |product: u32| {
                    let (left, right) = self.tails.factors(product);
                    let tail = self.left.poses[left] * self.right.poses[right];
                    let distance_m = tail.distance(&wanted, self.length_scale_m);
                    if distance_m <= seeker.reach_m() {
                        let head = joined(outer_word, inner_word);
                        let word = joined(&head, &joined(&self.left.words[left], &self.right.words[right]));
                        seeker.see(Near { word, pose_base_tool: *outer * (*inner * tail), distance_m });
                    }
                    square(seeker.reach_m())
                };
                for probe in Probe::around(&self.tails, &wanted) {
                    if probe.box_distance_squared() <= reach {
                        by(&probe, &mut reach, &mut look);
                    }
                }
            }
        }
    }
}

/// Who looks for words.
trait Seeker {
    /// Whether a head that begins with the word may be part of the answer.
    fn wants(&self, head: impl FnOnce() -> Word) -> bool;
    /// Words further away than this are of no use, m.
    fn reach_m(&self) -> f64;
    /// Sees a word within reach.
    fn see(&mut self, near: Near);
}

struct Nearest<'a> {
    count: usize,
    forbidden: &'a [Pattern],
    best: Vec<Near>,
}

impl Seeker for Nearest<'_> {
    fn wants(&self, _: impl FnOnce() -> Word) -> bool {
        true
    }

    fn reach_m(&self) -> f64 {
        if self.best.len() < self.count { f64::INFINITY } else { self.best.last().map_or(0.0, |last| last.distance_m) }
    }

    fn see(&mut self, near: Near) {
        let place = self.best.partition_point(|other| order(other, &near).is_lt());
        let known = self.best.get(place).is_some_and(|other| other.word == near.word);
        if !known && !named(&near.word, self.forbidden) {
            self.best.insert(place, near);
            self.best.truncate(self.count);
        }
    }
}

struct FewestSwitches<'a> {
    tolerance_m: f64,
    from: &'a Word,
    /// How many digits a head has.
    head: usize,
    forbidden: &'a [Pattern],
    best: Option<(usize, Near)>,
}

impl Seeker for FewestSwitches<'_> {
    fn wants(&self, head: impl FnOnce() -> Word) -> bool {
        self.best.as_ref().is_none_or(|(least, _)| switches(&head(), self.from, self.head) <= *least)
    }

    fn reach_m(&self) -> f64 {
        self.tolerance_m
    }

    fn see(&mut self, near: Near) {
        let count = switches(&near.word, self.from, near.word.len());
        let better = |(least, other): &(usize, Near)| count.cmp(least).then(order(&near, other)).is_lt();
        if self.best.as_ref().is_none_or(better) && !named(&near.word, self.forbidden) {
            self.best = Some((count, near));
        }
    }
}

/// Nearer words first, of equally near ones the smaller.
fn order(a: &Near, b: &Near) -> Ordering {
    a.distance_m.total_cmp(&b.distance_m).then(a.word.cmp(&b.word))
}

/// How many of the first `digits` actuators stand otherwise in `word` than in `from`.
pub fn switches(word: &Word, from: &Word, digits: usize) -> usize {
    (0..digits).filter(|&actuator| word.digit(actuator) != from.digit(actuator)).count()
}

fn named(word: &Word, patterns: &[Pattern]) -> bool {
    patterns.iter().any(|pattern| pattern.names(word))
}

impl Pattern {
    /// Whether the pattern has a digit or a `*` for each digit of `word`, and agrees with it.
    pub fn names(&self, word: &Word) -> bool {
        self.0.len() == word.len()
            && self.0.iter().zip(word.iter()).all(|(wanted, digit)| wanted.is_none_or(|wanted| wanted == digit))
    }

    /// How many digits it has.
    pub fn digits(&self) -> usize {
        self.0.len()
    }
}

/// Why a text is no pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoPattern {
    /// The first character that is neither a digit of a word nor `*`.
    pub character: char,
}

impl FromStr for Pattern {
    type Err = NoPattern;

    /// Reads digits and `*`; commas, blanks and underscores between them are for the eye.
    fn from_str(text: &str) -> Result<Self, NoPattern> {
        let digit = |character: char| match character {
            '*' => Ok(None),
            '0'..='3' => Ok(Some(character as u8 - b'0')),
            _ => Err(NoPattern { character }),
        };
        let characters = text.chars().filter(|character| !matches!(character, ',' | ' ' | '_'));
        characters.map(digit).collect::<Result<_, _>>().map(Self)
    }
}

impl fmt::Display for NoPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} is neither a digit from 0 to 3 nor *", self.character)
    }
}

impl std::error::Error for NoPattern {}
