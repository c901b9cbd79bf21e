//! Measurements as MCAP logs: what a CSV has in its rows a log has in messages of JSON, with a registered schema.
//!
//! A log that is written has one topic, [`TOPIC`], with one message a row, given at the row's time, whose keys are the
//! names of the columns; the schema ([`SCHEMA`], JSON Schema) names each column's type and unit. Comment lines before the
//! table become the metadata record `about`. Log times are those of the clock on the wall: the column of time is counted from
//! the first row, whose time is given by the key [`FIRST_ROW`]; without it the column itself is the log time.
//!
//! A log that is read may have several topics of JSON: messages with the same log time make one row. Keys within an object
//! and numbers within a list become columns, joined by `_` and numbered from 1 (`{"q": [1, 2]}` is `q1`, `q2`); a column
//! that two topics have carries the topic before its name. Without a column of time it is the log's. Topics in other
//! encodings are refused by name.

use std::collections::BTreeMap;
use std::iter;

use darm_robot::csv_table::csv_reader;
use darm_robot::files::Limits;
use serde_json::{Map, Value, json};

use super::column::meaning_of;
use super::csv_text::csv_text;
use super::mcap::{Log, McapError, Writer};
use super::unit::split_ours;

/// The topic of a log that is written.
pub const TOPIC: &str = "/measurement";
/// Name of its schema.
pub const SCHEMA: &str = "darm.Measurement";
/// Key of the metadata with the time of the first row, s since 1970.
pub const FIRST_ROW: &str = "first_row_unix_s";
/// Columns of digits, which are no numbers.
const DIGITS: [&str; 2] = ["word", "previous"];

/// Why a log gives no table, or a table no log.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// It is no MCAP, or a damaged one.
    #[error("no MCAP log that can be read: {0}")]
    Mcap(#[from] McapError),
    /// A topic that cannot be read.
    #[error(
        "topic {topic} holds messages in the encoding `{encoding}`, only `json` is read: convert the log with `darm import`"
    )]
    Encoding {
        /// The topic.
        topic: String,
        /// Its encoding.
        encoding: String,
    },
    /// A message that is no JSON object.
    #[error("message {number} of topic {topic} is no JSON object")]
    Message {
        /// The topic.
        topic: String,
        /// Number of the message in the log, from 1.
        number: usize,
    },
    /// It has more than is read into memory.
    #[error("{0}")]
    TooLarge(String),
    /// The text is no table.
    #[error("not a table of comma-separated values: {0}")]
    Table(#[from] csv::Error),
}

/// The table of a log, as comma-separated text.
///
/// # Errors
///
/// The bytes are not a complete MCAP log, a topic is not encoded as `json`, or a message is not a JSON object.
pub fn to_text(log: &[u8]) -> Result<Vec<u8>, LogError> {
    table(&Log::read(log)?, &Limits::COMMAND)
}

/// The table of a log that may end early, and whether it does.
///
/// # Errors
///
/// As [`to_text`], but for a log that is cut; one that is cut before its first message is an error.
pub fn to_text_of_complete_rows(log: &[u8]) -> Result<(Vec<u8>, bool), LogError> {
    text_within(log, &Limits::COMMAND).map(|(text, cut, _)| (text, cut))
}

/// The same within other limits, with what of the log is damaged and left out.
pub(super) fn text_within(log: &[u8], limits: &Limits) -> Result<(Vec<u8>, bool, Vec<String>), LogError> {
    match Log::read_within(log, limits)? {
        (log, _) if log.messages.is_empty() && !log.damaged.is_empty() => {
            Err(McapError::Lost(log.damaged.join(", ")).into())
        }
        (log, true) if log.messages.is_empty() => Err(McapError::Cut(0).into()),
        (log, cut) => Ok((table(&log, limits)?, cut, log.damaged)),
    }
}

