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

mod pattern;
mod seeker;

use std::collections::BTreeMap;

use darm_core::se::Pose;
use darm_core::units::Word;

pub use self::pattern::{NoPattern, Pattern};
use self::seeker::FewestSwitches;
pub use self::seeker::switches;
pub(super) use self::seeker::{Nearest, Seeker};
use super::ReachError;
use super::frames::{self, Frames, joined};
use super::tree::{Probe, Tree};
use crate::arm::Arm;

/// Most heads that are formed at once; heads beyond them are formed again in every search.
const MAX_FACTOR: usize = 1 << 18;
/// Of this many heads one looks for a first bound.
const GLANCE_EVERY: usize = 2;

/// What words an index holds, and how it measures.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Actuators that stand still, and the digit that each is at.
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

/// The words that a search shall find.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Query<'a> {
    /// Pose that the tool shall come near to, in the base.
    pub target: &'a Pose<f64>,
    /// How many words, the nearest first.
    pub count: usize,
    /// Words that are left out.
    pub forbidden: &'a [Pattern],
}

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
    ///
    /// # Errors
    ///
    /// [`ReachError::NoSetting`]: a stage cannot be assembled in any of the settings that `options` allow.
    /// [`ReachError::TooManyWords`]: the head has too many frames to form.
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

    /// How many words the index holds.
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

/// How many words a search chooses from: those that `options` allow and no pattern of `forbidden` names.
///
/// # Errors
///
/// [`ReachError::NoSetting`]: a stage cannot be assembled in any of the settings that `options` allow.
pub fn words_to_choose_from(arm: &Arm, options: &Options, forbidden: &[Pattern]) -> Result<f64, ReachError> {
    let stages = stages(arm, options)?;
    let patterns: Vec<_> = forbidden.iter().filter(|pattern| pattern.digits() == arm.n_actuators()).collect();
    let all: f64 = stages.iter().map(|stage| stage.len() as f64).product();
    Ok(all - named_words(&stages, 0, &patterns))
}

/// How many words of `stages`, the digits of which begin at `first`, some pattern names.
fn named_words(stages: &[Frames], first: usize, patterns: &[&Pattern]) -> f64 {
    let Some((stage, rest)) = stages.split_first() else { return if patterns.is_empty() { 0.0 } else { 1.0 } };
    let digits = first..first + stage.digits;
    // Words of the stage that agree with the same patterns are counted together.
    let mut alike: BTreeMap<Vec<usize>, f64> = BTreeMap::new();
    for word in &stage.words {
        let agree = |&k: &usize| patterns[k].agrees(word, digits.clone());
        *alike.entry((0..patterns.len()).filter(agree).collect()).or_default() += 1.0;
    }
    alike.retain(|agreeing, _| !agreeing.is_empty());
    let behind = |agreeing: &[usize]| {
        let patterns: Vec<_> = agreeing.iter().map(|&k| patterns[k]).collect();
        named_words(rest, digits.end, &patterns)
    };
    alike.iter().map(|(agreeing, words)| words * behind(agreeing)).sum()
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
    let farthest =
        |frames: &Frames| frames.poses.iter().fold(0.0, |largest: f64, pose| largest.max(pose.position.norm()));
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

#[cfg(test)]
mod tests;
