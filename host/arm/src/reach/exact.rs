//! The nearest words of an arm that has too many to look at each, proven by branch and bound.
//!
//! # Method
//!
//! The stages are cut in two: the arm's frames are the products A·B of a head A and a tail B. The distance
//! d² = |Δp|² + ℓ²θ² is left invariant, so d(A·B, T) = d(B, A⁻¹T): for each head the tail nearest to the fixed pose
//! A⁻¹T is sought among the same frames, and what one head finds bounds the search of all others. The tails stand in
//! a k-d tree whose bound is proven in `tree`; a larger tail makes fewer, hardly longer searches, until
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
    tails: Tails,
}

/// The frames of the tail, ready to be searched.
#[derive(Debug)]
pub(super) struct Tails {
    pub(super) left: Frames,
    pub(super) right: Frames,
    tree: Tree,
    length_scale_m: f64,
    /// What `f32` may be wrong by in a distance between points, m.
    rounding_m: f64,
}

impl Index {
    /// Forms the frames of the head and of the tail of `arm`, and sorts those of the tail.
    pub fn new(arm: &Arm, options: &Options) -> Result<Self, ReachError> {
        let stages = stages(arm, options)?;
        let rest = arm.rest();
        let (head, tail) = stages.split_at(cut(&stages, options.max_tails));
        let (outer, inner) = head.split_at(frames::middle(head));
        let size = |stages: &[Frames]| stages.iter().map(|stage| stage.len() as f64).product::<f64>();
        if size(outer).max(size(inner)) > MAX_FACTOR as f64 {
            return Err(ReachError::TooManyWords { digits: arm.n_actuators() });
        }
        let tails = Tails::new(tail, extent_m(&stages), options.length_scale_m, rest);
        Ok(Self { outer: frames::product(outer, rest), inner: frames::product(inner, rest), tails })
    }

    /// How many words the index stands for.
    pub fn words(&self) -> f64 {
        [&self.outer, &self.inner].iter().map(|frames| frames.len() as f64).product::<f64>() * self.tails.words()
    }

    /// Bytes that the index takes.
    pub fn bytes(&self) -> usize {
        self.outer.bytes() + self.inner.bytes() + self.tails.bytes()
    }

    /// The `count` words nearest to `target` that no pattern of `forbidden` names; nearest first.
    pub fn nearest(&self, target: &Pose<f64>, count: usize, forbidden: &[Pattern]) -> Vec<Near> {
        let mut seeker = Nearest { count, forbidden, best: Vec::with_capacity(count + 1) };
        if count > 0 {
            self.pass(target, GLANCE_EVERY, Look::Nearby, &mut seeker);
            self.pass(target, 1, Look::Within, &mut seeker);
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
        self.pass(target, 1, Look::Within, &mut seeker);
        seeker.best.map(|(_, near)| near)
    }

    /// Shows `seeker` words from every `step`-th head, as far as they are within its reach.
    fn pass<S: Seeker>(&self, target: &Pose<f64>, step: usize, what: Look, seeker: &mut S) {
        for (outer, outer_word) in self.outer.poses.iter().zip(&self.outer.words) {
            let from_outer = outer.to(target);
            for (inner, inner_word) in self.inner.poses.iter().zip(&self.inner.words).step_by(step) {
                if seeker.wants(|| joined(outer_word, inner_word)) {
                    let head = || (*outer * *inner, joined(outer_word, inner_word));
                    self.tails.look(&inner.to(&from_outer), what, head, seeker);
                }
            }
        }
    }
}

/// What a search shows of the tails.
#[derive(Clone, Copy, Debug)]
pub(super) enum Look {
    /// A few that lie nearby.
    Nearby,
    /// All that lie within reach.
    Within,
}

/// The frames of the stages that `options` allow.
pub(super) fn stages(arm: &Arm, options: &Options) -> Result<Vec<Frames>, ReachError> {
    let dead = |actuator: usize| options.dead.iter().find(|(dead, _)| *dead == actuator).map(|(_, digit)| *digit);
    frames::of_stages(arm, &options.servos_rad, |actuator, digit| dead(actuator).is_none_or(|at| at == digit))
}

/// Where the tail begins that has `max_tails` frames at most, or one stage.
pub(super) fn cut(stages: &[Frames], max_tails: usize) -> usize {
    let mut tails = 1;
    let tail = stages.iter().rev().take_while(|stage| {
        tails *= stage.len().next_power_of_two();
        tails <= max_tails.max(stage.len().next_power_of_two())
    });
    stages.len() - tail.count()
}

/// The farthest that stages can reach, m.
pub(super) fn extent_m(stages: &[Frames]) -> f64 {
    let farthest = |frames: &Frames| frames.poses.iter().fold(0.0, |most: f64, pose| most.max(pose.position.norm()));
    stages.iter().map(farthest).sum()
}

impl Tails {
    /// Sorts the products of `stages`, of an arm that reaches as far as `extent_m`.
    pub(super) fn new(stages: &[Frames], extent_m: f64, length_scale_m: f64, rest: Word) -> Self {
        let (left, right) = stages.split_at(frames::middle(stages));
        let (left, right) = (frames::product(left, rest), frames::product(right, rest));
        let tree = Tree::new(&left, &right, length_scale_m);
        let rounding_m = 64.0 * f64::from(f32::EPSILON) * (extent_m + length_scale_m);
        Self { left, right, tree, length_scale_m, rounding_m }
    }

