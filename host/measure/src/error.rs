//! Why a file gives no measurements, or a selection no rows.

use std::io;
use std::path::PathBuf;

use darm_robot::csv_table::CsvError;
use darm_robot::source::unreadable;

use super::log::LogError;

/// Why a file gives no measurements.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be opened or read.
    #[error("{}: {}", path.display(), unreadable(error))]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },
    /// The text is no table, or a cell is not what its column holds.
    #[error(transparent)]
    Csv(#[from] CsvError),
    /// A log gives no table.
    #[error("{}: {error}", path.display())]
    Log {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: LogError,
    },
    /// The file is of a format of another program.
    #[error("{}: {fault}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is, and the command that converts it.
        fault: String,
    },
    /// No column holds a quantity that cannot be done without.
    #[error(
        "{}: no column {column}; the file has {present}; rename a column so that it carries this quantity and unit, or give it that \
         meaning with --column {column}=COLUMN",
        path.display()
    )]
    NoQuantity {
        /// The file.
        path: PathBuf,
        /// The quantity as the name of a column.
        column: String,
        /// The columns that there are.
        present: String,
    },
    /// A column that was named is missing.
    #[error("{}: no column {column}; the file has {present}; give the name of one of these", path.display())]
    NoColumn {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// The columns that there are.
        present: String,
    },
    /// A selection of rows makes no sense.
    #[error("{}: {error}", path.display())]
    Select {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: SelectError,
    },
    /// There is a header, or not even that, and no rows.
    #[error("{}: no rows, there is nothing to diagnose; record again", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// Why a text is no selection, or none for this table.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SelectError {
    /// It does not compare.
    #[error("character {character}: `{text}` compares nothing: write COLUMN = VALUE, or !=, <, <=, >, >=")]
    NoComparison {
        /// Where it begins, from 1.
        character: usize,
        /// What is there.
        text: String,
    },
    /// Brackets do not match.
    #[error("character {character} {what}")]
    Bracket {
        /// Where the bracket is, from 1.
        character: usize,
        /// What is wrong with it.
        what: &'static str,
    },
    /// There is no such column.
    #[error("no column {column}; the file has {present}")]
    NoColumn {
        /// The column.
        column: String,
        /// The columns that there are.
        present: String,
    },
    /// A cell that says neither yes nor no.
    #[error("line {line}: column {column} holds `{text}`, expected 0 or 1")]
    NoFlag {
        /// The column.
        column: String,
        /// Line of the file, the header being 1.
        line: usize,
        /// What is there.
        text: String,
    },
    /// Words have no order.
    #[error("character {character}: `{text}` is not a number, and only numbers compare by < and >")]
    NoNumber {
        /// Where the comparison begins, from 1.
        character: usize,
        /// What is there.
        text: String,
    },
}
