//! The reference pages have every key of the files and every variant of the messages, with its index.

use std::fs;

/// Pages with the sources whose `Raw…` structures hold the keys of the files that they describe.
const KEYS: [(&str, &str); 5] = [
    ("docs/arm-file.md", "host/arm/src/arm/raw.rs"),
    ("docs/arm-file.md", "host/arm/src/arm/frames.rs"),
    ("docs/board-profile.md", "host/arm/src/board_profile/raw.rs"),
    ("docs/robot-files.md", "host/robot/src/dh.rs"),
    ("docs/robot-files.md", "host/papers/src/grasp/file.rs"),
];
/// Pages with the enumerations whose variants they number, in tables.
const TABLES: [(&str, &str, &str); 5] = [
    ("docs/wire.md", "shared/src/wire/message.rs", "Request<'a>"),
    ("docs/wire.md", "shared/src/wire/message.rs", "Answer"),
    ("docs/wire.md", "shared/src/wire/message.rs", "Refusal"),
    ("docs/wire.md", "shared/src/sequencer/command.rs", "Command"),
    ("docs/formats.md", "shared/src/table.rs", "Record"),
];
/// The same, in sentences.
const LISTS: [(&str, &str, &str); 11] = [
    ("docs/wire.md", "shared/src/sequencer/phase.rs", "Phase"),
    ("docs/wire.md", "shared/src/sequencer/phase.rs", "Event"),
    ("docs/wire.md", "shared/src/sequencer/fault.rs", "FaultKind"),
    ("docs/wire.md", "shared/src/sequencer/command.rs", "CommandError"),
    ("docs/wire.md", "shared/src/table/error.rs", "TableError"),
    ("docs/wire.md", "shared/src/table/error.rs", "RowError"),
    ("docs/wire.md", "shared/src/output/wiring_error.rs", "WiringError"),
    ("docs/wire.md", "shared/src/profile/mismatch.rs", "Mismatch"),
    ("docs/wire.md", "shared/src/profile/error.rs", "ProfileError"),
    ("docs/formats.md", "shared/src/profile.rs", "ProfileRecord"),
    ("docs/formats.md", "shared/src/output.rs", "Drive"),
];

fn read(path: &str) -> String {
    fs::read_to_string(xtask::setup::root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn without_visibility(line: &str) -> &str {
    ["pub(super) ", "pub(crate) "].iter().find_map(|visibility| line.strip_prefix(visibility)).unwrap_or(line)
}

/// The lines of every item of a source that begins with `start`, without those that open and close it.
fn bodies<'s>(source: &'s str, start: &str) -> Vec<&'s str> {
    let mut lines = source.lines();
    let mut found = Vec::new();
    while lines.any(|line| without_visibility(line).starts_with(start)) {
        found.extend(lines.by_ref().take_while(|line| *line != "}"));
    }
    found
}

/// The keys of the structures of a file: the names of their fields, or those that serde is given for them.
fn keys(source: &str) -> Vec<&str> {
    let (mut found, mut renamed) = (Vec::new(), None);
    for line in bodies(source, "struct Raw") {
        if let Some(name) = line.trim().strip_prefix("#[serde(rename = \"").and_then(|rest| rest.strip_suffix("\")]")) {
            renamed = Some(name);
        } else if let Some(name) = declared(line) {
            found.push(renamed.take().unwrap_or(name));
        }
    }
    found
}

/// The name that a line of a structure or an enumeration declares.
fn declared(line: &str) -> Option<&str> {
    let line = without_visibility(line.strip_prefix("    ")?);
    let end = line.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(line.len());
    (end > 0 && !line.starts_with(' ')).then(|| &line[..end])
}

fn variants<'s>(source: &'s str, of: &str) -> Vec<&'s str> {
    let found: Vec<_> = bodies(source, &format!("pub enum {of} {{")).into_iter().filter_map(declared).collect();
    assert!(found.len() > 1, "the enumeration {of} was not found");
    found
}

/// Fails with everything that is missing at once.
fn none(missing: Vec<String>) {
    assert!(missing.is_empty(), "\n{}", missing.join("\n"));
}

#[test]
fn every_key_of_a_file_is_described() {
    let mut missing = Vec::new();
    for (page, source) in KEYS {
        let (text, source_text) = (read(page), read(source));
        let words: Vec<&str> = text.split(|c: char| !c.is_alphanumeric() && c != '_').collect();
        let keys = keys(&source_text);
        assert!(keys.len() > 5, "the keys in {source} were not found");
        let absent = keys.iter().filter(|key| !words.contains(key));
        missing.extend(absent.map(|key| format!("{page}: the key {key} of {source} is missing")));
    }
    none(missing);
}

#[test]
fn every_message_has_its_index() {
    let mut missing = Vec::new();
    for (page, source, of) in TABLES {
        let text = read(page);
        for (index, name) in variants(&read(source), of).iter().enumerate() {
            if !text.contains(&format!("\n| {index} | `{name}`")) {
                missing.push(format!("{page}: no row `| {index} | `{name}`` of {of} in {source}"));
            }
        }
    }
    for (page, source, of) in LISTS {
        let text = read(page);
        for (index, name) in variants(&read(source), of).iter().enumerate() {
            if !text.contains(&format!(" {index} `{name}`")) {
                missing.push(format!("{page}: no `{index} {name}` of {of} in {source}"));
            }
        }
    }
    none(missing);
}
