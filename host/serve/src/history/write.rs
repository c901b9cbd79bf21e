//! New entries. Each call is one transaction.

use rusqlite::{Connection, OptionalExtension as _, Transaction, params};

use super::{History, HistoryError};
use crate::view::EventView;

/// Largest file of a model that is kept, bytes.
const MAX_MODEL: usize = 1 << 20;

/// What the server has seen of a board.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// Kind of the board.
    pub board: &'a str,
    /// Number of the device.
    pub device: &'a str,
    /// How often it has started.
    pub boots: u32,
    /// Digest of its table.
    pub table: Option<&'a str>,
    /// The first event that is certain to be of that table: the board may have had another one before.
    pub table_from: u32,
    /// Hash of the model that the table was made for.
    pub model: Option<&'a str>,
    /// Digest of its profile.
    pub profile: Option<&'a str>,
    /// Time of the board's clock now, s.
    pub board_now_s: f64,
    /// Time of this computer now, ms since 1970.
    pub now_ms: i64,
    /// New events, in order; some may be known.
    pub events: &'a [EventView],
}

/// A table.
#[derive(Clone, Copy, Debug)]
pub struct TableEntry<'a> {
    /// Its digest, as boards report it.
    pub digest: &'a str,
    /// Name of its file.
    pub name: &'a str,
    /// Hash of the model that it was made for.
    pub model: &'a str,
    /// Number of rows.
    pub rows: usize,
    /// End of the program, s.
    pub end_s: f64,
    /// Its file.
    pub file: &'a [u8],
    /// Kind of the board that has taken it.
    pub board: &'a str,
    /// Number of the device.
    pub device: &'a str,
}

/// A model.
#[derive(Clone, Copy, Debug)]
pub struct ModelEntry<'a> {
    /// Hash of an arm, as boards report it; SHA-256 of the file of another model.
    pub digest: &'a str,
    /// Name of its file.
    pub name: &'a str,
    /// Number of the model.
    pub number: Option<u32>,
    /// Digest of the model that it was corrected from.
    pub parent: Option<&'a str>,
    /// Its file.
    pub file: &'a str,
}

/// A diagnosis.
#[derive(Clone, Copy, Debug)]
pub struct DiagnosisEntry<'a> {
    /// What was diagnosed.
    pub model: ModelEntry<'a>,
    /// The corrected model.
    pub corrected: Option<ModelEntry<'a>>,
    /// Name of the file of measurements.
    pub data_name: &'a str,
    /// Its SHA-256.
    pub data_digest: &'a str,
    /// The verdict in a word.
    pub verdict: &'a str,
    /// The verdict in a sentence.
    pub summary: &'a str,
    /// The numbers, as JSON.
    pub report: &'a str,
}

impl History {
    /// Records what happened on a board: runs that began, their rows and how they ended. What is known already is not
    /// recorded again.
    ///
    /// # Errors
    ///
    /// The database cannot be written; the same events may be given again.
    pub fn see(&self, seen: &Seen<'_>) -> Result<(), HistoryError> {
        let mut writer = self.writer();
        let write = |writer: &mut Connection| {
            let transaction = writer.transaction()?;
            forget_other_boots(&transaction, seen)?;
            seen.events.iter().try_for_each(|event| seen.record(&transaction, event))?;
            transaction.commit()
        };
        self.noted(write(&mut writer))
    }

    /// Records a table that was brought to a board, and that it was.
    ///
    /// # Errors
    ///
    /// The database cannot be written.
    pub fn add_table(&self, table: &TableEntry<'_>, now_ms: i64) -> Result<(), HistoryError> {
        let written = insert_table(&mut self.writer(), table, now_ms);
        self.noted(written)
    }

    /// Records a model. A known one gets a parent that it did not have, and this name: earlier versions recorded that inside the file.
    ///
    /// # Errors
    ///
    /// The database cannot be written.
    pub fn add_model(&self, model: &ModelEntry<'_>, now_ms: i64) -> Result<(), HistoryError> {
        let writer = self.writer();
        let rename = "UPDATE model SET name = ?2 WHERE digest = ?1";
        let written = insert_model(&writer, model, now_ms)
            .and_then(|()| writer.execute(rename, params![model.digest, model.name]).map(drop));
        drop(writer);
        self.noted(written)
    }

    /// Records a diagnosis and its models.
    ///
    /// # Errors
    ///
    /// The database cannot be written.
    pub fn add_diagnosis(&self, entry: &DiagnosisEntry<'_>, now_ms: i64) -> Result<(), HistoryError> {
        let written = insert_diagnosis(&mut self.writer(), entry, now_ms);
        self.noted(written)
    }
}

/// A table, if it is new, and its upload.
fn insert_table(writer: &mut Connection, table: &TableEntry<'_>, now_ms: i64) -> rusqlite::Result<()> {
    let TableEntry { digest, name, model, rows, end_s, file, board, device } = *table;
    let transaction = writer.transaction()?;
    transaction.execute(
        "INSERT INTO arm_table (digest, name, model, rows, end_s, seen_ms, file) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)
         ON CONFLICT (digest) DO NOTHING",
        params![digest, name, model, rows as i64, end_s, now_ms, file],
    )?;
    transaction.execute(
        "INSERT INTO upload (at_ms, arm_table, board, device) VALUES (?1, ?2, ?3, ?4)",
        params![now_ms, digest, board, device],
    )?;
    transaction.commit()
}

