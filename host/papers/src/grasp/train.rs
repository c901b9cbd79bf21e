//! The greedy sequence of λ over a training set of random constraints (section 3.2 of the paper).
//!
//! Every constraint is searched from every λ; what solved what is all that is kept, a line of 0 and 1 for each
//! constraint. A file that holds these lines lets a training continue where it was stopped.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use rayon::prelude::{IntoParallelRefIterator as _, ParallelIterator as _};
use sha2::{Digest as _, Sha256};

use super::contact::Contacts;
use super::hand::Hand;
use super::paper::{End, Settings};

/// Table 1 of the paper, for the hand MA-I.
pub const PAPER_LAMBDAS: [f64; 10] = [0.61, 0.47, 0.95, 0.46, 0.73, 0.00, 0.45, 0.89, 1.00, 0.37];
/// Success of its first λ on all constraints, and of its second on the rest, percent.
pub const PAPER_SUCCESS: [f64; 2] = [77.86, 37.44];

/// Constraints between two writings of the file.
const BLOCK: usize = 100;

/// What is trained with; the paper's by default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Training {
    /// Constraints of the training set.
    pub count: usize,
    /// Values of λ, evenly from 0 to 1.
    pub lambdas: usize,
    /// Seed of the constraints.
    pub seed: u64,
    /// Constants of the search.
    pub settings: Settings,
}

impl Default for Training {
    fn default() -> Self {
        Self { count: 10_000, lambdas: 100, seed: 1, settings: Settings::default() }
    }
}

/// Which λ solved which constraint.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcomes {
    /// The values of λ.
    pub lambdas: Vec<f64>,
    /// For each constraint, whether each λ solved it.
    pub solved: Vec<Vec<bool>>,
}

/// One λ of the sequence.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// The value.
    pub lambda: f64,
    /// Percentage of the constraints that no λ before has solved, for every λ of the training: a line of Fig. 4.
    pub rates: Vec<f64>,
    /// That of the chosen one.
    pub rate: f64,
    /// Percentage of all constraints that the sequence solves up to here: Fig. 5.
    pub accumulated: f64,
}

/// Why a training has no outcome.
#[derive(Debug, thiserror::Error)]
pub enum TrainingError {
    /// The file cannot be read or written.
    #[error("{}: {error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// The file belongs to another training.
    #[error("{} holds another training (hand, n, lambdas, seed or constants differ); name another file or remove it", path.display())]
    Other {
        /// The file.
        path: PathBuf,
    },
    /// Every posture that was drawn collides.
    #[error(
        "of {asked} postures only {found} could be drawn without a collision: check the shapes and limits of the hand"
    )]
    NoPosture {
        /// How many were requested.
        asked: usize,
        /// How many there are.
        found: usize,
    },
}

impl Training {
    /// The values of λ.
    pub fn values(&self) -> Vec<f64> {
        let last = self.lambdas.saturating_sub(1).max(1) as f64;
        (0..self.lambdas).map(|k| k as f64 / last).collect()
    }

    /// Searches every constraint from every λ on all cores; `progress` hears how many constraints are done.
    ///
    /// With a `file` whatever it holds already is not done again, and what is done is added to it.
    ///
    /// # Errors
    ///
    /// [`TrainingError::NoPosture`]: too few of the postures that were drawn are free of collisions.
    /// [`TrainingError::File`]: `file` cannot be read or written. [`TrainingError::Other`]: it belongs to another
    /// training.
    pub fn run(
        &self,
        hand: &Hand,
        file: Option<&Path>,
        mut progress: impl FnMut(usize),
    ) -> Result<Outcomes, TrainingError> {
        let lambdas = self.values();
        let constraints = hand.draw_many(self.count, self.seed);
        if constraints.len() < self.count {
            return Err(TrainingError::NoPosture { asked: self.count, found: constraints.len() });
        }
        let (mut solved, mut kept) = match file {
            Some(path) => self.resume(hand, path)?,
            None => (Vec::new(), None),
        };
        progress(solved.len());
        while let Some(rest) = constraints.get(solved.len()..).filter(|rest| !rest.is_empty()) {
            let block = &rest[..rest.len().min(BLOCK)];
            let block: Vec<_> = block.par_iter().map(|contacts| self.solved(hand, contacts)).collect();
            if let (Some(kept), Some(path)) = (&mut kept, file) {
                let written = kept.write_all(lines(&block).as_bytes());
                written.map_err(|error| TrainingError::File { path: path.into(), error })?;
            }
            solved.extend(block);
            progress(solved.len());
        }
        Ok(Outcomes { lambdas, solved })
    }