    /// How many words they have.
    pub(super) fn words(&self) -> f64 {
        self.left.len() as f64 * self.right.len() as f64
    }

    fn bytes(&self) -> usize {
        self.left.bytes() + self.right.bytes() + self.tree.bytes()
    }

    /// Shows `seeker` words of one head, of which the tail is to stand at `wanted`, within its reach.
    pub(super) fn look<S: Seeker>(
        &self,
        wanted: &Pose<f64>,
        what: Look,
        head: impl Fn() -> (Pose<f64>, Word),
        seeker: &mut S,
    ) {
        let square = |reach_m: f64| (reach_m + self.rounding_m).powi(2) as f32;
        let mut reach = square(seeker.reach_m());
        let mut look = |product: u32| {
            let (left, right) = self.tree.factors(product);
            let tail = self.left.poses[left] * self.right.poses[right];
            let distance_m = tail.distance(wanted, self.length_scale_m);
            if distance_m <= seeker.reach_m() {
                let (pose, word) = head();
                let word = joined(&word, &joined(&self.left.words[left], &self.right.words[right]));
                seeker.see(Near { word, pose_base_tool: pose * tail, distance_m });
            }
            square(seeker.reach_m())
        };
        for probe in Probe::around(&self.tree, wanted) {
            if probe.box_distance_squared() <= reach {
                match what {
                    Look::Nearby => probe.glance(&mut reach, &mut look),
                    Look::Within => probe.search(&mut reach, &mut look),
                }
            }
        }
    }
}

/// Who looks for words.
pub(super) trait Seeker {
    /// Whether a head that begins with the word may be part of the answer.
    fn wants(&self, head: impl FnOnce() -> Word) -> bool;
    /// Words further away than this are of no use, m.
    fn reach_m(&self) -> f64;
    /// Sees a word within reach.
    fn see(&mut self, near: Near);
}

/// Looks for the nearest words.
#[derive(Clone)]
pub(super) struct Nearest<'a> {
    pub(super) count: usize,
    pub(super) forbidden: &'a [Pattern],
    pub(super) best: Vec<Near>,
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_core::actuator::{Axis, DiscreteJoint, JointKind, Stage};
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn planar4() -> Arm {
        Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4.toml")).unwrap()
    }

    /// An arm of up to `digits` discrete joints and planar modules.
    fn random_arm(random: &mut ChaCha8Rng, digits: usize) -> Arm {
        let mut arm = planar4();
        let modules: Vec<_> = arm.model.chain.stages.iter().copied().collect();
        arm.model.chain.stages.clear();
        while arm.n_actuators() + 3 <= digits {
            let mut number = || random.random_range(-1.0..1.0);
            let direction = darm_core::real::Vec3::new(number(), number(), number() + 2.0).normalize();
            let mut values = [number(), number(), number(), number()];
            values.sort_by(f64::total_cmp);
            let kind = if number() > 0.0 { JointKind::Revolute } else { JointKind::Prismatic };
            let states = if number() > 0.0 { 2 } else { 4 };
            let joint = Stage::Discrete(DiscreteJoint { axis: Axis { kind, direction }, values, states });
            let stage = if number() > 0.3 { modules[0] } else { joint };
            arm.model.chain.stages.push(stage).unwrap();
        }
        arm
    }

