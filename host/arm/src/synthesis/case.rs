//! Whether desired frames are few enough to be met: ranks of the concatenated Jacobian.

use std::fmt;

use darm_core::units::Word;
use nalgebra::DVector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::SynthesisError;
use super::problem::Problem;

/// Singular values below this share of the largest count as zero.
pub(super) const RANK_TOLERANCE: f64 = 1e-9;
/// A row that points out of the span of others by less than this share of the size of all counts as dependent.
const INDEPENDENT: f64 = 1e-8;

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
/// the unknowns reach less than their number: for words that switch complete modules of a platform arm, the rank of
/// (states − 1) · modules + 1 frames. More frames than that are insufficient, however many unknowns are left.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Case {
    /// The case.
    pub kind: CaseKind,
    /// Equations: 3 for each frame in the plane, 6 in space; less by 1 and 3 where the orientation is free.
    pub equations: usize,
    /// Rank of the derivatives of all desired frames.
    pub rank: usize,
    /// The rank with as many more frames as one likes: of words that switch complete modules where the desired ones
    /// do, else of words that set each module as a desired word does.
    pub max_rank: usize,
    /// Stops, and servo angles of the frames.
    pub unknowns: usize,
    /// Stops that no desired word uses.
    pub unused: usize,
    /// Modules, where the words switch complete ones, all their actuators at once, and so choose
    /// (states − 1) · modules + 1 frames.
    pub complete_modules: Option<CompleteModules>,
    /// Frames that follow from those before them, completely or in part.
    pub bound: Vec<BoundFrame>,
}

/// Words that switch complete modules.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct CompleteModules {
    /// How many modules.
    pub modules: usize,
    /// States of each.
    pub states: usize,
    /// Frames that such words choose.
    pub frames: usize,
}

/// A frame that follows, completely or in part, from those before it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct BoundFrame {
    /// Its place among the desired frames.
    pub index: usize,
    /// Its equations.
    pub equations: usize,
    /// How many of them the frames before leave open.
    pub open: usize,
}

impl Case {
    /// Directions of the used unknowns to which no desired frame is sensitive: motions that one module gives and the
    /// next takes.
    pub fn free(&self) -> usize {
        self.unknowns - self.unused - self.rank
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, equations, rank, max_rank, unknowns, unused, .. } = self;
        let kind = match kind {
            CaseKind::Sufficient => "sufficient",
            CaseKind::Insufficient => "insufficient",
            CaseKind::Redundant => "redundant",
        };
        write!(
            f,
            "{kind}: {equations} equations of rank {rank}, {max_rank} of {unknowns} unknowns affect these words"
        )?;
        write!(f, "; free: {} directions between modules", self.free())?;
        if *unused > 0 {
            write!(f, ", {unused} stops that no word uses")?;
        }
        for BoundFrame { index, equations, open } in &self.bound {
            let missing = equations - open;
            write!(
                f,
                "; missing: {missing} of {equations} directions of frame {}, which follow from those before it",
                index + 1
            )?;
        }
        match (self.kind, self.complete_modules) {
            (CaseKind::Insufficient, Some(CompleteModules { modules, states, frames })) => write!(
                f,
                "; what one module gives the next can take back, so words that switch complete modules choose (states - 1) x \
                 modules + 1 = ({states} - 1) x {modules} + 1 = {frames} frames: leave frames out, or use words that \
                 switch single legs"
            ),
            (CaseKind::Insufficient, None) => {
                write!(f, "; leave frames out, free their orientation, or use words with more different digits")
            }
            _ => Ok(()),
        }
    }
}

/// The case of the frames of `problem`: of the ideal arm, where effects do not blur what the modules share.
pub(super) fn of(problem: &Problem) -> Result<Case, SynthesisError> {
    let desired = problem.words();
    let module_of = modules(problem, &desired);
    let complete = complete_modules(problem, &desired, &module_of);
    let more: Vec<Word> = match complete {
        Some(modules) => switched(problem, &module_of, modules),
        None => mixed(problem, &desired, &module_of),
    };
    let more: Vec<Word> = more.into_iter().filter(|word| !desired.contains(word)).collect();
    // One of more words may have no pose: then only the desired ones are known to count.
    let (jacobian, more) = match problem.ideal_jacobian(&more) {
        Ok(jacobian) => (jacobian, more.len()),
        Err(_) => (problem.ideal_jacobian(&[])?, 0),
    };
    let own = problem.n_stops() + problem.n_servos() * desired.len();
    let mut span = Span::new(jacobian.norm());
    let mut bound = Vec::new();
    let mut first = 0;
    for (index, target) in problem.targets.iter().enumerate() {
        let equations = target.rows.len();
        let rows = first..first + equations;
        let open = rows
            .filter(|&row| span.grows(jacobian.row(row).columns(0, own).transpose().column(0).into_owned()))
            .count();
        if open < equations {
            bound.push(BoundFrame { index, equations, open });
        }
        first += equations;
    }
    let (equations, rank) = (problem.n_rows(), span.rank());
    let per_frame = if problem.is_planar() { 3 } else { 6 };
    for row in first..first + more * per_frame {
        // The servos of such words are fixed.
        let stops = jacobian.row(row).columns(0, problem.n_stops()).transpose().column(0).into_owned();
        span.grows(stops.resize_vertically(own, 0.0));
    }
    let max_rank = span.rank();
    let kind = if rank < equations {
        CaseKind::Insufficient
    } else if rank < max_rank {
        CaseKind::Redundant
    } else {
        CaseKind::Sufficient
    };
    let unused = problem.n_stops() - problem.n_used_stops();
    let complete_modules = complete.filter(|modules| modules.frames * per_frame == max_rank);
    Ok(Case { kind, equations, rank, max_rank, unknowns: own, unused, complete_modules, bound })
}

