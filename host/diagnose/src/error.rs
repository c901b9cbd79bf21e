//! Why there is no diagnosis.

use std::error::Error;
use std::iter;

use darm_core::chain::ChainError;

use crate::effect::LawName;
use crate::prepare::groups::FOLDS;
use crate::prepare::signals::PrepareError;
use crate::progress::Cancelled;
use darm_measure::{Finding, ReadError};

/// Training words without which nothing can be said: two in each part that is left out in turn.
pub const MIN_WORDS: usize = 2 * FOLDS;
/// Training rows of signals without which nothing can be said: two in each part that is left out in turn.
pub const MIN_ROWS: usize = 2 * FOLDS;
/// Pieces of training rows without which nothing can be said.
pub const MIN_PIECES: usize = 16;

/// A value of an effect in a model's file that its law does not have.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{law} at {place} has no value {name:?}, only {known}: correct the name in the model's file")]
pub struct UnknownValue {
    /// The law.
    pub law: LawName,
    /// Where it acts.
    pub place: String,
    /// The name in the file.
    pub name: String,
    /// The names that it has.
    pub known: String,
}

/// Why there is no diagnosis.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// A row does not fit the arm.
    #[error("{}", .0.text)]
    Row(Finding),
    /// The model has no pose for a row.
    #[error("the model has no pose for this row: {error}; leave the row out, or correct the model")]
    NoPose {
        /// Line of the file, the header being 1.
        line: usize,
        /// Why.
        error: ChainError,
    },
    /// Nothing is left to fit when the only group is left out.
    #[error(
        "cross-validation needs at least 2 groups, and all rows are in one ({selection}): choose a column with several values"
    )]
    OneGroup {
        /// How the groups were chosen.
        selection: String,
    },
    /// Too few words to hold any of them out.
    #[error(
        "{words} words are not enough to distinguish an effect from chance: measure at least {MIN_WORDS} that are not held out"
    )]
    TooFewWords {
        /// Words that a fit may see.
        words: usize,
    },
    /// Too few rows, or pieces of rows.
    #[error(
        "{rows} rows in {pieces} pieces are not enough to distinguish an effect from chance: measure at least {MIN_ROWS} rows in {MIN_PIECES} pieces that are not held out"
    )]
    TooFewRows {
        /// Rows that a fit may see.
        rows: usize,
        /// Pieces that they make.
        pieces: usize,
    },
    /// The table is not fit.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// A column is missing.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A law that is not among those of this kind of measurement.
    #[error("no law {law} here; there are {known}")]
    UnknownLaw {
        /// The law.
        law: String,
        /// Those that there are.
        known: String,
    },
    /// A place where a law does not act, or that does not exist.
    #[error("no {law} at {place} here; it is tried at {known}")]
    UnknownPlace {
        /// The law.
        law: String,
        /// The place.
        place: String,
        /// Where it is tried.
        known: String,
    },
    /// A rejected effect that the model has.
    #[error("the model has {law} at {place}, which is rejected: remove it from the model's file first")]
    RejectedIsKnown {
        /// The law.
        law: LawName,
        /// The place.
        place: String,
    },
    /// An effect of the model that these rows have no place for.
    #[error("the model has {law} at {place}, and this measurement has no such place: is this the right model?")]
    NoSuchPlace {
        /// The law.
        law: LawName,
        /// The place.
        place: String,
    },
    /// A value that a law of the model does not have.
    #[error(transparent)]
    UnknownValue(#[from] UnknownValue),
    /// Whoever waited for it has given it up.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The model predicts NaN or infinity.
    #[error("the model predicts NaN or infinity; check that this is the right model, and the units of the columns")]
    NotANumber {
        /// Line of the file.
        line: usize,
    },
}

impl DiagnoseError {
    /// Line of the file, where the error is in one row.
    pub fn line(&self) -> Option<usize> {
        match self {
            Self::Row(finding) => finding.line,
            Self::NoPose { line, .. } | Self::NotANumber { line } => Some(*line),
            Self::Prepare(PrepareError::Row { line, .. }) => Some(*line),
            _ => None,
        }
    }
}

/// An error with its causes as one sentence without a full stop: what failed, where, what to do.
pub fn sentence(error: &(dyn Error + 'static)) -> String {
    let mut sentence = String::new();
    for part in iter::successors(Some(error), |&error| error.source()).map(ToString::to_string) {
        // Some errors contain the text of their source, or begin with the file that the context names.
        if part.starts_with(&sentence) {
            sentence.clear();
        }
        if !sentence.contains(&part) {
            sentence.push_str(if sentence.is_empty() { "" } else { ": " });
            sentence.push_str(part.trim_end_matches('.'));
        }
    }
    sentence
}
