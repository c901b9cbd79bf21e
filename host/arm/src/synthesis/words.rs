//! Which word serves which frame, found together with the geometry.
//!
//! # Method
//!
//! Of all assignments of distinct words, the one is sought whose frames are met, to first order, by the least alteration:
//!
//! cost = rᵀ·(J·Jᵀ + μ²)⁻¹·r
//!
//! | symbol | meaning |
//! | --- | --- |
//! | r | the error of the base-line in each frame with its word, weighted as everywhere |
//! | J | derivatives of these words' end frames with respect to the stops |
//! | μ | [`SOFT`] of |J|: directions weaker than this count as missing, so ill-conditioned sets of words cost much |
//!
//! One frame's word is exchanged at a time, as long as the cost falls; what is then cheapest is solved exactly, within the
//! bounds. Where that fails, another first assignment leads to another choice.

use darm_core::se::Pose;
use darm_core::units::Word;
use nalgebra::{DMatrix, DVector};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Options, Status, Synthesis, SynthesisError, problem::Problem, synthesize};
use crate::arm::frames::DesiredFrame;
use crate::arm::{Arm, ArmScratch};

/// Singular directions below this share of the Jacobian's size count as missing.
const SOFT: f64 = 0.02;
/// Words that are looked at for one frame: those that bring the base-line's tool nearest.
const CANDIDATES: usize = 48;
/// First assignments.
const ASSIGNMENTS: u64 = 48;
/// Words that are looked at in an arm with more than these.
const MAX_WORDS: usize = 1 << 14;

/// A word that may serve a frame.
#[derive(Clone)]
struct Candidate {
    word: Word,
    residual: DVector<f64>,
    jacobian: DMatrix<f64>,
}

/// Looks for distinct words, one for each desired frame, and the geometry with which they reach the frames. The words in
/// `desired` do not matter; only words that `allowed` takes are chosen.
///
/// # Errors
///
/// [`SynthesisError::NoWords`]: there are fewer allowed words near the frames than frames, or no choice of them has a
/// synthesis. [`SynthesisError::NoPose`]: `base_line` has no pose for such a word at a frame.
pub fn choose_words(
    base_line: &Arm,
    desired: &[DesiredFrame],
    options: &Options,
    allowed: &dyn Fn(&Word) -> bool,
) -> Result<Synthesis, SynthesisError> {
    let words = words(base_line, options.seed, allowed);
    let candidates = candidates(base_line, desired, &words, options)?;
    let few_starts = Options { starts: 2, ..options.clone() };
    let mut tried: Vec<Vec<usize>> = Vec::new();
    let mut best: Option<Synthesis> = None;
    for seed in 0..ASSIGNMENTS {
        let Some(choice) = assign(&candidates, options.seed.wrapping_add(seed)) else { break };
        if tried.contains(&choice) {
            continue;
        }
        let chosen = choice.iter().zip(&candidates).map(|(&chosen, of_frame)| of_frame[chosen].word);
        let frames: Vec<DesiredFrame> =
            desired.iter().zip(chosen).map(|(frame, word)| DesiredFrame { word, ..frame.clone() }).collect();
        tried.push(choice);
        let Ok(found) = synthesize(base_line, &frames, &few_starts) else { continue };
        if best.as_ref().is_none_or(|best| found.is_nearer(best)) {
            best = Some(found);
        }
        if best.as_ref().is_some_and(|best| best.status == Status::Reached) || options.handle.is_ended() {
            break;
        }
    }
    best.ok_or(SynthesisError::NoWords { frames: desired.len(), words: words.len() })
}

/// All words that may serve, or as many drawn ones as are looked at.
fn words(arm: &Arm, seed: u64, allowed: &dyn Fn(&Word) -> bool) -> Vec<Word> {
    let states: Vec<u8> = (0..arm.n_actuators()).map(|actuator| arm.model.chain.n_states(actuator) as u8).collect();
    let count = states.iter().try_fold(1usize, |count, &states| count.checked_mul(states.into()));
    let mut words: Vec<Word> = match count.filter(|&count| count <= MAX_WORDS) {
        Some(count) => (0..count)
            .map(|mut number| {
                states.iter().enumerate().fold(arm.rest(), |word, (actuator, &states)| {
                    let digit = number % usize::from(states);
                    number /= usize::from(states);
                    word.with_digit(actuator, digit as u8)
                })
            })
            .collect(),
        None => {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut word = |_| {
                let digits = states.iter().enumerate();
                digits.fold(arm.rest(), |word, (actuator, &states)| {
                    word.with_digit(actuator, rng.random_range(0..states))
                })
            };
            (0..MAX_WORDS).map(&mut word).collect()
        }
    };
    words.sort_unstable();
    words.dedup();
    words.retain(allowed);
    words
}