fn table(log: &Log, limits: &Limits) -> Result<Vec<u8>, LogError> {
    let mut n_values = 0;
    let mut rows: BTreeMap<u64, Vec<(String, String, String)>> = BTreeMap::new();
    let mut columns: Vec<(String, String)> = Vec::new();
    let mut last = BTreeMap::new();
    for (number, message) in log.messages.iter().enumerate() {
        let channel = &log.channels[&message.channel];
        let topic = channel.topic.clone();
        if channel.encoding != "json" {
            return Err(LogError::Encoding { topic, encoding: channel.encoding.clone() });
        }
        let none = LogError::Message { topic: topic.clone(), number: number + 1 };
        // Before they are parsed: a value takes up to 100 times its text.
        let own = max_values(&message.data);
        n_values += own;
        // A key and its value are counted twice; columns are looked up one by one.
        if n_values > limits.cells || own > 4 * limits.columns {
            return Err(LogError::TooLarge(limits.too_many_cells()));
        }
        let Ok(Value::Object(object)) = serde_json::from_slice(&message.data) else { return Err(none) };
        // Several messages of one topic at one time are several rows.
        let time = last.get(&topic).map_or(message.log_time, |before: &u64| (before + 1).max(message.log_time));
        last.insert(topic.clone(), time);
        let row = rows.entry(time).or_default();
        for (key, cell) in cells(&object) {
            let column = (topic.clone(), key.clone());
            if !columns.contains(&column) {
                columns.push(column);
            }
            row.push((topic.clone(), key, cell));
        }
        // Cells that a row does not have are empty, and there.
        if !limits.has_room_for(rows.len(), columns.len()) {
            return Err(LogError::TooLarge(limits.too_many_cells()));
        }
    }
    let name = |(topic, key): &(String, String)| match columns.iter().filter(|(_, other)| other == key).count() {
        1 => key.clone(),
        _ => format!("{}/{key}", topic.trim_start_matches('/')),
    };
    // A stamp under another name may be a date; the time of the log is a number.
    let timed = columns.iter().any(|(_, key)| matches!(split_ours(key).0.as_str(), "time" | "t"));
    let own = (!timed && !rows.is_empty()).then(|| "time_s".to_string());
    let header: Vec<String> = own.into_iter().chain(columns.iter().map(name)).collect();
    let lines = rows.iter().map(|(time_ns, row)| -> Vec<String> {
        let own = (!timed).then(|| format!("{}.{:09}", time_ns / 1_000_000_000, time_ns % 1_000_000_000));
        let cell = |(topic, key): &(String, String)| {
            row.iter().find(|(t, k, _)| t == topic && k == key).map_or(String::new(), |(.., cell)| cell.clone())
        };
        own.into_iter().chain(columns.iter().map(cell)).collect()
    });
    Ok(csv_text(iter::once(header).chain(lines)).into_bytes())
}

/// At least as many values as a JSON text has, counted without parsing it.
pub fn max_values(json: &[u8]) -> usize {
    1 + json.iter().filter(|byte| matches!(byte, b',' | b'[' | b'{' | b':')).count()
}

/// The columns of an object and what is in them.
pub fn cells(object: &Map<String, Value>) -> Vec<(String, String)> {
    fn into(name: String, value: &Value, cells: &mut Vec<(String, String)>) {
        match value {
            Value::Object(object) => object.iter().for_each(|(key, value)| into(format!("{name}_{key}"), value, cells)),
            Value::Array(list) => {
                list.iter().enumerate().for_each(|(k, value)| into(format!("{name}{}", k + 1), value, cells));
            }
            Value::Null => cells.push((name, String::new())),
            Value::Bool(flag) => cells.push((name, u8::from(*flag).to_string())),
            Value::String(word) => cells.push((name, word.clone())),
            Value::Number(number) => cells.push((name, number.to_string())),
        }
    }
    let mut all = Vec::new();
    object.iter().for_each(|(key, value)| into(key.clone(), value, &mut all));
    all
}

/// A log of a table: comma-separated text, with comment lines before it.
///
/// # Errors
///
/// A row is longer or shorter than the header, or the text is not UTF-8.
pub fn from_text(text: &str) -> Result<Vec<u8>, LogError> {
    let mut table = csv_reader(text.as_bytes());
    let header = table.headers()?.clone();
    let mut log = Rows::new(&about(text.lines().map_while(|line| line.strip_prefix('#').map(|_| line))), header);
    for record in table.records() {
        log.push(&record?);
    }
    Ok(log.log.finish())
}

/// Keys and values of comment lines (`# key value`).
pub(super) fn about<'a>(lines: impl Iterator<Item = &'a str>) -> Vec<(String, String)> {
    let pairs = lines.filter_map(|line| line.strip_prefix("# ")?.split_once(' '));
    pairs.map(|(key, value)| (key.into(), value.into())).collect()
}

/// A log that is written row by row.
pub(super) struct Rows {
    header: csv::StringRecord,
    /// The container.
    pub(super) log: Writer,
    count: usize,
    /// Time of the first row since 1970, s.
    epoch_s: Option<f64>,
    /// The first row's column of time, s.
    first_s: Option<f64>,
}

impl Rows {
    /// A log of rows with these columns.
    pub(super) fn new(about: &[(String, String)], header: csv::StringRecord) -> Self {
        let log = Writer::new(about, TOPIC, (SCHEMA, &schema(&header).to_string()));
        let epoch = about.iter().find(|(key, _)| key == FIRST_ROW);
        let epoch_s = epoch.and_then(|(_, text)| text.parse().ok());
        Self { header, log, count: 0, epoch_s, first_s: None }
    }

