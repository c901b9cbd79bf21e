//! The nearest word by the model with its effects, out of more words than can be tried.
//!
//! An [`Index`] knows the geometry alone. Where the geometry has the tool at G(w) and the model at G(w)·E(w), the word
//! whose tool is at the target T has G(w) = T·E(w)⁻¹. E differs little between words that stand near each other, so the
//! index is searched for T·E⁻¹ with E of the best word so far, the words that it names are judged by the model, and
//! so on until none is nearer. The word found is near, not proven to be the nearest.

use std::collections::BTreeSet;

use darm_core::se::Pose;
use darm_core::units::Word;

use super::exact::{Index, Near};
use super::judge::Judge;
use super::{Candidate, ReachError};
use crate::arm::{Arm, ArmScratch};

/// Most times that the index is asked.
const ROUNDS: usize = 8;
/// Words of one answer that are judged. Where the orientation is free, effects move the tools of words that the geometry has at
/// one position millimetres apart: the best of 64 was 4 mm from its target, of an arm of 64⁶ words.
const ASKED: usize = 1024;

/// The `count` words that bring the tool nearest to `target` by the model of `arm`, coming from the word `previous`, of
/// those that the `index` of its geometry names; nearest first.
///
/// # Errors
///
/// [`ReachError::Servos`]: the arm has servo joints. [`ReachError::NoPose`]: the model has no pose for any of the
/// words, or its geometry none for the nearest.
pub fn nearest(
    arm: &Arm,
    index: &Index,
    target: &Pose<f64>,
    previous: &Word,
    count: usize,
) -> Result<Vec<Candidate>, ReachError> {
    if arm.n_servos() > 0 {
        return Err(ReachError::Servos);
    }
    let (mut aim, mut scratch) = (*target, ArmScratch::default());
    let mut judge = Judge::new(arm, target, previous);
    let (mut judged, mut found): (BTreeSet<Word>, Vec<Candidate>) = (BTreeSet::new(), Vec::new());
    let mut refused = None;
    for _ in 0..ROUNDS {
        let nearest_m = found.first().map_or(f64::INFINITY, |best| best.distance_m);
        for near in index.nearest(&aim, count.max(ASKED), &[]) {
            if judged.insert(near.word) {
                match judge.judge(near.word, Vec::new()) {
                    Ok(candidate) => found.push(candidate),
                    Err(reason) => refused = Some(reason),
                }
            }
        }
        found.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
        let Some(best) = found.first().filter(|best| best.distance_m < nearest_m) else { break };
        let ideal = arm.model.chain.pose_base_tool(&best.word, &[], &mut scratch).map_err(ReachError::NoPose)?;
        aim = *target * best.pose_base_tool.to(&ideal);
    }
    match refused {
        Some(reason) if found.is_empty() => Err(ReachError::NoPose(reason)),
        _ => {
            found.truncate(count);
            Ok(found)
        }
    }
}

impl From<Candidate> for Near {
    fn from(candidate: Candidate) -> Self {
        let Candidate { word, pose_base_tool, distance_m, .. } = candidate;
        Self { word, pose_base_tool, distance_m }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::reach::board;
    use crate::reach::exact::Options;

    const TARGETS: usize = 3;

    fn read(file: &str) -> Arm {
        Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(file)).unwrap()
    }

    /// The arm that was diagnosed, before and after it, and as it is: see `tests/data/corrected`.
    fn arms() -> [Arm; 3] {
        let corrected = read("tests/data/corrected/corrected.toml");
        let mut nominal = corrected.clone();
        nominal.model.effects.clear();
        [nominal, corrected, read("tests/data/corrected/real.toml")]
    }

    fn pose_at_rest(arm: &Arm, word: &Word) -> Pose<f64> {
        arm.model.predict(&arm.model.working(*word, arm.rest(), &[]), &mut ArmScratch::default()).unwrap()
    }

    #[test]
    fn words_planned_with_the_corrected_model_bring_the_real_arm_nearer() {
        let [nominal, corrected, real] = arms();
        let index = Index::new(&nominal, &Options::of(&nominal)).unwrap();
        let frames = [&nominal, &corrected].map(|arm| board::records(arm).unwrap());
        let mut random = ChaCha8Rng::seed_from_u64(5);
        // By the host and by the board, each with the nominal and with the corrected model.
        let mut squares = [0.0; 4];
        for _ in 0..TARGETS {
            let digits: Vec<u8> = (0..36).map(|_| random.random_range(0..2)).collect();
            let target = pose_at_rest(&real, &Word::new(&digits).unwrap()) * Pose::at([3e-3, -2e-3, 1e-3].into());
            let by_host = nearest(&corrected, &index, &target, &corrected.rest(), 1).unwrap()[0].word;
            let by_board = frames.each_ref().map(|frames| board::nearest(frames, 36, &target).unwrap().word);
            let words = [index.nearest(&target, 1, &[])[0].word, by_host, by_board[0], by_board[1]];
            for (square, word) in squares.iter_mut().zip(words) {
                *square += pose_at_rest(&real, &word).distance(&target, real.length_scale_m).powi(2);
            }
        }
        let [host, host_corrected, board, board_corrected] =
            squares.map(|square: f64| 1e3 * (square / TARGETS as f64).sqrt());
        assert!(host_corrected < 0.3 * host, "{host_corrected} {host}");
        // The board knows of sag only what it does on average.
        assert!(board_corrected < board, "{board_corrected} {board}");
    }

    #[test]
    fn without_effects_the_words_are_those_of_the_index() {
        let arm = read("examples/planar4.toml");
        let index = Index::new(&arm, &Options::of(&arm)).unwrap();
        let target = pose_at_rest(&arm, &"010110011101".parse().unwrap()) * Pose::at([2e-3, 1e-3, 0.0].into());
        let found = nearest(&arm, &index, &target, &arm.rest(), 3).unwrap();
        let near = index.nearest(&target, 3, &[]);
        assert_eq!((found.len(), found[0].word), (3, near[0].word));
        // Modules that are alike stand in the same pose in several orders.
        assert!(found.iter().zip(&near).all(|(a, b)| (a.distance_m - b.distance_m).abs() < 1e-9), "{found:?} {near:?}");
        let hybrid = read("examples/planar4-hybrid.toml");
        assert_eq!(nearest(&hybrid, &index, &target, &hybrid.rest(), 1), Err(ReachError::Servos));
    }
}
