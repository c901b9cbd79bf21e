//! The nearest words of an arm with more heads than can be formed, as far as a given time leads, and a bound on what was
//! not looked at.
//!
//! # Method
//!
//! As in [`exact`](super::exact) the frames of the last stages are in a tree. The heads are not formed: a choice for the
//! first j stages leaves the pose W to be reached by the others. The one that promises most is opened first, until it is
//! a head, whose nearest tail is sought.
//!
//! # Bound
//!
//! All frames of stages j to n lie around one of them, K: no farther than r in position, no more than φ in orientation.
//! The distance is left invariant, so no word behind the choice is closer than
//!
//! b² = max(|p_W − p_K| − r, 0)² + ℓ²·max(∠(W, K) − φ, 0)².
//!
//! For a stage with frames A before the rest K', r', φ': K = A₀·K' with A₀ amid the A, r = max |A·p_K' − p_K| + r', φ =
//! max ∠(A, A₀) + φ'. Choices that cannot lead closer than the words found are left out. What is not yet opened when
//! the time is over, or had to be forgotten for want of room, has the least of its bounds.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use darm_core::nearest::{Frame, typical};
use darm_core::se::Pose;
use darm_core::units::Word;
use rayon::prelude::*;

use super::ReachError;
use super::exact::{Near, Nearest, Options, Query, Seeker as _, Tails, cut, extent_m, stages};
use super::frames::Frames;
use crate::arm::Arm;
use crate::stage_settings::joined;

/// What a bound may be wrong by, m.
const ROUNDING_M: f64 = 1e-12;
/// Choices that wait to be opened, at most.
const MAX_OPEN: usize = 1 << 18;
/// Heads whose tails are sought side by side.
const ABREAST: usize = 256;

/// The nearest words that were found.
#[derive(Clone, Debug, PartialEq)]
pub struct Anytime {
    /// Nearest first.
    pub nearest: Vec<Near>,
    /// No word is closer than this, m: the distance of the nearest found, where that is proven.
    pub lower_bound_m: f64,
    /// The share of all words that were looked at or cannot be nearer.
    pub settled: f64,
    /// How many words the arm has.
    pub words: f64,
}

/// A ball of poses: around one, so far in position and in orientation.
#[derive(Clone, Copy)]
struct Ball {
    center: Pose<f64>,
    radius_m: f64,
    radius_rad: f64,
    /// Words that end in it.
    words: f64,
}

/// A choice for the first stages.
#[derive(Clone, Copy)]
struct Choice {
    depth: usize,
    word: Word,
    /// Pose of its end in the base.
    pose: Pose<f64>,
    /// Distance of the target from the middle of what is behind, m.
    promise_m: f64,
    bound_m: f64,
}

/// The nearest words, as far as they are found while `go_on` says so; it is asked every few milliseconds.
///
/// # Errors
///
/// [`ReachError::NoSetting`]: a stage cannot be assembled in any of the settings that `options` allow.
pub fn nearest(
    arm: &Arm,
    query: &Query<'_>,
    options: &Options,
    go_on: impl FnMut() -> bool,
) -> Result<Anytime, ReachError> {
    let &Query { target, count, forbidden } = query;
    let stages = stages(arm, options)?;
    let (head, tail) = stages.split_at(cut(&stages, options.max_tails));
    let tails = Tails::new(tail, extent_m(&stages), options.length_scale_m, arm.rest(), &|| true)?;
    let mut search = Search {
        target,
        scale_m: options.length_scale_m,
        balls: balls(head, &tails),
        head,
        tails,
        seeker: Nearest { count, forbidden, best: Vec::new() },
        open: BinaryHeap::new(),
        forgotten: (f64::INFINITY, 0.0),
    };
    search.run(arm.rest(), go_on);
    Ok(search.answer())
}

struct Search<'a> {
    target: &'a Pose<f64>,
    scale_m: f64,
    head: &'a [Frames],
    tails: Tails,
    /// What is behind the first j stages.
    balls: Vec<Ball>,
    seeker: Nearest<'a>,
    open: BinaryHeap<Choice>,
    /// The least bound of what was forgotten, and how many words.
    forgotten: (f64, f64),
}

