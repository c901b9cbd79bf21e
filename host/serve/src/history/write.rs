//! New entries. Each call is one transaction.

use rusqlite::{Connection, OptionalExtension as _, Transaction, params};

use super::read::Kind;
use super::{History, HistoryError};
use crate::view::EventView;

/// Largest file of a model that is kept, bytes.
const MAX_MODEL: usize = 1 << 20;
/// Largest result of a diagnosis that is kept, bytes: its plots take most of it, 0.8 MB with 372 rows.
const MAX_RESULT: usize = 4 << 20;

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
    /// Nothing runs at the first look: the end of what ran before is in the events, or was not seen.
    pub is_idle: bool,
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
    /// What the page shows of it, as JSON; `None` where that cannot be written.
    pub result: Option<&'a str>,
}

impl History {
    /// Records what happened on a board: runs that began, their rows and how they ended. What is known already is not
    /// recorded again.
    ///
    /// # Errors
    ///
    /// The database cannot be written; the same events may be given again.
    pub fn see(&self, seen: &Seen<'_>) -> Result<(), HistoryError> {
        let written = insert_seen(&mut self.writer(), seen);
        self.noted(written)
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

    /// Records a model. A known one gets a parent that it did not have, and this name.
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

    /// Gives an entry a name, by its `id` or `digest`, or takes it away; whether there is such an entry.
    ///
    /// # Errors
    ///
    /// The database cannot be written.
    pub fn set_label(&self, kind: Kind, entry: &str, label: Option<&str>) -> Result<bool, HistoryError> {
        let update = match kind {
            Kind::Runs => "UPDATE run SET label = ?2 WHERE id = ?1",
            Kind::Diagnoses => "UPDATE diagnosis SET label = ?2 WHERE id = ?1",
            Kind::Models => "UPDATE model SET label = ?2 WHERE digest = ?1",
            Kind::Tables => "UPDATE arm_table SET label = ?2 WHERE digest = ?1",
            // It has that of its table.
            Kind::Uploads => return Ok(false),
        };
        let written = self.writer().execute(update, params![entry, label]);
        self.noted(written).map(|n_entries| n_entries > 0)
    }
}

/// What happened on a board.
fn insert_seen(writer: &mut Connection, seen: &Seen<'_>) -> rusqlite::Result<()> {
    let transaction = writer.transaction()?;
    forget_other_boots(&transaction, seen)?;
    seen.events.iter().try_for_each(|event| seen.record(&transaction, event))?;
    if seen.is_idle {
        end_unseen(&transaction, seen)?;
    }
    transaction.commit()
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
        "INSERT INTO diagnosis (at_ms, model, data_name, data_digest, verdict, summary, corrected, report, result)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)",
        params![
            now_ms,
            entry.model.digest,
            entry.data_name,
            entry.data_digest,
            entry.verdict,
            entry.summary,
            entry.corrected.map(|model| model.digest),
            entry.report,
            entry.result.filter(|result| result.len() <= MAX_RESULT)
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

/// What ran at the last look has ended since, and the board does not say how.
fn end_unseen(transaction: &Transaction<'_>, seen: &Seen<'_>) -> rusqlite::Result<()> {
    transaction.execute(
        "UPDATE run SET outcome = 'unknown', cause = 'the server did not see its end'
         WHERE device = ?1 AND outcome = 'running'",
        params![seen.device],
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
mod tests;
