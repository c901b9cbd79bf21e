//! Entries as JSON and CSV.

use rusqlite::types::ValueRef;
use rusqlite::{OptionalExtension as _, Params, Row, params};
use serde::Deserialize;
use serde_json::{Map, Value};

use darm_measure::csv_text::csv_text;

use super::{History, HistoryError};

/// A kind of entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Tables that a board ran.
    Runs,
    /// Diagnoses of files.
    Diagnoses,
    /// Models.
    Models,
    /// Tables that were brought to a board.
    Tables,
    /// When they were brought there.
    Uploads,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Runs, Self::Diagnoses, Self::Models, Self::Tables, Self::Uploads];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Runs => "runs",
            Self::Diagnoses => "diagnoses",
            Self::Models => "models",
            Self::Tables => "tables",
            Self::Uploads => "uploads",
        }
    }

    /// What is asked, newest first.
    const fn query(self) -> &'static str {
        match self {
            Self::Runs => {
                "SELECT id, label, started_ms, ended_ms, outcome, cause, rows, arm_table AS \"table\", model, profile, board, device, boots
                 FROM run ORDER BY started_ms DESC, id DESC"
            }
            Self::Diagnoses => {
                "SELECT id, label, at_ms, model, data_name, data_digest, verdict, summary, corrected, result IS NOT NULL AS has_result
                 FROM diagnosis ORDER BY at_ms DESC, id DESC"
            }
            Self::Models => {
                "SELECT digest, label, name, number, parent, seen_ms, file IS NOT NULL AS has_file
                 FROM model ORDER BY seen_ms DESC, digest"
            }
            Self::Tables => {
                "SELECT digest, label, name, model, rows, end_s, seen_ms FROM arm_table ORDER BY seen_ms DESC, digest"
            }
            Self::Uploads => {
                "SELECT upload.id, at_ms, arm_table AS \"table\", label, name, model, board, device
                 FROM upload LEFT JOIN arm_table ON arm_table = digest ORDER BY at_ms DESC, upload.id DESC"
            }
        }
    }
}

/// A program that a board played, by what a recording says of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Played<'a> {
    /// Number of the device.
    pub device: &'a str,
    /// How often it had started.
    pub boots: u32,
    /// Digest of its table.
    pub table: &'a str,
    /// From when, s of the board's clock.
    pub from_s: f64,
    /// To when.
    pub to_s: f64,
}