impl Search<'_> {
    fn run(&mut self, rest: Word, mut go_on: impl FnMut() -> bool) {
        let root = self.choice(0, rest, Pose::identity());
        self.open.push(root);
        let mut heads = Vec::with_capacity(ABREAST);
        loop {
            match self.open.pop() {
                Some(choice) if choice.bound_m > self.seeker.reach_m() => continue,
                Some(choice) if choice.depth < self.head.len() => self.open(&choice),
                Some(choice) => heads.push(choice),
                None if heads.is_empty() => return,
                None => {}
            }
            if heads.len() == ABREAST || self.open.is_empty() {
                self.look(&heads);
                heads.clear();
                if !go_on() {
                    return;
                }
            }
        }
    }

    /// Adds the choices for one stage more.
    fn open(&mut self, choice: &Choice) {
        let stage = &self.head[choice.depth];
        for (pose, word) in stage.poses.iter().zip(&stage.words) {
            let next = self.choice(choice.depth + 1, joined(&choice.word, word), choice.pose * *pose);
            if next.bound_m <= self.seeker.reach_m() {
                self.open.push(next);
            }
        }
        if self.open.len() > MAX_OPEN {
            let mut sorted = std::mem::take(&mut self.open).into_sorted_vec();
            for choice in sorted.drain(..sorted.len() / 2) {
                self.forgotten.0 = self.forgotten.0.min(choice.bound_m);
                self.forgotten.1 += self.balls[choice.depth].words;
            }
            self.open = sorted.into();
        }
    }

    fn choice(&self, depth: usize, word: Word, pose: Pose<f64>) -> Choice {
        let ball = &self.balls[depth];
        let apart = ball.center.to(&pose.to(self.target));
        let (off_m, off_rad) = (apart.position.norm(), self.scale_m * apart.angle_rad());
        let outside_m = (off_m - ball.radius_m).max(0.0);
        let outside_rad = (off_rad - self.scale_m * ball.radius_rad).max(0.0);
        let bound_m = (outside_m.hypot(outside_rad) - ROUNDING_M).max(0.0);
        Choice { depth, word, pose, promise_m: off_m.hypot(off_rad), bound_m }
    }

    /// Seeks the nearest tails of some heads, all within what is the nearest before.
    fn look(&mut self, heads: &[Choice]) {
        let (tails, target, before) = (&self.tails, self.target, &self.seeker);
        let found = heads.par_iter().fold(
            || before.clone(),
            |mut seeker, head| {
                let wanted = head.pose.to(target);
                let (wanted, head) = (std::slice::from_ref(&wanted), |_| (head.pose, head.word));
                let free = tails.glance(wanted, head, &mut seeker)[0];
                if free <= tails.square(seeker.reach_m()) {
                    tails.search(wanted, head, &mut seeker);
                }
                seeker
            },
        );
        let found: Vec<Near> = found.flat_map_iter(|seeker| seeker.best).collect();
        for near in found {
            self.seeker.see(near);
        }
    }

    fn answer(self) -> Anytime {
        let reach_m = self.seeker.reach_m();
        let left = self.open.iter().filter(|choice| choice.bound_m <= reach_m);
        let (bound_m, words) = left.fold(self.forgotten, |(bound_m, words), choice| {
            (bound_m.min(choice.bound_m), words + self.balls[choice.depth].words)
        });
        let nearest_m = self.seeker.best.first().map_or(f64::INFINITY, |near| near.distance_m);
        let all = self.balls.first().map_or(1.0, |ball| ball.words);
        Anytime {
            nearest: self.seeker.best,
            lower_bound_m: bound_m.min(nearest_m),
            settled: 1.0 - words / all,
            words: all,
        }
    }
}

/// What is behind the first 0, 1, … stages of `head`, the tails behind all.
fn balls(head: &[Frames], tails: &Tails) -> Vec<Ball> {
    let right = ball(&tails.right, &Ball { center: Pose::identity(), radius_m: 0.0, radius_rad: 0.0, words: 1.0 });
    let mut balls = vec![ball(&tails.left, &right)];
    for stage in head.iter().rev() {
        balls.extend(balls.last().map(|behind| ball(stage, behind)));
    }
    balls.reverse();
    balls
}