    fn options(arm: &Arm, max_tails: usize) -> Options {
        Options { max_tails, ..Options::of(arm) }
    }

    /// All words, nearest first.
    fn by_trying_all(arm: &Arm, target: &Pose<f64>, length_scale_m: f64) -> Vec<(f64, Word)> {
        let all = frames::product(&frames::of_stages(arm, &[], |_, _| true).unwrap(), arm.rest());
        let distances = all.poses.iter().map(|pose| pose.distance(target, length_scale_m));
        let mut sorted: Vec<_> = distances.zip(all.words).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        sorted
    }

    fn random_target(random: &mut ChaCha8Rng) -> Pose<f64> {
        let mut vector = |size: f64| darm_core::real::Vec3::from_fn(|_, _| random.random_range(-size..size));
        Pose::new(&vector(2.0), vector(3.0))
    }

    #[test]
    fn the_nearest_words_are_those_of_trying_all() {
        let mut random = ChaCha8Rng::seed_from_u64(0xda24);
        for case in 0..60 {
            let digits = random.random_range(3..=10);
            let arm = random_arm(&mut random, digits);
            let target = random_target(&mut random);
            let scale = [0.5, 0.0, 2.0][case % 3];
            let all = by_trying_all(&arm, &target, scale);
            for max_tails in [1, 64, 1 << 20] {
                let index = Index::new(&arm, &Options { length_scale_m: scale, ..options(&arm, max_tails) }).unwrap();
                assert_eq!(index.words(), all.len() as f64);
                let found = index.nearest(&target, 5, &[]);
                assert_eq!(found.len(), all.len().min(5));
                for (near, (distance_m, _)) in found.iter().zip(&all) {
                    assert!((near.distance_m - distance_m).abs() < 1e-12, "case {case}: {near:?} {distance_m}");
                }
            }
        }
    }

    #[test]
    fn an_arm_of_many_words_meets_those_of_a_tree_of_many_buckets() {
        let mut arm = planar4();
        arm.model.chain.stages.push(arm.model.chain.stages[1]).unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let index = Index::new(&arm, &options(&arm, 1 << 20)).unwrap();
        for _ in 0..20 {
            let target = random_target(&mut random);
            let (distance_m, _) = by_trying_all(&arm, &target, 0.5)[0];
            assert!((index.nearest(&target, 1, &[])[0].distance_m - distance_m).abs() < 1e-12);
        }
    }

    #[test]
    fn a_forbidden_word_and_a_dead_actuator_stay_out() {
        let arm = planar4();
        let target = random_target(&mut ChaCha8Rng::seed_from_u64(3));
        let all = by_trying_all(&arm, &target, 0.5);
        let forbidden: Pattern = "1**,***,***,**0".parse().unwrap();
        let dead = Options { dead: vec![(4, 1)], ..options(&arm, 64) };
        let wanted = all.iter().find(|(_, word)| word.digit(4) == 1 && !forbidden.names(word)).unwrap();
        let found = Index::new(&arm, &dead).unwrap().nearest(&target, 1, &[forbidden]);
        assert_eq!(found[0].word, wanted.1);
        assert_eq!("10x".parse::<Pattern>(), Err(NoPattern { character: 'x' }));
    }

    #[test]
    fn the_fewest_switches_win_within_the_tolerance() {
        let arm = planar4();
        let mut random = ChaCha8Rng::seed_from_u64(5);
        for _ in 0..10 {
            let target = random_target(&mut random);
            let all = by_trying_all(&arm, &target, 0.5);
            let (from, tolerance_m) = (all[4000].1, all[200].0);
            let fewest = all[..=200].iter().map(|(_, word)| switches(word, &from, 12)).min().unwrap();
            let index = Index::new(&arm, &options(&arm, 64)).unwrap();
            let found = index.fewest_switches(&target, tolerance_m, &from, &[]).unwrap();
            let wanted = all.iter().find(|(_, word)| switches(word, &from, 12) == fewest).unwrap();
            assert_eq!((found.word, switches(&found.word, &from, 12)), (wanted.1, fewest));
            assert_eq!(index.fewest_switches(&target, 0.5 * all[0].0, &from, &[]), None);
        }
    }
}
