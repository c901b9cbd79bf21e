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
use std::sync::atomic::{AtomicBool, Ordering};

use darm_core::se::Pose;
use darm_core::units::Word;
use rayon::prelude::*;

pub use self::pattern::{NoPattern, Pattern};
pub use self::seeker::switches;
use self::seeker::{FewestSwitches, Shared};
pub(super) use self::seeker::{Nearest, Seeker};
use super::ReachError;
use super::frames::{self, Frames};
use super::tree::{Cell, Probe, Tree};
use crate::arm::Arm;
use crate::stage_settings::joined;

/// Leaves whose memory is fetched at once.
const FETCHED: usize = 64;
/// Most heads that are formed at once; heads beyond them are formed again in every search.
const MAX_FACTOR: usize = 1 << 18;

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
        Self::new_while(arm, options, || true)
    }

    /// The same while `go_on` says so; it is called some thousand times.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new). [`ReachError::GivenUp`]: `go_on` said no.
    pub fn new_while(arm: &Arm, options: &Options, go_on: impl Fn() -> bool + Sync) -> Result<Self, ReachError> {
        let stages = stages(arm, options)?;
        let rest = arm.rest();
        let (head, tail) = stages.split_at(cut(&stages, options.max_tails));
        let (outer, inner) = head.split_at(frames::middle(head));
        let size = |stages: &[Frames]| stages.iter().map(|stage| stage.len() as f64).product::<f64>();
        if size(outer).max(size(inner)) > MAX_FACTOR as f64 {
            return Err(ReachError::TooManyWords { digits: arm.n_actuators() });
        }
        let tails = Tails::new(tail, extent_m(&stages), options.length_scale_m, rest, &go_on)?;
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
    ///
    /// First each head looks into one leaf, which gives a bound and how far the leaf extends around the wanted pose.
    /// Then those heads search whose leaf does not extend as far as the bound. All cores share the heads and the bound.
    pub fn nearest(&self, target: &Pose<f64>, count: usize, forbidden: &[Pattern]) -> Vec<Near> {
        self.nearest_while(&Query { target, count, forbidden }, || true).unwrap_or_default()
    }

    /// The same; `None` where `go_on` says no before the search has ended. It is called for every frame of the outer stages.
    pub fn nearest_while(&self, query: &Query<'_>, go_on: impl Fn() -> bool + Sync) -> Option<Vec<Near>> {
        let &Query { target, count, forbidden } = query;
        let nearest = Nearest { count, forbidden, best: Vec::with_capacity(count + 1) };
        if count == 0 {
            return Some(nearest.best);
        }
        let shared = Shared::new(nearest);
        let is_given_up = AtomicBool::new(false);
        let goes_on = || {
            let goes_on = go_on();
            is_given_up.fetch_or(!goes_on, Ordering::Relaxed);
            goes_on
        };
        let outer = || (0..self.outer.len()).into_par_iter();
        let glance = |outer: usize| {
            let wanted = if goes_on() { self.wanted(outer, target) } else { Vec::new() };
            let free = self.tails.glance(&wanted, |inner| self.head(outer, inner), &mut &shared);
            (wanted, free)
        };
        let glanced: Vec<_> = outer().map(glance).collect();
        outer().zip(glanced).for_each(|(outer, (wanted, free))| {
            if !goes_on() {
                return;
            }
            let reach = self.tails.square(shared.reach_m());
            let left: Vec<usize> = (0..wanted.len()).filter(|&inner| free[inner] <= reach).collect();
            let wanted: Vec<_> = left.iter().map(|&inner| wanted[inner]).collect();
            self.tails.search(&wanted, |k| self.head(outer, left[k]), &mut &shared);
        });
        (!is_given_up.into_inner()).then(|| shared.into_best())
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
        for outer in 0..self.outer.len() {
            for (inner, wanted) in self.wanted(outer, target).iter().enumerate() {
                if seeker.wants(|| joined(&self.outer.words[outer], &self.inner.words[inner])) {
                    self.tails.search(std::slice::from_ref(wanted), |_| self.head(outer, inner), &mut seeker);
                }
            }
        }
        seeker.best.map(|(_, near)| near)
    }

    /// Where the tails are to end of the heads that begin with the outer frame of this number.
    fn wanted(&self, outer: usize, target: &Pose<f64>) -> Vec<Pose<f64>> {
        let from_outer = self.outer.poses[outer].to(target);
        self.inner.poses.iter().map(|inner| inner.to(&from_outer)).collect()
    }

    fn head(&self, outer: usize, inner: usize) -> (Pose<f64>, Word) {
        let word = joined(&self.outer.words[outer], &self.inner.words[inner]);
        (self.outer.poses[outer] * self.inner.poses[inner], word)
    }
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
    /// Sorts the products of `stages`, of an arm that reaches as far as `extent_m`, while `go_on` says so.
    pub(super) fn new(
        stages: &[Frames],
        extent_m: f64,
        length_scale_m: f64,
        rest: Word,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Self, ReachError> {
        let (left, right) = stages.split_at(frames::middle(stages));
        let (left, right) = (frames::product(left, rest), frames::product(right, rest));
        let tree = Tree::new(&left, &right, length_scale_m, go_on).ok_or(ReachError::GivenUp)?;
        let rounding_m = 64.0 * f64::from(f32::EPSILON) * (extent_m + length_scale_m);
        Ok(Self { left, right, tree, length_scale_m, rounding_m })
    }

    /// How many words they have.
    pub(super) fn words(&self) -> f64 {
        self.left.len() as f64 * self.right.len() as f64
    }

    fn bytes(&self) -> usize {
        self.left.bytes() + self.right.bytes() + self.tree.bytes()
    }

    /// Shows `seeker` words of some heads, of which the tails are to end at `wanted`, from the leaves where these would be. For
    /// each head the result is the square of a distance: tails closer than that are all in its leaf.
    pub(super) fn glance<S: Seeker>(
        &self,
        wanted: &[Pose<f64>],
        head: impl Fn(usize) -> (Pose<f64>, Word),
        seeker: &mut S,
    ) -> Vec<f32> {
        let mut free = vec![f32::INFINITY; wanted.len()];
        let (heads, probes) = self.probes(wanted, self.square(seeker.reach_m()));
        let cells = Probe::cells(&self.tree, &probes);
        self.tree.fetch(cells.iter().map(|cell| cell.number));
        for ((probe, Cell { number, free: to_split }), &k) in probes.iter().zip(cells).zip(&heads) {
            free[k] = free[k].min(to_split);
            self.look_in_leaf(probe, number, &wanted[k], || head(k), seeker);
        }
        free
    }

    /// Shows `seeker` all words of some heads within its reach.
    pub(super) fn search<S: Seeker>(
        &self,
        wanted: &[Pose<f64>],
        head: impl Fn(usize) -> (Pose<f64>, Word),
        seeker: &mut S,
    ) {
        let (heads, probes) = self.probes(wanted, self.square(seeker.reach_m()));
        let mut leaves: Vec<(usize, u32)> = Vec::with_capacity(FETCHED);
        let mut search = |leaves: &mut Vec<(usize, u32)>| {
            self.fetch_within(self.square(seeker.reach_m()), &probes, leaves);
            for (at, number) in leaves.drain(..) {
                self.look_in_leaf(&probes[at], number, &wanted[heads[at]], || head(heads[at]), seeker);
            }
            self.square(seeker.reach_m())
        };
        let mut reach = search(&mut leaves);
        for (at, probe) in probes.iter().enumerate() {
            probe.leaves(reach, &mut |number| {
                leaves.push((at, number));
                if leaves.len() == FETCHED {
                    reach = search(&mut leaves);
                }
                reach
            });
        }
        search(&mut leaves);
    }

    /// The balls around some poses that touch the tree, each with the place of its pose.
    fn probes(&self, wanted: &[Pose<f64>], reach: f32) -> (Vec<usize>, Vec<Probe<'_>>) {
        let around = |(k, wanted)| Probe::around(&self.tree, wanted).map(move |probe| (k, probe));
        let near = |(_, probe): &(usize, Probe<'_>)| probe.box_distance_squared() <= reach;
        wanted.iter().enumerate().flat_map(around).filter(near).unzip()
    }

    /// Drops the leaves beyond the square `reach` of their probes, and fetches the memory of the others.
    fn fetch_within(&self, reach: f32, probes: &[Probe<'_>], leaves: &mut Vec<(usize, u32)>) {
        leaves.retain(|&(at, number)| probes[at].reaches(number, reach));
        self.tree.fetch(leaves.iter().map(|(_, number)| *number));
    }

    /// Shows `seeker` the tails of one leaf within its reach.
    #[inline]
    fn look_in_leaf<S: Seeker>(
        &self,
        probe: &Probe<'_>,
        number: u32,
        wanted: &Pose<f64>,
        head: impl Fn() -> (Pose<f64>, Word),
        seeker: &mut S,
    ) {
        let reach = self.square(seeker.reach_m());
        probe.leaf(number, reach, |product| self.look(product, wanted, &head, seeker));
    }

    /// Shows `seeker` one tail; the square of its reach afterwards.
    fn look<S: Seeker>(
        &self,
        product: u32,
        wanted: &Pose<f64>,
        head: impl Fn() -> (Pose<f64>, Word),
        seeker: &mut S,
    ) -> f32 {
        let (left, right) = self.tree.factors(product);
        let tail = self.left.poses[left] * self.right.poses[right];
        let distance_m = tail.distance(wanted, self.length_scale_m);
        if distance_m <= seeker.reach_m() {
            let (pose, word) = head();
            let word = joined(&word, &joined(&self.left.words[left], &self.right.words[right]));
            seeker.see(Near { word, pose_base_tool: pose * tail, distance_m });
        }
        self.square(seeker.reach_m())
    }

    /// The square of a reach, with room for rounding.
    pub(super) fn square(&self, reach_m: f64) -> f32 {
        (reach_m + self.rounding_m).powi(2) as f32
    }
}

#[cfg(test)]
mod tests;