    /// Whether each λ solves the contacts.
    pub fn solved(&self, hand: &Hand, contacts: &Contacts) -> Vec<bool> {
        let end = |lambda: f64| hand.attempt(lambda, contacts, &self.settings, |_| ()).end;
        self.values().into_iter().map(|lambda| end(lambda) == End::Solved).collect()
    }

    /// What the file holds, and the file open for more; a last line that was cut off is dropped.
    fn resume(&self, hand: &Hand, path: &Path) -> Result<(Vec<Vec<bool>>, Option<File>), TrainingError> {
        let failed = |error| TrainingError::File { path: path.into(), error };
        let head = self.head(hand);
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(failed(error)),
        };
        let other = || TrainingError::Other { path: path.into() };
        let rows = match text.split_once('\n') {
            Some((first, rows)) if first == head => rows,
            None if text.is_empty() => "",
            _ => return Err(other()),
        };
        let complete = rows.rsplit_once('\n').map_or("", |(rows, _)| rows);
        let row = |line: &str| -> Option<Vec<bool>> {
            let digits: Option<Vec<bool>> = line.chars().map(|c| Some(c.to_digit(2)? == 1)).collect();
            digits.filter(|digits| digits.len() == self.lambdas)
        };
        let solved: Option<Vec<_>> = complete.lines().map(row).collect();
        let solved = solved.filter(|solved| solved.len() <= self.count).ok_or_else(other)?;
        let mut kept = File::create(path).map_err(failed)?;
        kept.write_all(format!("{head}\n{}", lines(&solved)).as_bytes()).map_err(failed)?;
        Ok((solved, Some(kept)))
    }

    /// The first line of a file: what the training is about.
    fn head(&self, hand: &Hand) -> String {
        let hash = Sha256::digest(format!("{hand:?} {self:?}"));
        let hash = hash.iter().take(8).fold(String::new(), |mut text, byte| {
            // Writing into a string does not fail.
            let _ = write!(text, "{byte:02x}");
            text
        });
        format!("darm grasp train 1: n {}, lambdas {}, seed {}, hash {hash}", self.count, self.lambdas, self.seed)
    }
}

fn lines(rows: &[Vec<bool>]) -> String {
    let line =
        |row: &Vec<bool>| row.iter().map(|solved| if *solved { '1' } else { '0' }).chain(['\n']).collect::<String>();
    rows.iter().map(line).collect()
}

impl Outcomes {
    /// The greedy sequence: each λ solves most of what is left, until `length` are chosen or nothing more is solved.
    pub fn sequence(&self, length: usize) -> Vec<Chosen> {
        let mut left: Vec<&Vec<bool>> = self.solved.iter().collect();
        let mut sequence = Vec::new();
        while sequence.len() < length {
            let count = |k: usize| left.iter().filter(|row| row[k]).count();
            // The least λ of several that solve as many.
            let Some(best) = (0..self.lambdas.len()).rev().max_by_key(|k| count(*k)).filter(|k| count(*k) > 0) else {
                break;
            };
            let percent = |part: usize, total: usize| 100.0 * part as f64 / total as f64;
            let rates: Vec<f64> = (0..self.lambdas.len()).map(|k| percent(count(k), left.len())).collect();
            left.retain(|row| !row[best]);
            let accumulated = percent(self.solved.len() - left.len(), self.solved.len());
            sequence.push(Chosen { lambda: self.lambdas[best], rate: rates[best], rates, accumulated });
        }
        sequence
    }
}
