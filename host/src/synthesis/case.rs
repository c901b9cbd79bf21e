//! Whether desired frames are few enough to be met: ranks of the concatenated Jacobian.

use std::fmt;

use darm_core::units::Word;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::SynthesisError;
use super::problem::Problem;

/// Singular values below this share of the largest count as zero.
pub(super) const RANK_TOLERANCE: f64 = 1e-9;

/// Whether desired frames are few enough to be met, in the paper's terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum CaseKind {
    /// Just as many as can be met.
    Sufficient,
    /// More than can be met in general: the sum of squares of what is missing is made small.
    Insufficient,
    /// Fewer: the alteration of the base-line is made small in the directions that are left.
    Redundant,
}

/// The case and the ranks that it follows from.
///
/// Between two modules a motion can be given to the one and taken from the other without any end frame noticing, so
/// the unknowns reach less than their number: for words that switch whole modules of a platform arm, the rank of
/// (states − 1) · modules + 1 frames. More frames than that are insufficient, however many unknowns are left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Case {
    /// The case.
    pub kind: CaseKind,
    /// Equations: 3 for each frame in the plane, 6 in space.
    pub equations: usize,
    /// Rank of the derivatives of all desired frames.
    pub rank: usize,
    /// The rank with as many more frames as one likes, of words that set each module as the desired words do.
    pub most: usize,
    /// Stops, and servo angles of the frames.
    pub unknowns: usize,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, equations, rank, most, unknowns } = self;
        let kind = match kind {
            CaseKind::Sufficient => "sufficient",
            CaseKind::Insufficient => "insufficient",
            CaseKind::Redundant => "redundant",
        };
        write!(f, "{kind}: {equations} equations of rank {rank}, {unknowns} unknowns of which such words feel {most}")
    }
}

/// The case of the frames of `problem`: of the ideal arm, where effects do not blur what the modules share.
pub(super) fn of(problem: &Problem) -> Result<Case, SynthesisError> {
    let desired: Vec<Word> = problem.targets.iter().map(|target| target.word).collect();
    let rank = rank(problem.ideal(&desired))?;
    let equations = problem.targets.len() * problem.n_rows();
    let most = most(problem, &desired).max(rank);
    let kind = if rank < equations {
        CaseKind::Insufficient
    } else if rank < most {
        CaseKind::Redundant
    } else {
        CaseKind::Sufficient
    };
    Ok(Case { kind, equations, rank, most, unknowns: problem.start().len() })
}

fn rank(mut problem: Problem) -> Result<usize, SynthesisError> {
    let mut scaled = problem.jacobian(&problem.start())?;
    for (mut column, weight) in scaled.column_iter_mut().zip(problem.weights().iter()) {
        column /= *weight;
    }
    let singular = scaled.singular_values();
    Ok(singular.iter().filter(|&&value| value > RANK_TOLERANCE * singular.max()).count())
}

/// The rank that any number of frames can have whose words set each stage as one of the desired words does. The servo
/// angles of a frame are its own: they count for as many frames as are desired.
fn most(problem: &Problem, desired: &[Word]) -> usize {
    let chain = &problem.base_line().model.chain;
    let stages: Vec<usize> = chain.actuators().map(|(stage, _)| stage).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let wanted = desired.len() + 2 * problem.n_stops() / problem.n_rows() + 2;
    let mut words = desired.to_vec();
    for _ in 0..8 * wanted {
        let choices: Vec<usize> = chain.stages.iter().map(|_| rng.random_range(0..desired.len())).collect();
        let mix = |word: Word, (actuator, &stage): (usize, &usize)| {
            word.with_digit(actuator, desired[choices[stage]].digit(actuator))
        };
        let word = stages.iter().enumerate().fold(problem.base_line().rest(), mix);
        if words.len() < wanted && !words.contains(&word) {
            words.push(word);
        }
    }
    let own = problem.n_servos() * (words.len() - desired.len());
    // A mixed word may have no pose: then only the desired ones are known to count.
    rank(problem.ideal(&words)).unwrap_or(0).saturating_sub(own)
}