impl History {
    /// What happened in the runs of this program, in order of time; where there are more than `max_events`, rows are left out first.
    ///
    /// # Errors
    ///
    /// The database cannot be read.
    pub(crate) fn events_of(&self, played: &Played<'_>, max_events: u32) -> Result<Vec<Value>, HistoryError> {
        let Played { device, boots, table, from_s, to_s } = *played;
        self.rows(
            "SELECT * FROM (
                 SELECT number, at_s, kind, text FROM run_event JOIN run ON run = id
                 WHERE device = ?1 AND boots = ?2 AND coalesce(arm_table, ?3) = ?3 AND first_us <= 1e6 * ?5
                     AND (SELECT max(at_s) FROM run_event WHERE run = id) >= ?4
                 ORDER BY kind = 'row', at_s LIMIT ?6)
             ORDER BY at_s, number",
            params![device, boots, table, from_s, to_s, max_events],
        )
    }

    /// The newest entries of a kind, at most this many.
    ///
    /// # Errors
    ///
    /// The database cannot be read.
    pub fn entries(&self, kind: Kind, max_entries: Option<u32>) -> Result<Vec<Value>, HistoryError> {
        let limit = max_entries.map_or(-1, i64::from);
        self.rows(&format!("{} LIMIT ?1", kind.query()), params![limit])
    }

    /// What happened in a run.
    ///
    /// # Errors
    ///
    /// The database cannot be read.
    pub fn events(&self, run: i64) -> Result<Vec<Value>, HistoryError> {
        self.rows("SELECT number, at_s, kind, text FROM run_event WHERE run = ?1 ORDER BY number", params![run])
    }

    /// Number of the last event of a board that is recorded, since it started.
    ///
    /// # Errors
    ///
    /// The database cannot be read.
    pub fn last_event(&self, device: &str, boots: u32) -> Result<Option<u32>, HistoryError> {
        self.part(
            "SELECT number FROM run_event JOIN run ON run = id WHERE device = ?1 AND boots = ?2
             ORDER BY run DESC, number DESC LIMIT 1",
            params![device, boots],
        )
    }

    /// The numbers of a diagnosis, as JSON.
    ///
    /// # Errors
    ///
    /// The database cannot be read.
    pub fn report(&self, diagnosis: i64) -> Result<Option<String>, HistoryError> {
        self.part("SELECT report FROM diagnosis WHERE id = ?1", params![diagnosis])
    }

    /// What the page showed of a diagnosis, as JSON; `None` of one that was too large, or that an earlier version has kept.
    ///
    /// # Errors
    ///
    /// The database cannot be read.
    pub fn result(&self, diagnosis: i64) -> Result<Option<String>, HistoryError> {
        self.part("SELECT result FROM diagnosis WHERE id = ?1 AND result IS NOT NULL", params![diagnosis])
    }

    /// When the diagnosis was made that a model was corrected after, the name of its measurements, and its numbers as JSON.
    ///
    /// # Errors
    ///
    /// The database cannot be read.
    pub fn correction(&self, model: &str) -> Result<Option<(i64, String, String)>, HistoryError> {
        let query = "SELECT at_ms, data_name, report FROM diagnosis WHERE corrected = ?1 ORDER BY at_ms DESC LIMIT 1";
        let read = |row: &Row<'_>| Ok((row.get(0)?, row.get(1)?, row.get(2)?));
        Ok(self.reader()?.query_row(query, params![model], read).optional()?)
    }

    /// The file of a model.
    ///
    /// # Errors
    ///
    /// The database cannot be read.
    pub fn model_file(&self, digest: &str) -> Result<Option<String>, HistoryError> {
        self.part("SELECT file FROM model WHERE digest = ?1 AND file IS NOT NULL", params![digest])
    }

    /// The name of a model.
    ///
    /// # Errors
    ///
    /// The database cannot be read.
    pub fn model_name(&self, digest: &str) -> Result<Option<String>, HistoryError> {
        self.part("SELECT name FROM model WHERE digest = ?1", params![digest])
    }

    /// The file of a table.
    ///
    /// # Errors
    ///
    /// The database cannot be read.
    pub fn table_file(&self, digest: &str) -> Result<Option<Vec<u8>>, HistoryError> {
        self.part("SELECT file FROM arm_table WHERE digest = ?1", params![digest])
    }

    /// All entries with the events of each run and the numbers of each diagnosis; the files of models and tables are not in it.
    ///
    /// # Errors
    ///
    /// The database cannot be read.
    pub fn export(&self) -> Result<Value, HistoryError> {
        let mut all = Map::new();
        for kind in Kind::ALL {
            all.insert(kind.name().into(), self.entries(kind, None)?.into());
        }
        for run in all.get_mut("runs").and_then(Value::as_array_mut).into_iter().flatten() {
            let events = self.events(run["id"].as_i64().unwrap_or(0))?;
            run["events"] = events.into();
        }
        for diagnosis in all.get_mut("diagnoses").and_then(Value::as_array_mut).into_iter().flatten() {
            let report = self.report(diagnosis["id"].as_i64().unwrap_or(0))?;
            diagnosis["report"] = report.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or(Value::Null);
        }
        Ok(all.into())
    }

    /// The entries of a kind as comma-separated values, units at the end of the names.
    ///
    /// # Errors
    ///
    /// The database cannot be read.
    pub fn csv(&self, kind: Kind) -> Result<String, HistoryError> {
        let reader = self.reader()?;
        let mut statement = reader.prepare(kind.query())?;
        let names: Vec<String> = statement.column_names().map(str::to_owned).collect();
        let n_columns = names.len();
        let cells = |row: &Row<'_>| (0..n_columns).map(|column| Ok(cell(row.get_ref(column)?))).collect();
        let rows: Vec<Vec<String>> = statement.query_map([], cells)?.collect::<Result<_, _>>()?;
        Ok(csv_text(std::iter::once(names).chain(rows)))
    }

    fn rows(&self, query: &str, params: impl Params) -> Result<Vec<Value>, HistoryError> {
        let reader = self.reader()?;
        let mut statement = reader.prepare(query)?;
        let names: Vec<String> = statement.column_names().map(str::to_owned).collect();
        let entry = |row: &Row<'_>| {
            let value = |(column, name): (usize, &String)| Ok((name.clone(), json(row.get_ref(column)?)));
            names.iter().enumerate().map(value).collect::<rusqlite::Result<Map<_, _>>>().map(Value::from)
        };
        Ok(statement.query_map(params, entry)?.collect::<Result<_, _>>()?)
    }

    fn part<T: rusqlite::types::FromSql>(&self, query: &str, params: impl Params) -> Result<Option<T>, HistoryError> {
        Ok(self.reader()?.query_row(query, params, |row| row.get(0)).optional()?)
    }
}

fn json(value: ValueRef<'_>) -> Value {
    match value {
        ValueRef::Null | ValueRef::Blob(_) => Value::Null,
        ValueRef::Integer(number) => number.into(),
        ValueRef::Real(number) => number.into(),
        ValueRef::Text(text) => String::from_utf8_lossy(text).into(),
    }
}

/// A text that a spreadsheet would take for a formula begins with a quote.
fn cell(value: ValueRef<'_>) -> String {
    match json(value) {
        Value::Null => String::new(),
        Value::String(text) if text.starts_with(['=', '+', '-', '@']) => format!("'{text}"),
        Value::String(text) => text,
        number => number.to_string(),
    }
}