/// The ball of the frames of a stage with those of a ball behind it.
fn ball(stage: &Frames, behind: &Ball) -> Ball {
    let framed: Vec<_> = stage.poses.iter().map(|pose| Frame { digits: 0, pose: *pose }).collect();
    let middle = typical(&framed);
    let center = middle * behind.center;
    let (mut radius_m, mut radius_rad) = (0.0f64, 0.0f64);
    for pose in &stage.poses {
        radius_m = radius_m.max((*pose * behind.center.position - center.position).norm());
        radius_rad = radius_rad.max(middle.to(pose).angle_rad());
    }
    Ball {
        center,
        radius_m: radius_m + behind.radius_m,
        radius_rad: radius_rad + behind.radius_rad,
        words: behind.words * stage.len() as f64,
    }
}

/// The choice that promises most is the greatest.
impl Ord for Choice {
    fn cmp(&self, other: &Self) -> Ordering {
        other.promise_m.total_cmp(&self.promise_m).then(self.word.cmp(&other.word))
    }
}

impl PartialOrd for Choice {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Choice {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Choice {}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::super::exact::Index;
    use super::*;

    /// The spatial example with its first stages again in front: 64^(6 + more) words.
    fn arm(name: &str, more: usize) -> Arm {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name);
        let mut arm = Arm::read(&path).unwrap();
        for at in 0..more {
            let stage = arm.model.chain.stages[at];
            arm.model.chain.stages.push(stage).unwrap();
        }
        arm
    }

    fn target(arm: &Arm, random: &mut ChaCha8Rng) -> Pose<f64> {
        let digits: Vec<u8> = (0..arm.n_actuators()).map(|_| random.random_range(0..2)).collect();
        let pose = arm.model.chain.pose_base_tool(&Word::new(&digits).unwrap(), &[], &mut Default::default()).unwrap();
        let mut small = || darm_core::real::Vec3::from_fn(|_, _| random.random_range(-0.1..0.1));
        pose * Pose::new(&small(), small())
    }

    #[test]
    fn what_runs_to_its_end_is_proven() {
        let (arm, mut random) = (arm("planar4.toml", 0), ChaCha8Rng::seed_from_u64(1));
        for max_tails in [1, 64] {
            let options = Options { max_tails, ..Options::of(&arm) };
            let index = Index::new(&arm, &options).unwrap();
            for _ in 0..20 {
                let target = target(&arm, &mut random);
                let found =
                    nearest(&arm, &Query { target: &target, count: 3, forbidden: &[] }, &options, || true).unwrap();
                for (found, exact) in found.nearest.iter().zip(index.nearest(&target, 3, &[])) {
                    assert!((found.distance_m - exact.distance_m).abs() < 1e-12);
                }
                assert_eq!((found.lower_bound_m, found.settled), (found.nearest[0].distance_m, 1.0));
            }
        }
    }

    #[test]
    fn what_is_stopped_says_what_it_may_have_missed() {
        let (arm, mut random) = (arm("planar4.toml", 1), ChaCha8Rng::seed_from_u64(2));
        let options = Options { max_tails: 8, ..Options::of(&arm) };
        let index = Index::new(&arm, &options).unwrap();
        for looks in [1, 2, 4, 8] {
            let (target, mut left) = (target(&arm, &mut random), looks);
            let found = nearest(&arm, &Query { target: &target, count: 1, forbidden: &[] }, &options, || {
                left -= 1;
                left > 0
            });
            let (found, exact) = (found.unwrap(), index.nearest(&target, 1, &[])[0].distance_m);
            assert!(
                found.lower_bound_m < exact + 1e-9 && exact < found.nearest[0].distance_m + 1e-9,
                "{found:?} {exact}"
            );
            assert!((0.0..=1.0).contains(&found.settled));
        }
    }

    #[test]
    fn a_word_of_an_arm_too_large_for_an_index_is_found() {
        let arm = arm("spatial6.toml", 2);
        let target = target(&arm, &mut ChaCha8Rng::seed_from_u64(3));
        let options = Options { max_tails: 1 << 12, ..Options::of(&arm) };
        let mut left = 8;
        let found = nearest(&arm, &Query { target: &target, count: 2, forbidden: &[] }, &options, || {
            left -= 1;
            left > 0
        });
        let found = found.unwrap();
        assert!(found.words > 2e14 && found.nearest.len() == 2 && found.nearest[0].distance_m < 0.3, "{found:?}");
        assert!(found.lower_bound_m <= found.nearest[0].distance_m && found.settled < 1.0);
    }
}