/// A diagnosis and its models.
fn insert_diagnosis(writer: &mut Connection, entry: &DiagnosisEntry<'_>, now_ms: i64) -> rusqlite::Result<()> {
    let transaction = writer.transaction()?;
    insert_model(&transaction, &entry.model, now_ms)?;
    entry.corrected.iter().try_for_each(|model| insert_model(&transaction, model, now_ms))?;
    transaction.execute(
        "INSERT INTO diagnosis (at_ms, model, data_name, data_digest, verdict, summary, corrected, report)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
        params![
            now_ms,
            entry.model.digest,
            entry.data_name,
            entry.data_digest,
            entry.verdict,
            entry.summary,
            entry.corrected.map(|model| model.digest),
            entry.report
        ],
    )?;
    transaction.commit()
}

fn insert_model(connection: &Connection, model: &ModelEntry<'_>, now_ms: i64) -> rusqlite::Result<()> {
    let file = (model.file.len() <= MAX_MODEL).then_some(model.file);
    let parent = model.parent.filter(|parent| *parent != model.digest);
    connection.execute(
        "INSERT INTO model (digest, name, number, parent, seen_ms, file) VALUES (?1, ?2, ?3, ?4, ?5, ?6)
         ON CONFLICT (digest) DO UPDATE SET parent = coalesce(parent, excluded.parent)",
        params![model.digest, model.name, model.number, parent, now_ms, file],
    )?;
    Ok(())
}

/// How the runs ended that were under way when the board started again is not known.
fn forget_other_boots(transaction: &Transaction<'_>, seen: &Seen<'_>) -> rusqlite::Result<()> {
    transaction.execute(
        "UPDATE run SET outcome = 'unknown', cause = 'the board started again'
         WHERE device = ?1 AND boots <> ?2 AND outcome = 'running'",
        params![seen.device, seen.boots],
    )?;
    Ok(())
}

impl Seen<'_> {
    fn record(&self, transaction: &Transaction<'_>, event: &EventView) -> rusqlite::Result<()> {
        if event.kind == "started" {
            self.begin(transaction, event)?;
        }
        let Some(run) = self.run_of(transaction, event)? else { return Ok(()) };
        let is_new = transaction.execute(
            "INSERT INTO run_event (run, number, at_s, kind, text) VALUES (?1, ?2, ?3, ?4, ?5) ON CONFLICT DO NOTHING",
            params![run, event.number, event.at_s, event.kind, event.text],
        )?;
        match event.kind {
            "row" => {
                transaction.execute("UPDATE run SET rows = rows + ?2 WHERE id = ?1", params![run, is_new as i64])?
            }
            "finished" | "stopped" | "fault" => transaction.execute(
                "UPDATE run SET outcome = ?2, ended_ms = ?3, cause = ?4 WHERE id = ?1",
                params![run, event.kind, self.at_ms(event), (event.kind == "fault").then_some(&event.text)],
            )?,
            _ => 0,
        };
        Ok(())
    }

    /// A run begins, unless it is known. What ran before it has ended unseen.
    fn begin(&self, transaction: &Transaction<'_>, event: &EventView) -> rusqlite::Result<()> {
        let is_new = transaction.execute(
            "INSERT INTO run (started_ms, outcome, arm_table, model, profile, board, device, boots, first_event, first_us)
             VALUES (?1, 'running', ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9) ON CONFLICT DO NOTHING",
            params![
                self.at_ms(event),
                self.table.filter(|_| event.number >= self.table_from),
                self.model.filter(|_| event.number >= self.table_from),
                self.profile,
                self.board,
                self.device,
                self.boots,
                event.number,
                micros(event)
            ],
        )?;
        if is_new > 0 {
            transaction.execute(
                "UPDATE run SET outcome = 'unknown', cause = 'the server did not see its end'
                 WHERE device = ?1 AND outcome = 'running' AND id <> ?2 AND NOT (boots = ?3 AND first_us > ?4)",
                params![self.device, transaction.last_insert_rowid(), self.boots, micros(event)],
            )?;
        }
        Ok(())
    }

    /// The run that an event belongs to: the one under way.
    fn run_of(&self, transaction: &Transaction<'_>, event: &EventView) -> rusqlite::Result<Option<i64>> {
        let running = "SELECT id FROM run WHERE device = ?1 AND boots = ?2 AND outcome = 'running'
                       AND first_event <= ?3 AND first_us <= ?4 ORDER BY first_us DESC LIMIT 1";
        let at = params![self.device, self.boots, event.number, micros(event)];
        transaction.query_row(running, at, |row| row.get(0)).optional()
    }

    /// When it happened, ms since 1970.
    fn at_ms(&self, event: &EventView) -> i64 {
        self.now_ms - (1e3 * (self.board_now_s - event.at_s)).round() as i64
    }
}

