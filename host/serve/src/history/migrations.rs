//! Versions of the database, each a step from the one before. A step that was released is never changed.

use std::path::Path;

use rusqlite::{Connection, TransactionBehavior};

use super::HistoryError;

/// Version 1: runs of tables with their events, and tables.
const RUNS: &str = "
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
";

/// Version 2: models with their lineage, and diagnoses.
const DIAGNOSES: &str = "
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
";

/// Version 3: uploads.
const UPLOADS: &str = "
CREATE TABLE upload (
    id INTEGER PRIMARY KEY,
    at_ms INTEGER NOT NULL,
    arm_table TEXT NOT NULL,
    board TEXT NOT NULL,
    device TEXT NOT NULL
) STRICT;
CREATE INDEX upload_by_time ON upload (at_ms);
";

/// The steps: step k leads from version k to version k + 1.
pub const STEPS: [&str; 3] = [RUNS, DIAGNOSES, UPLOADS];

/// Number in the file that names its program: `darm` in ASCII.
const APPLICATION: i64 = 0x6461_726d;

/// Brings a database to the newest version, completely or not at all.
pub(super) fn migrate(connection: &mut Connection, path: &Path) -> Result<(), HistoryError> {
    let in_file = |source| HistoryError::Open { path: path.into(), source };
    // Of two servers that start together one waits.
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate).map_err(in_file)?;
    let number = |pragma: &str| transaction.pragma_query_value(None, pragma, |row| row.get::<_, i64>(0));
    let (version, application) = (number("user_version").map_err(in_file)?, number("application_id").map_err(in_file)?);
    let n_parts = transaction.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get::<_, i64>(0));
    let is_new = application == 0 && version == 0 && n_parts.map_err(in_file)? == 0;
    if application != APPLICATION && !is_new {
        return Err(HistoryError::Foreign { path: path.into() });
    }
    let known = STEPS.len() as i64;
    let steps = usize::try_from(version).ok().and_then(|version| STEPS.get(version..));
    let Some(steps) = steps else {
        return Err(HistoryError::Newer { path: path.into(), found: version, known });
    };
    if steps.is_empty() {
        return Ok(());
    }
    let apply = || {
        steps.iter().try_for_each(|step| transaction.execute_batch(step))?;
        transaction.pragma_update(None, "application_id", APPLICATION)?;
        transaction.pragma_update(None, "user_version", known)
    };
    apply().map_err(in_file)?;
    transaction.commit().map_err(in_file)
}

#[cfg(test)]
mod tests {
    use rusqlite::Connection;

    use super::{APPLICATION, STEPS};
    use crate::history::{History, HistoryError, Kind};

    /// Entries that a program of each version could have written.
    const ENTRIES: [&str; 3] = [
        "INSERT INTO arm_table VALUES ('t1', 'a.darm', 'm1', 3, 1.5, 10, x'00ff');
         INSERT INTO run VALUES (7, 1000, 2000, 'finished', NULL, 3, 't1', 'm1', NULL, 'pico', 'd', 2, 40, 123);
         INSERT INTO run_event VALUES (7, 41, 0.5, 'row', 'row 0');",
        "INSERT INTO model VALUES ('m2', 'arm-2.toml', 2, 'm1', 30, 'text');
         INSERT INTO diagnosis VALUES (5, 40, 'm1', 'run.csv', 'd', 'effect-found', 'A stroke.', 'm2', '{}');",
        "INSERT INTO upload VALUES (3, 50, 't1', 'pico', 'd');",
    ];

    /// A database as the program of that version has left it.
    fn of_version(path: &std::path::Path, version: usize) {
        let connection = Connection::open(path).unwrap();
        for (step, entries) in STEPS.iter().zip(ENTRIES).take(version) {
            connection.execute_batch(step).unwrap();
            connection.execute_batch(entries).unwrap();
        }
        if version > 0 {
            connection.pragma_update(None, "application_id", APPLICATION).unwrap();
            connection.pragma_update(None, "user_version", version as i64).unwrap();
        }
    }

    fn schema(history: &History) -> Vec<String> {
        let reader = history.reader().unwrap();
        let mut parts = reader.prepare("SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY name").unwrap();
        parts.query_map([], |row| row.get(0)).unwrap().collect::<Result<_, _>>().unwrap()
    }

    #[test]
    fn every_older_version_keeps_its_entries_and_becomes_the_newest() {
        let folder = tempfile::tempdir().unwrap();
        let fresh = History::open(&folder.path().join("fresh")).unwrap();
        for version in 0..=STEPS.len() {
            let path = folder.path().join(version.to_string());
            of_version(&path, version);
            let history = History::open(&path).unwrap();
            assert_eq!(schema(&history), schema(&fresh), "version {version}");
            let count = |kind| history.entries(kind, None).unwrap().len();
            let counts = [Kind::Runs, Kind::Tables, Kind::Models, Kind::Diagnoses, Kind::Uploads].map(count);
            let expected = [1, 1, 2, 2, 3].map(|since| usize::from(version >= since));
            assert_eq!(counts, expected, "version {version}");
            assert_eq!(history.events(7).unwrap().len(), expected[0]);
            drop(history);
            assert!(History::open(&path).is_ok(), "opened again");
        }
    }

    #[test]
    fn a_newer_version_and_other_files_are_refused_and_left_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("newer");
        drop(History::open(&path).unwrap());
        Connection::open(&path).unwrap().pragma_update(None, "user_version", 99).unwrap();
        assert!(matches!(History::open(&path), Err(HistoryError::Newer { found: 99, .. })));
        let path = folder.path().join("foreign");
        Connection::open(&path).unwrap().execute_batch("CREATE TABLE theirs (x)").unwrap();
        assert!(matches!(History::open(&path), Err(HistoryError::Foreign { .. })));
        let path = folder.path().join("text");
        std::fs::write(&path, "no database, but a long enough text to be taken for one".repeat(20)).unwrap();
        assert!(matches!(History::open(&path), Err(HistoryError::Open { .. })));
        assert!(std::fs::read_to_string(&path).unwrap().starts_with("no database"));
    }
}
