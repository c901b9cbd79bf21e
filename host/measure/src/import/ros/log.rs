//! Topics of an MCAP log as parts: messages of ROS 2 in CDR, and objects in JSON.
//!
//! The column `TOPIC/stamp` has the time stamps in s since the first of the log.

use std::collections::{BTreeMap, HashMap};

use crate::log::{cells, max_values};
use crate::mcap::{Channel, Log};
use darm_core::real::{Mat3, Vec3};
use darm_core::se::rotation_log;
use darm_robot::files::Limits;
use serde_json::Value;

use super::message::{self, Message};
use crate::import::error::Fault;
use crate::import::recording::{Column, Part};

/// Names of a quaternion, the scalar last.
const QUATERNION: [&str; 4] = ["orientation.x", "orientation.y", "orientation.z", "orientation.w"];
/// Most programs that send on one topic: more sets of fields are messages that differ.
const MAX_PUBLISHERS: usize = 8;
const ROTATION: [&str; 3] = ["rotation.x", "rotation.y", "rotation.z"];

/// Messages of one topic, of one type.
#[derive(Default)]
struct Topic {
    kind: String,
    stamps_ns: Vec<i64>,
    /// Columns in the order in which messages first have them.
    names: Vec<String>,
    /// Their numbers.
    by_name: HashMap<String, usize>,
    /// Cells of each row by the number of their column.
    rows: Vec<Vec<(usize, String, f64)>>,
    n_unread: usize,
    /// Names of the joints of the last message that had some.
    joints: Vec<String>,
    is_json: bool,
    /// What of messages is not read, and of how many.
    odd: BTreeMap<String, usize>,
    /// Messages that are damaged: how many, and which is the first and why.
    damaged: Option<(usize, (String, String))>,
}

/// The topics of logs that belong together, one after the other, and notes.
pub(crate) fn read(files: &[Vec<u8>], limits: &Limits) -> Result<(Vec<Part>, Vec<String>), Fault> {
    let (mut topics, mut notes): (BTreeMap<String, Topic>, Vec<String>) = (BTreeMap::new(), Vec::new());
    for bytes in files {
        let (log, is_cut) = Log::read_within(bytes, limits).map_err(|error| Fault::of_file(error.to_string()))?;
        if is_cut {
            let text = format!(
                "the log ends in the middle of a record; its {} complete messages are read",
                log.messages.len()
            );
            notes.push(text);
        }
        if !log.damaged.is_empty() {
            let (what, n) = (log.damaged.join(", "), log.messages.len());
            notes.push(format!("the log is damaged and parts are left out: {what}; its {n} other messages are read"));
        }
        add(&log, &mut topics, limits)?;
    }
    for (name, topic) in &mut topics {
        let n_back = topic.sort();
        if n_back > 0 {
            notes.push(format!(
                "{name}: {n_back} time stamps run back; its messages are put in the order of their stamps"
            ));
        }
    }
    let start_ns = topics.values().filter_map(|topic| topic.stamps_ns.first().copied()).min().unwrap_or(0);
    for (name, topic) in &topics {
        let odd = topic.odd.iter().map(|(what, n)| format!("{name}: {n} messages are read without their {what}"));
        notes.extend(odd);
        match &topic.damaged {
            Some((_, (place, text))) if topic.rows.is_empty() => return Err(Fault::at(place.clone(), text.clone())),
            Some((n, (place, text))) => notes.push(format!("{n} messages are damaged and left out; {place}: {text}")),
            None => {}
        }
    }
    let mut parts: Vec<Part> = Vec::new();
    for (name, topic) in topics {
        let publishers = topic.publishers();
        if publishers.len() > 1 {
            let n = publishers.len();
            notes.push(format!("{name}: {n} programs send other joints in turn; their messages are joined by time"));
        }
        for (k, topic) in publishers.into_iter().enumerate() {
            let mut part = topic.part(name.clone(), start_ns);
            // One column of time for all.
            if k > 0 {
                part.columns.retain(|column| !column.name.ends_with("/stamp"));
            }
            parts.push(part);
        }
    }
    if parts.is_empty() {
        return Err(Fault::of_file("the log has no message"));
    }
    Ok((parts, notes))
}