/// Time of the board's clock, µs.
fn micros(event: &EventView) -> i64 {
    (1e6 * event.at_s).round() as i64
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::{DiagnosisEntry, ModelEntry, Seen};
    use crate::history::{History, Kind};
    use crate::view::EventView;

    fn event(number: u32, at_s: f64, kind: &'static str) -> EventView {
        EventView { number, at_s, kind, text: format!("{kind} {number}") }
    }

    fn see(history: &History, boots: u32, events: &[EventView]) {
        see_table_from(history, boots, 0, events);
    }

    fn see_table_from(history: &History, boots: u32, table_from: u32, events: &[EventView]) {
        let seen = Seen {
            board: "pico",
            device: "d",
            boots,
            table: Some("t"),
            table_from,
            model: None,
            profile: None,
            board_now_s: 10.0,
            now_ms: 1_000_000,
            events,
        };
        history.see(&seen).unwrap();
    }

    fn runs(history: &History) -> Vec<(String, i64, i64)> {
        let number = |entry: &Value, name: &str| entry[name].as_i64().unwrap_or(-1);
        let run = |entry: &Value| {
            (entry["outcome"].as_str().unwrap().to_owned(), number(entry, "rows"), number(entry, "ended_ms"))
        };
        history.entries(Kind::Runs, None).unwrap().iter().map(run).collect()
    }

    fn history() -> (tempfile::TempDir, History) {
        let folder = tempfile::tempdir().unwrap();
        let history = History::open(&folder.path().join("history.sqlite3")).unwrap();
        (folder, history)
    }

    #[test]
    fn a_run_is_recorded_once_however_often_its_events_are_read() {
        let (_folder, history) = history();
        let events = [event(3, 4.0, "started"), event(4, 4.5, "row"), event(5, 5.0, "row"), event(6, 6.0, "finished")];
        see(&history, 1, &events[..2]);
        assert_eq!(runs(&history), [("running".into(), 1, -1)]);
        for _ in 0..2 {
            see(&history, 1, &events);
            assert_eq!(runs(&history), [("finished".into(), 2, 996_000)]);
        }
        assert_eq!(history.events(1).unwrap().len(), 4);
        // A board without a memory counts from the beginning; the time differs.
        see(&history, 1, &[event(3, 4.000_001, "started"), event(4, 4.2, "stopped")]);
        assert_eq!(runs(&history).len(), 2);
    }

    #[test]
    fn a_run_from_before_the_table_was_seen_is_of_no_known_table() {
        let (_folder, history) = history();
        let events = [event(3, 4.0, "started"), event(4, 6.0, "finished"), event(5, 7.0, "started")];
        see_table_from(&history, 1, 5, &events);
        let runs = history.entries(Kind::Runs, None).unwrap();
        let tables: Vec<&Value> = runs.iter().map(|run| &run["table"]).collect();
        assert_eq!(tables, [&Value::from("t"), &Value::Null]);
    }

    #[test]
    fn the_end_of_a_run_that_nobody_saw_is_not_made_up() {
        let (_folder, history) = history();
        see(&history, 1, &[event(3, 4.0, "started"), event(4, 4.5, "row")]);
        see(&history, 1, &[event(20, 8.0, "started")]);
        see(&history, 2, &[event(0, 0.0, "booted")]);
        assert!(runs(&history).iter().all(|(outcome, ..)| outcome == "unknown"), "{:?}", runs(&history));
        // The end of an unknown run, or of none, belongs to no run.
        see(&history, 2, &[event(1, 1.0, "stopped"), event(2, 1.0, "finished")]);
        assert_eq!(runs(&history).len(), 2);
    }

    #[test]
    fn an_end_is_found_without_the_beginning_of_its_run() {
        let (_folder, history) = history();
        see(&history, 1, &[event(3, 4.0, "started")]);
        see(&history, 1, &[event(40, 8.0, "row"), event(41, 9.0, "fault")]);
        assert_eq!(runs(&history), [("fault".into(), 1, 999_000)]);
    }

    #[test]
    fn the_corrected_model_knows_its_parent() {
        let (_folder, history) = history();
        let model = |digest, parent| ModelEntry { digest, name: "arm.toml", number: Some(1), parent, file: "text" };
        // Seen before as the arm of the server: the parent is added.
        history.add_model(&model("b", None), 1).unwrap();
        let entry = DiagnosisEntry {
            model: model("a", None),
            corrected: Some(model("b", Some("a"))),
            data_name: "run.csv",
            data_digest: "d",
            verdict: "effect-found",
            summary: "A stroke.",
            report: "{}",
        };
        history.add_diagnosis(&entry, 2).unwrap();
        history.add_model(&model("b", Some("b")), 3).unwrap();
        let models = history.entries(Kind::Models, None).unwrap();
        let parent = |digest: &str| models.iter().find(|entry| entry["digest"] == digest).map(|entry| &entry["parent"]);
        assert_eq!((models.len(), parent("b")), (2, Some(&"a".into())));
        assert_eq!(history.entries(Kind::Diagnoses, None).unwrap()[0]["corrected"], "b");
    }
}