/// For each frame the words that bring the tool of the base-line nearest, with their equations.
fn candidates(
    arm: &Arm,
    desired: &[DesiredFrame],
    words: &[Word],
    options: &Options,
) -> Result<Vec<Vec<Candidate>>, SynthesisError> {
    let mut scratch = ArmScratch::default();
    let poses: Vec<(Word, Pose<f64>)> = words
        .iter()
        .filter_map(|&word| {
            // Near enough to choose by: the word before and the servos of the first frame.
            let first = desired.first()?;
            let condition = arm.model.working(word, first.previous, &first.servos_rad);
            Some((word, arm.model.predict(&condition, &mut scratch).ok()?))
        })
        .collect();
    let of_frame = |frame: &DesiredFrame| {
        let mut near = by_distance(&poses, &frame.pose_base_tool, arm.length_scale_m);
        near.truncate(CANDIDATES.max(desired.len()));
        near.into_iter().map(|(_, word)| candidate(arm, frame, word, options)).collect()
    };
    desired.iter().map(of_frame).collect()
}

/// The words with the distances of their poses from `pose`, m, the nearest first.
fn by_distance(poses: &[(Word, Pose<f64>)], pose: &Pose<f64>, length_scale_m: f64) -> Vec<(f64, Word)> {
    let apart = |of: &Pose<f64>| of.distance(pose, length_scale_m);
    let mut near: Vec<(f64, Word)> = poses.iter().map(|(word, pose)| (apart(pose), *word)).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    near
}

/// The equations of a frame at the base-line, where `word` is to reach it.
fn candidate(arm: &Arm, frame: &DesiredFrame, word: Word, options: &Options) -> Result<Candidate, SynthesisError> {
    let frame = [DesiredFrame { word, ..frame.clone() }];
    let mut problem = Problem::new(arm, &frame, &options.bounds, &options.ranges);
    let (residual, jacobian) = problem.linearise_start()?;
    let jacobian = jacobian.columns(0, problem.n_stops()).into_owned();
    Ok(Candidate { word, residual, jacobian })
}

/// One assignment that no exchange of a single word makes cheaper.
fn assign(candidates: &[Vec<Candidate>], seed: u64) -> Option<Vec<usize>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut choice = Vec::new();
    for of_frame in candidates {
        let free: Vec<usize> =
            (0..of_frame.len()).filter(|&k| is_free(candidates, &choice, &of_frame[k].word)).collect();
        choice.push(*free.choose(&mut rng)?);
    }
    let mut lowest = cost(candidates, &choice);
    loop {
        let before = lowest;
        for frame in 0..candidates.len() {
            for chosen in 0..candidates[frame].len() {
                let word = candidates[frame][chosen].word;
                if !is_free(candidates, &choice, &word) {
                    continue;
                }
                let old = std::mem::replace(&mut choice[frame], chosen);
                let cost = cost(candidates, &choice);
                if cost < lowest {
                    lowest = cost;
                } else {
                    choice[frame] = old;
                }
            }
        }
        if lowest > 0.99 * before {
            return Some(choice);
        }
    }
}

fn is_free(candidates: &[Vec<Candidate>], choice: &[usize], word: &Word) -> bool {
    choice.iter().zip(candidates).all(|(&chosen, candidates)| candidates[chosen].word != *word)
}

fn cost(candidates: &[Vec<Candidate>], choice: &[usize]) -> f64 {
    let chosen = || choice.iter().zip(candidates).map(|(&chosen, candidates)| &candidates[chosen]);
    let n_rows = chosen().map(|candidate| candidate.residual.len()).sum();
    let n_columns = candidates.first().and_then(|first| first.first()).map_or(0, |first| first.jacobian.ncols());
    let mut jacobian = DMatrix::zeros(n_rows, n_columns);
    let mut residual = DVector::zeros(n_rows);
    let mut first = 0;
    for candidate in chosen() {
        let n = candidate.residual.len();
        jacobian.rows_mut(first, n).copy_from(&candidate.jacobian);
        residual.rows_mut(first, n).copy_from(&candidate.residual);
        first += n;
    }
    let soft = SOFT * jacobian.norm();
    let mut gram = &jacobian * jacobian.transpose();
    (0..n_rows).for_each(|k| gram[(k, k)] += soft * soft);
    gram.cholesky().map_or(f64::INFINITY, |cholesky| residual.dot(&cholesky.solve(&residual)))
}