    /// Adds a row as a message at its time.
    pub(super) fn push(&mut self, record: &csv::StringRecord) {
        let cells = || self.header.iter().zip(record);
        let object: Map<String, Value> = cells().map(|(name, cell)| (name.to_string(), value(name, cell))).collect();
        let time = cells().find(|(name, _)| meaning_of(&split_ours(name).0) == "time");
        let time_s = time.and_then(|(name, cell)| Some(seconds(name, cell.parse().ok()?)));
        let time_s = time_s.unwrap_or(self.count as f64);
        let first_s = *self.first_s.get_or_insert(time_s);
        let nanoseconds = |time_s: f64| (time_s * 1e9).round() as u64;
        // Apart, so that the sum of large and small keeps its nanoseconds.
        let time_ns = self
            .epoch_s
            .map_or(nanoseconds(time_s), |epoch_s| nanoseconds(epoch_s).saturating_add(nanoseconds(time_s - first_s)));
        self.log.message(time_ns, &Value::Object(object).to_string());
        self.count += 1;
    }
}

/// A time in the unit that the name of its column ends in, as seconds.
fn seconds(name: &str, time: f64) -> f64 {
    split_ours(name).1.map_or(time, |unit| unit.to_si(time))
}

fn schema(header: &csv::StringRecord) -> Value {
    let property = |name: &str| {
        let (quantity, unit) = split_ours(name);
        let kind = if DIGITS.contains(&name) { "string" } else { "number" };
        let what = unit.map_or(quantity.clone(), |unit| format!("{quantity}, read as {}", unit.si()));
        (name.to_string(), json!({ "type": [kind, "string", "null"], "description": what }))
    };
    let properties: Map<String, Value> = header.iter().map(property).collect();
    json!({ "title": SCHEMA, "type": "object", "properties": properties })
}

fn value(name: &str, cell: &str) -> Value {
    let integer = cell.parse::<i64>().ok().map(serde_json::Number::from);
    let number =
        integer.or_else(|| serde_json::Number::from_f64(cell.parse().ok()?)).filter(|_| !DIGITS.contains(&name));
    match number {
        _ if cell.is_empty() => Value::Null,
        Some(number) => Value::Number(number),
        None => Value::String(cell.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    use super::*;
    use crate::mcap::{Channel, Message};

    #[test]
    fn a_table_comes_back_with_its_words_and_its_metadata() {
        let text = "# model 7\n# board 0011\ntime_s,word,previous,x_m,seal\n0.5,0011,,1.25,NAPN\n1.5,0100,0011,,NAPN\n";
        let log = from_text(text).unwrap();
        let back = String::from_utf8(to_text(&log).unwrap()).unwrap();
        let mut rows: Vec<&str> = back.lines().collect();
        rows.sort_unstable();
        // The keys of a JSON object stand in the order of the alphabet.
        assert_eq!(rows, [",NAPN,0.5,0011,1.25", "0011,NAPN,1.5,0100,", "previous,seal,time_s,word,x_m"]);
        let has = |text: &str| log.windows(text.len()).any(|part| part == text.as_bytes());
        assert!(has(SCHEMA) && has("jsonschema") && has("model") && has("x, read as m"));
    }

    fn log_of(messages: &[(&str, &str, u64, &str)]) -> Log {
        let mut log = Log::default();
        for (k, (topic, encoding, log_time, data)) in messages.iter().enumerate() {
            let number = k as u16;
            let channel = Channel { topic: (*topic).into(), encoding: (*encoding).into(), schema: String::new() };
            log.channels.insert(number, channel);
            log.messages.push(Message { channel: number, log_time: *log_time, data: data.as_bytes().to_vec() });
        }
        log
    }

    #[test]
    fn topics_are_joined_by_time_and_lists_are_numbered() {
        let joints = ("/joints", "json", 1_000_000_000, r#"{"q": [1, 2], "base": {"px": 3}}"#);
        let log = log_of(&[joints, ("/torques", "json", 1_000_000_000, r#"{"tau": [4, 5]}"#)]);
        let text = String::from_utf8(table(&log, &Limits::COMMAND).unwrap()).unwrap();
        assert_eq!(text, "time_s,base_px,q1,q2,tau1,tau2\n1.000000000,3,1,2,4,5\n");
    }

    #[test]
    fn another_encoding_is_refused_by_name() {
        let error = table(&log_of(&[("/imu", "cdr", 0, "")]), &Limits::COMMAND).unwrap_err().to_string();
        assert!(error.contains("/imu") && error.contains("cdr"), "{error}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 200, rng_seed: RngSeed::Fixed(5), failure_persistence: None, ..Default::default() })]

        #[test]
        fn damaged_logs_are_errors(cut in 0usize..700, at in 0usize..700, byte in any::<u8>()) {
            let mut log = from_text("time_s,x_mm\n1,2\n3,4\n").unwrap();
            let n = log.len();
            log[at % n] = byte;
            log.truncate(n - cut % n);
            let _ = to_text(&log);
        }
    }
}