/// The module of each actuator: a platform, or neighbouring joints that have one digit in every word.
fn modules(problem: &Problem, words: &[Word]) -> Vec<usize> {
    let chain = &problem.base_line().model.chain;
    let stages: Vec<usize> = chain.actuators().map(|(stage, _)| stage).collect();
    let mut module = 0;
    let number = |k: usize| {
        if k > 0 && stages[k] != stages[k - 1] {
            let joints = [k - 1, k].iter().all(|&k| chain.stages[stages[k]].leg(0).is_none());
            module += usize::from(!(joints && alike(words, k)));
        }
        module
    };
    (0..stages.len()).map(number).collect()
}

/// Whether an actuator has the digit of the one before it in every word.
fn alike(words: &[Word], actuator: usize) -> bool {
    words.iter().all(|word| word.digit(actuator) == word.digit(actuator - 1))
}

/// The modules, where every word gives all actuators of a module one digit.
fn complete_modules(problem: &Problem, words: &[Word], module_of: &[usize]) -> Option<CompleteModules> {
    let is_complete = (1..module_of.len()).all(|k| module_of[k] != module_of[k - 1] || alike(words, k));
    let modules = module_of.last()? + 1;
    let chain = &problem.base_line().model.chain;
    let states = (0..module_of.len()).map(|actuator| chain.n_states(actuator)).min()?;
    is_complete.then_some(CompleteModules { modules, states, frames: (states - 1) * modules + 1 })
}

/// The word at rest, and those that switch one module: every other word of complete modules follows from them.
fn switched(
    problem: &Problem,
    module_of: &[usize],
    CompleteModules { modules, states, .. }: CompleteModules,
) -> Vec<Word> {
    let rest = problem.base_line().rest();
    let switch = |switched: usize, digit: usize| {
        let actuators = module_of.iter().enumerate().filter(|&(_, &module)| module == switched);
        actuators.fold(rest, |word, (actuator, _)| word.with_digit(actuator, digit as u8))
    };
    let words = (0..modules).flat_map(|module| (1..states).map(move |digit| (module, digit)));
    std::iter::once(rest).chain(words.map(|(module, digit)| switch(module, digit))).collect()
}

/// Words that set each module as one of the desired words does.
fn mixed(problem: &Problem, desired: &[Word], module_of: &[usize]) -> Vec<Word> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let per_frame = if problem.is_planar() { 3 } else { 6 };
    let word = |_| {
        let choices: Vec<usize> = module_of.iter().map(|_| rng.random_range(0..desired.len())).collect();
        module_of.iter().enumerate().fold(problem.base_line().rest(), |word, (actuator, &module)| {
            word.with_digit(actuator, desired[choices[module]].digit(actuator))
        })
    };
    let mut words: Vec<Word> = (0..2 * problem.n_stops() / per_frame + 2).map(word).collect();
    words.sort_unstable();
    words.dedup();
    words
}

/// The rows met so far, made orthonormal one after the other (Gram–Schmidt, twice).
struct Span {
    rows: Vec<DVector<f64>>,
    threshold: f64,
}

impl Span {
    fn new(size: f64) -> Self {
        Self { rows: Vec::new(), threshold: INDEPENDENT * size }
    }

    fn rank(&self) -> usize {
        self.rows.len()
    }

    /// Whether a row points out of the span; then it belongs to it.
    fn grows(&mut self, mut row: DVector<f64>) -> bool {
        for _ in 0..2 {
            for known in &self.rows {
                row.axpy(-known.dot(&row), known, 1.0);
            }
        }
        let length = row.norm();
        if length <= self.threshold {
            return false;
        }
        self.rows.push(row / length);
        true
    }
}
