//! The tables of the database, and their version.

use std::path::Path;

use rusqlite::{Connection, TransactionBehavior};

use super::HistoryError;

/// Runs of tables with their events, tables, models with their lineage, diagnoses, uploads: version 3.
const SCHEMA: &str = "
CREATE TABLE arm_table (
    digest TEXT PRIMARY KEY,
    name TEXT NOT NULL,
    model TEXT NOT NULL,
    rows INTEGER NOT NULL,
    end_s REAL NOT NULL,
    seen_ms INTEGER NOT NULL,
    file BLOB NOT NULL
) STRICT;
CREATE TABLE run (
    id INTEGER PRIMARY KEY,
    started_ms INTEGER NOT NULL,
    ended_ms INTEGER,
    outcome TEXT NOT NULL,
    cause TEXT,
    rows INTEGER NOT NULL DEFAULT 0,
    arm_table TEXT,
    model TEXT,
    profile TEXT,
    board TEXT NOT NULL,
    device TEXT NOT NULL,
    boots INTEGER NOT NULL,
    first_event INTEGER NOT NULL,
    first_us INTEGER NOT NULL,
    UNIQUE (device, boots, first_event, first_us)
) STRICT;
CREATE INDEX run_by_time ON run (started_ms);
CREATE TABLE run_event (
    run INTEGER NOT NULL REFERENCES run,
    number INTEGER NOT NULL,
    at_s REAL NOT NULL,
    kind TEXT NOT NULL,
    text TEXT NOT NULL,
    PRIMARY KEY (run, number)
) STRICT, WITHOUT ROWID;
CREATE TABLE model (
    digest TEXT PRIMARY KEY,
    name TEXT NOT NULL,
    number INTEGER,
    parent TEXT,
    seen_ms INTEGER NOT NULL,
    file TEXT
) STRICT;
CREATE TABLE diagnosis (
    id INTEGER PRIMARY KEY,
    at_ms INTEGER NOT NULL,
    model TEXT NOT NULL,
    data_name TEXT NOT NULL,
    data_digest TEXT NOT NULL,
    verdict TEXT NOT NULL,
    summary TEXT NOT NULL,
    corrected TEXT,
    report TEXT NOT NULL
) STRICT;
CREATE INDEX diagnosis_by_time ON diagnosis (at_ms);
CREATE TABLE upload (
    id INTEGER PRIMARY KEY,
    at_ms INTEGER NOT NULL,
    arm_table TEXT NOT NULL,
    board TEXT NOT NULL,
    device TEXT NOT NULL
) STRICT;
CREATE INDEX upload_by_time ON upload (at_ms);
";

/// What follows it, a step for each version.
const STEPS: [&str; 1] = [
    // 4: names that people give, and what the page Diagnosis showed.
    "
ALTER TABLE run ADD COLUMN label TEXT;
ALTER TABLE diagnosis ADD COLUMN label TEXT;
ALTER TABLE diagnosis ADD COLUMN result TEXT;
ALTER TABLE model ADD COLUMN label TEXT;
ALTER TABLE arm_table ADD COLUMN label TEXT;
",
];

/// Version of the first tables; 1 and 2 were never released. A change gets another step.
const FIRST_VERSION: i64 = 3;
const VERSION: i64 = FIRST_VERSION + STEPS.len() as i64;

/// Number in the file that names its program: `darm` in ASCII.
const APPLICATION: i64 = 0x6461_726d;

/// Makes the tables of a new database, or brings those of an earlier version to this one, completely or not at all; refuses a database that is
/// not ours or of a later version.
pub(super) fn prepare(connection: &mut Connection, path: &Path) -> Result<(), HistoryError> {
    let in_file = |source| HistoryError::Open { path: path.into(), source };
    // Of two servers that start together one waits.
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate).map_err(in_file)?;
    let number = |pragma: &str| transaction.pragma_query_value(None, pragma, |row| row.get::<_, i64>(0));
    let (version, application) = (number("user_version").map_err(in_file)?, number("application_id").map_err(in_file)?);
    let n_parts = transaction.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get::<_, i64>(0));
    let is_new = application == 0 && version == 0 && n_parts.map_err(in_file)? == 0;
    let known = match (application, version) {
        _ if is_new => FIRST_VERSION,
        (APPLICATION, VERSION) => return Ok(()),
        (APPLICATION, FIRST_VERSION..VERSION) => version,
        (APPLICATION, found) => return Err(HistoryError::Version { path: path.into(), found, known: VERSION }),
        _ => return Err(HistoryError::Foreign { path: path.into() }),
    };
    let apply = || {
        if is_new {
            transaction.execute_batch(SCHEMA)?;
            transaction.pragma_update(None, "application_id", APPLICATION)?;
        }
        let missing = STEPS.iter().skip((known - FIRST_VERSION) as usize);
        missing.into_iter().try_for_each(|step| transaction.execute_batch(step))?;
        transaction.pragma_update(None, "user_version", VERSION)
    };
    apply().map_err(in_file)?;
    transaction.commit().map_err(in_file)
}

#[cfg(test)]
mod tests {
    use rusqlite::Connection;

    use super::{APPLICATION, FIRST_VERSION, SCHEMA, VERSION};
    use crate::history::{History, HistoryError, Kind};

    #[test]
    fn a_file_of_the_first_version_keeps_its_entries_and_has_names_afterwards() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.sqlite3");
        let first = Connection::open(&path).unwrap();
        first.execute_batch(SCHEMA).unwrap();
        first.pragma_update(None, "application_id", APPLICATION).unwrap();
        first.pragma_update(None, "user_version", FIRST_VERSION).unwrap();
        let values = "VALUES (7, 5, 'm', 'run.csv', 'd', 'no-effect', 'nothing', NULL, '{}')";
        let columns = "id, at_ms, model, data_name, data_digest, verdict, summary, corrected, report";
        first.execute_batch(&format!("INSERT INTO diagnosis ({columns}) {values}")).unwrap();
        drop(first);
        // Once, and again.
        for _ in 0..2 {
            let history = History::open(&path).unwrap();
            let entries = history.entries(Kind::Diagnoses, None).unwrap();
            assert_eq!((entries.len(), entries[0]["data_name"].as_str()), (1, Some("run.csv")));
            assert_eq!((entries[0]["has_result"].as_i64(), history.result(7).unwrap()), (Some(0), None));
            assert!(history.set_label(Kind::Diagnoses, "7", Some("bench")).unwrap());
        }
        let version = Connection::open(&path).unwrap();
        let version = version.pragma_query_value(None, "user_version", |row| row.get::<_, i64>(0));
        assert_eq!(version.unwrap(), VERSION);
    }

    #[test]
    fn another_version_and_other_files_are_refused_and_left_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("other");
        drop(History::open(&path).unwrap());
        Connection::open(&path).unwrap().pragma_update(None, "user_version", 99).unwrap();
        assert!(matches!(History::open(&path), Err(HistoryError::Version { found: 99, .. })));
        let path = folder.path().join("foreign");
        Connection::open(&path).unwrap().execute_batch("CREATE TABLE theirs (x)").unwrap();
        assert!(matches!(History::open(&path), Err(HistoryError::Foreign { .. })));
        let path = folder.path().join("text");
        std::fs::write(&path, "no database, but a long enough text to be taken for one".repeat(20)).unwrap();
        assert!(matches!(History::open(&path), Err(HistoryError::Open { .. })));
        assert!(std::fs::read_to_string(&path).unwrap().starts_with("no database"));
    }
}