fn add(log: &Log, topics: &mut BTreeMap<String, Topic>, limits: &Limits) -> Result<(), Fault> {
    let mut n_values: usize = topics.values().map(|topic| topic.rows.len() * topic.names.len()).sum();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for message in &log.messages {
        let Some(channel) = log.channels.get(&message.channel) else { continue };
        let number = counts.entry(&channel.topic).or_default();
        *number += 1;
        let place = || format!("{}, message {number}", channel.topic);
        let topic = topics.entry(channel.topic.clone()).or_default();
        if topic.rows.is_empty() {
            topic.kind.clone_from(&channel.schema);
        } else if topic.kind != channel.schema {
            return Err(Fault::at(place(), format!("the type {} differs from {} before", channel.schema, topic.kind)));
        }
        // A value takes up to 100 times its text: counted before it is parsed. Cells that a row does not have are there too.
        n_values += match channel.encoding.as_str() {
            "json" => max_values(&message.data),
            encoding if message::is_known(&channel.schema, encoding) => 1 + message.data.len() / 8,
            _ => 1,
        };
        // A key and its value are counted twice.
        let is_wide = channel.encoding == "json" && max_values(&message.data) > 4 * limits.columns;
        if n_values > limits.cells || is_wide || !limits.has_room_for(topic.rows.len(), topic.names.len()) {
            return Err(Fault::of_file(limits.too_many_cells()));
        }
        let log_ns = i64::try_from(message.log_time).unwrap_or(i64::MAX);
        if let Err(text) = topic.message(channel, &message.data, log_ns) {
            topic.damaged.get_or_insert_with(|| (0, (place(), text))).0 += 1;
        }
    }
    Ok(())
}

impl Topic {
    fn message(&mut self, channel: &Channel, data: &[u8], log_ns: i64) -> Result<(), String> {
        match channel.encoding.as_str() {
            encoding if message::is_known(&channel.schema, encoding) => {
                let Message { stamp_ns, mut fields, unread } =
                    message::read(&channel.schema, encoding, data, &mut self.joints)?;
                unread.into_iter().for_each(|unread| *self.odd.entry(unread).or_default() += 1);
                self.same_side(&mut fields);
                // A header that nobody stamped.
                self.stamps_ns.push(if stamp_ns == 0 { log_ns } else { stamp_ns });
                let cells: Vec<_> = fields.into_iter().map(|(name, number)| (name, String::new(), number)).collect();
                self.row(cells);
            }
            "json" => {
                let Ok(Value::Object(object)) = serde_json::from_slice(data) else {
                    return Err("is no JSON object".into());
                };
                self.is_json = true;
                self.stamps_ns.push(log_ns);
                let number = |cell: &String| cell.parse().unwrap_or(f64::NAN);
                let cells = cells(&object).into_iter().map(|(name, cell)| (name, cell.clone(), number(&cell)));
                self.row(cells.collect());
            }
            encoding => {
                self.n_unread += 1;
                if self.n_unread == 1 {
                    let kind = if channel.schema.is_empty() { "unknown type" } else { &channel.schema };
                    self.kind = format!("{kind} in {encoding}, not read");
                }
            }
        }
        Ok(())
    }

    /// Gives a quaternion the sign that is closer to the one before: q and −q are the same rotation.
    fn same_side(&self, fields: &mut Vec<(String, f64)>) {
        let value = |fields: &[(String, f64)], name: &str| fields.iter().find(|(own, _)| own == name).map(|(_, x)| *x);
        let [Some(x), Some(y), Some(z), Some(w)] = QUATERNION.map(|name| value(fields, name)) else { return };
        let before = self.rows.last().map(|row| {
            QUATERNION.map(|name| {
                row.iter().find(|(column, ..)| self.names[*column] == name).map_or(0.0, |(.., number)| *number)
            })
        });
        if before.is_some_and(|before| before.iter().zip([x, y, z, w]).map(|(a, b)| a * b).sum::<f64>() < 0.0) {
            fields
                .iter_mut()
                .filter(|(name, _)| QUATERNION.contains(&name.as_str()))
                .for_each(|(_, number)| *number = -*number);
        }
        let vector = rotation_vector([x, y, z, w]);
        fields.extend(ROTATION.iter().zip(vector.iter()).map(|(name, number)| ((*name).to_owned(), *number)));
    }

    fn row(&mut self, cells: Vec<(String, String, f64)>) {
        let mut row = Vec::with_capacity(cells.len());
        for (k, (name, text, number)) in cells.into_iter().enumerate() {
            // Messages of one topic mostly have the same fields in the same order.
            let known = if self.names.get(k) == Some(&name) { Some(k) } else { self.by_name.get(&name).copied() };
            let column = known.unwrap_or_else(|| {
                self.by_name.insert(name.clone(), self.names.len());
                self.names.push(name);
                self.names.len() - 1
            });
            row.push((column, text, number));
        }
        self.rows.push(row);
    }

