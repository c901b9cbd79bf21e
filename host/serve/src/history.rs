//! What the server has seen, in an embedded database: runs of tables, diagnoses, models with their lineage, tables.
//!
//! | request                       | does                                                                        |
//! |-------------------------------|-----------------------------------------------------------------------------|
//! | `GET /api/history`            | the newest entries of every kind; `null` where the server keeps no history    |
//! | `GET /api/history/events`     | what happened in the run `?id=`                                              |
//! | `GET /api/history/diagnosis`  | the numbers of the diagnosis `?id=`                                          |
//! | `GET /api/history/result`     | what the page showed of the diagnosis `?id=`                                 |
//! | `GET /api/history/numbers`    | effects and errors of the diagnosis or model `?entry=` of the kind `?of=`     |
//! | `POST /api/history/name`      | gives an entry a name, or takes it away                                      |
//! | `GET /api/history/model`      | the file of the model `?digest=`                                             |
//! | `GET /api/history/table`      | the file of the table `?digest=`                                             |
//! | `GET /api/history/export`     | all entries as JSON, or those of one kind as CSV by `?of=runs`, `diagnoses`, … |
//!
//! Nothing here changes an entry but its name. A run is identified by the board, how often it has started, and number and time of the run's first
//! event, so that it is not recorded twice where a server reads the board's events again. An entry is committed before a
//! page can see it: what a page has shown is there after a crash. The end of a run that came while no server ran is read from
//! the board's events later, as far as the board has kept them.

mod comparison;
mod read;
mod requests;
mod schema;
mod write;

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use rusqlite::{Connection, OpenFlags};

pub use read::Kind;
pub(crate) use read::Played;
pub(crate) use requests::router;
pub use write::{DiagnosisEntry, ModelEntry, Seen, TableEntry};

/// Another server may write to the same file: this long it is waited for.
const BUSY: Duration = Duration::from_millis(500);

/// The database.
pub struct History {
    path: PathBuf,
    writer: Mutex<Connection>,
    /// Why the last entry could not be written.
    problem: Mutex<Option<String>>,
}

/// Why a history cannot be opened, read or written.
#[derive(Debug, thiserror::Error)]
pub enum HistoryError {
    /// The folder cannot be made.
    #[error("{path}: the folder cannot be made: {source}; choose another file with --history, or --history none")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The file is not a database, or cannot be read or written.
    #[error("{path}: {source}; choose another file with --history, or --history none")]
    Open {
        /// The file.
        path: PathBuf,
        /// What SQLite said.
        source: rusqlite::Error,
    },
    /// Another version of the program has written it.
    #[error(
        "{path}: version {found} of the history, this program reads {known}; use the other `darm`, or another --history"
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: i64,
        /// That of this program.
        known: i64,
    },
    /// A database that is no history.
    #[error("{path}: a database of another program; choose another file with --history")]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// An entry cannot be read or written.
    #[error("the history: {0}")]
    Sql(#[from] rusqlite::Error),
}

impl History {
    /// Opens the file, and makes it where it is missing.
    ///
    /// # Errors
    ///
    /// The file cannot be read or written, is no history, or another version of the program has written it.
    pub fn open(path: &Path) -> Result<Self, HistoryError> {
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            let unwritable = |source| HistoryError::Folder { path: folder.into(), source };
            std::fs::create_dir_all(folder).map_err(unwritable)?;
        }
        let in_file = |source| HistoryError::Open { path: path.into(), source };
        let mut connection = Connection::open(path).map_err(in_file)?;
        prepare(&connection).map_err(in_file)?;
        schema::prepare(&mut connection, path)?;
        Ok(Self { path: path.into(), writer: Mutex::new(connection), problem: Mutex::new(None) })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Why the last entry could not be written; `None` where it was.
    pub fn problem(&self) -> Option<String> {
        self.problem.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// A connection that changes nothing: who reads much does not hold up who writes.
    fn reader(&self) -> Result<Connection, HistoryError> {
        let connection = Connection::open_with_flags(&self.path, OpenFlags::SQLITE_OPEN_READ_ONLY)?;
        connection.busy_timeout(BUSY)?;
        Ok(connection)
    }

    fn writer(&self) -> MutexGuard<'_, Connection> {
        self.writer.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes whether an entry could be written.
    fn noted<T>(&self, written: Result<T, rusqlite::Error>) -> Result<T, HistoryError> {
        let written = written.map_err(HistoryError::from);
        let problem = written.as_ref().err().map(ToString::to_string);
        *self.problem.lock().unwrap_or_else(PoisonError::into_inner) = problem;
        written
    }
}

/// A commit is on the disk before it returns, and readers do not wait for a writer.
fn prepare(connection: &Connection) -> rusqlite::Result<()> {
    connection.busy_timeout(BUSY)?;
    connection.pragma_update(None, "journal_mode", "wal")?;
    connection.pragma_update(None, "synchronous", "full")?;
    connection.pragma_update(None, "foreign_keys", true)
}
