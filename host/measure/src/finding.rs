//! What the owner of measurements or of a model should know before trusting a result.

use std::fmt;

use serde::Serialize;

/// Something about a file of measurements or a model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Whether a diagnosis is possible all the same.
    pub severity: Severity,
    /// Line of the file, the header being 1; `None` of the complete file.
    pub line: Option<usize>,
    /// Name of the column; `None` of the complete row.
    pub column: Option<String>,
    /// What it is.
    pub kind: FindingKind,
    /// The same as a sentence, without the line.
    pub text: String,
}

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// Worth knowing.
    Note,
    /// The row does not fit the arm: there is no diagnosis with it.
    Error,
}

/// What a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FindingKind {
    /// Word, states or servo positions do not fit the arm.
    RowDoesNotFitArm,
    /// A row is the same as the one before.
    RepeatedRow,
    /// Time does not advance.
    TimeRunsBack,
    /// A cell is not a number.
    NotANumber,
    /// Rows are left out in which a position is far off the rows before and after.
    FarOffNeighbours,
    /// Rows are left out in which a sensor is at the end of its range.
    Saturated,
    /// Rows are left out because a cell that is needed is empty.
    MissingValue,
    /// Numbers look like another unit than the one they are read in.
    SuspectedUnit,
    /// A column never changes.
    ConstantColumn,
    /// A condition is not read: the unit of its column is missing or of another quantity.
    UnreadCondition,
    /// Columns are not read.
    UnreadColumns,
    /// The log has joints that the model has not.
    MissingJoints,
    /// A joint turns without end, and its position was logged within a turn.
    UnwrappedTurns,
    /// Only one row in several is used.
    Decimated,
    /// The choice of held-out rows chooses none.
    NothingHeldOut,
    /// The file ends in the middle of a row.
    TruncatedFile,
    /// The measurement was made with another model.
    OtherModel,
    /// The model has no length scale or no masses.
    IncompleteModel,
    /// The board's clock did not keep time.
    UnevenClock,
    /// Rows were lost, or time stamps are not those of an even clock.
    UnevenSampling,
    /// The noise of the residuals and the fit that it weighs do not settle.
    NoConvergence,
}

impl Finding {
    /// Worth knowing, of the complete file.
    pub fn note(kind: FindingKind, text: impl Into<String>) -> Self {
        Self { severity: Severity::Note, line: None, column: None, kind, text: text.into() }
    }

    /// A reason for which there is no diagnosis.
    pub fn error(kind: FindingKind, text: impl Into<String>) -> Self {
        Self { severity: Severity::Error, ..Self::note(kind, text) }
    }

    /// The same about a line of the file, the header being 1.
    pub fn at_line(self, line: usize) -> Self {
        Self { line: Some(line), ..self }
    }

    /// The same about a column.
    pub fn in_column(self, name: &str) -> Self {
        Self { column: Some(name.into()), ..self }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "line {line}: {}", self.text),
            None => f.write_str(&self.text),
        }
    }
}