    /// Puts messages in the order of their time stamps; how many ran back.
    fn sort(&mut self) -> usize {
        let n_back = self.stamps_ns.windows(2).filter(|pair| pair[1] < pair[0]).count();
        if n_back > 0 {
            let mut rows: Vec<_> = self.stamps_ns.drain(..).zip(self.rows.drain(..)).collect();
            rows.sort_by_key(|(stamp, _)| *stamp);
            (self.stamps_ns, self.rows) = rows.into_iter().unzip();
        }
        n_back
    }

    /// The messages by who sent them, where several programs send different fields in turn on one topic: sets of fields that
    /// have none in common. The one with the most messages comes first.
    fn publishers(self) -> Vec<Self> {
        let mut sets: Vec<(Vec<usize>, usize)> = Vec::new();
        for row in &self.rows {
            let mut own: Vec<usize> = row.iter().map(|(column, ..)| *column).collect();
            own.sort_unstable();
            match sets.iter().position(|(set, _)| *set == own) {
                Some(known) => sets[known].1 += 1,
                None if sets.len() >= MAX_PUBLISHERS => return vec![self],
                None => sets.push((own, 1)),
            }
        }
        let mut all: Vec<usize> = sets.iter().flat_map(|(set, _)| set.iter().copied()).collect();
        all.sort_unstable();
        let have_common = all.windows(2).any(|pair| pair[0] == pair[1]);
        if sets.len() < 2 || have_common || sets.iter().any(|(set, n)| *n < 2 || set.is_empty()) {
            return vec![self];
        }
        sets.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
        let of_set = |(set, _): &(Vec<usize>, usize)| {
            let mut own = Self { kind: self.kind.clone(), is_json: self.is_json, ..Self::default() };
            own.names = set.iter().map(|column| self.names[*column].clone()).collect();
            for (stamp, row) in self.stamps_ns.iter().zip(&self.rows) {
                let place = |column: usize| set.iter().position(|own| *own == column);
                let cells: Option<Vec<_>> =
                    row.iter().map(|(k, text, x)| Some((place(*k)?, text.clone(), *x))).collect();
                if let Some(cells) = cells.filter(|cells| !cells.is_empty()) {
                    own.stamps_ns.push(*stamp);
                    own.rows.push(cells);
                }
            }
            own
        };
        sets.iter().map(of_set).collect()
    }

    fn part(self, name: String, start_ns: i64) -> Part {
        let (n, is_json) = (self.rows.len(), self.is_json);
        let shape = vec![if self.n_unread > 0 { self.n_unread } else { n }];
        let column = |field: &String| Column {
            name: format!("{name}/{field}"),
            unit: message::unit(&self.kind, field).filter(|_| !is_json),
            numbers: vec![f64::NAN; n],
            texts: if is_json { vec![String::new(); n] } else { Vec::new() },
        };
        let mut columns: Vec<Column> = self.names.iter().map(column).collect();
        for (at, row) in self.rows.into_iter().enumerate() {
            for (column, text, number) in row {
                columns[column].numbers[at] = number;
                if is_json {
                    columns[column].texts[at] = text;
                }
            }
        }
        if n > 0 {
            let seconds = self.stamps_ns.iter().map(|stamp| stamp.saturating_sub(start_ns) as f64 / 1e9).collect();
            let stamp = Column { unit: Some("s".into()), ..Column::of_numbers(format!("{name}/stamp"), seconds) };
            columns.insert(0, stamp);
        }
        let kind = if is_json { "JSON".into() } else { self.kind };
        Part { name, kind, shape, columns, stamps_ns: self.stamps_ns, ..Part::default() }
    }
}

/// Axis times angle of a quaternion that need not have length 1; NaN of one without length.
fn rotation_vector([x, y, z, w]: [f64; 4]) -> Vec3<f64> {
    let length = (x * x + y * y + z * z + w * w).sqrt();
    if !(length > 1e-9 && length.is_finite()) {
        return Vec3::new(f64::NAN, f64::NAN, f64::NAN);
    }
    let [x, y, z, w] = [x, y, z, w].map(|part| part / length);
    let rotation = Mat3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    );
    rotation_log(&rotation)
}
