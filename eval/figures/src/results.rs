//! The file in which a process keeps the outcome of each item as soon as it has it.
//!
//! One line each: CRC-32 (ISO-HDLC) of the rest as eight hexadecimal digits, a blank, JSON. The first line describes the
//! run; the others are items with their outcomes, in any order. The file is only ever appended to. A line that was cut short
//! by a crash is the last one: it is dropped, and its item runs again.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock};

use anyhow::{Context as _, Result, bail};
use crc::{CRC_32_ISO_HDLC, Crc};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Version of this format.
const FORMAT: u32 = 1;
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// What a result file belongs to: outcomes of different runs are never mixed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    format: u32,
    /// The command.
    pub command: String,
    /// Its options, as far as an outcome depends on them.
    pub options: Value,
    version: String,
    /// CRC-32 of the program.
    program: String,
}

/// A line of the file.
#[derive(Debug, Serialize, Deserialize)]
#[serde(untagged)]
enum Line {
    Run { run: Run },
    Item { item: String, outcome: Value },
}

impl Run {
    /// A run of this program.
    ///
    /// # Errors
    ///
    /// The program's own file cannot be read.
    pub fn new(command: &str, options: Value) -> Result<Self> {
        let version = env!("CARGO_PKG_VERSION").to_owned();
        Ok(Self { format: FORMAT, command: command.to_owned(), options, version, program: own_checksum()? })
    }

    /// What differs from another run, each with both values; empty for the same run.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let mut found = Vec::new();
        let mut compare = |what: &str, mine: &Value, others: &Value| {
            if mine != others {
                found.push(format!("{what} is {mine} here and {others} there"));
            }
        };
        let text = |text: &str| Value::from(text);
        compare("format", &self.format.into(), &other.format.into());
        compare("command", &text(&self.command), &text(&other.command));
        compare("version", &text(&self.version), &text(&other.version));
        compare("checksum of the program", &text(&self.program), &text(&other.program));
        match (&self.options, &other.options) {
            (Value::Object(mine), Value::Object(others)) => {
                let names: std::collections::BTreeSet<&String> = mine.keys().chain(others.keys()).collect();
                for name in names {
                    let value = |options: &serde_json::Map<String, Value>| options.get(name).cloned();
                    let (mine, others) = (value(mine).unwrap_or_default(), value(others).unwrap_or_default());
                    compare(&format!("option {name}"), &mine, &others);
                }
            }
            (mine, others) => compare("options", mine, others),
        }
        found
    }
}

/// CRC-32 of the program that runs: outcomes of two builds are not mixed.
fn own_checksum() -> Result<String> {
    static SUM: OnceLock<String> = OnceLock::new();
    if let Some(sum) = SUM.get() {
        return Ok(sum.clone());
    }
    let path = std::env::current_exe().context("the path of this program is not known")?;
    let mut file = File::open(&path).with_context(|| format!("{} cannot be read", path.display()))?;
    let (mut digest, mut block) = (CRC.digest(), vec![0; 1 << 20]);
    loop {
        match file.read(&mut block)? {
            0 => return Ok(SUM.get_or_init(|| format!("{:08x}", digest.finalize())).clone()),
            n => digest.update(&block[..n]),
        }
    }
}

/// What a result file has.
#[derive(Debug, Default)]
pub struct Contents {
    /// Its descriptions of the run: one, or several where files were joined.
    pub runs: Vec<Run>,
    /// Items and outcomes in the order of the lines.
    pub items: Vec<(String, Value)>,
    /// Length without a last line that was cut short, bytes.
    complete: usize,
}

impl Contents {
    /// Reads the lines of a file; `name` is for errors.
    ///
    /// # Errors
    ///
    /// A line other than the last is damaged, or is not a line of a result file.
    pub fn parse(bytes: &[u8], name: &str) -> Result<Self> {
        let mut contents = Self::default();
        let mut lines = bytes.split_inclusive(|byte| *byte == b'\n').enumerate().peekable();
        while let Some((number, line)) = lines.next() {
            match checked(line) {
                Some(json) => contents.add(json).with_context(|| format!("{name}:{}", number + 1))?,
                None if lines.peek().is_none() => break,
                None => bail!(
                    "{name}:{}: the line differs from its checksum; delete it, and its item runs again",
                    number + 1
                ),
            }
            contents.complete += line.len();
        }
        Ok(contents)
    }

    fn add(&mut self, json: &[u8]) -> Result<()> {
        match serde_json::from_slice(json).context("not a line of a result file")? {
            Line::Run { run } => self.runs.push(run),
            Line::Item { item, outcome } => self.items.push((item, outcome)),
        }
        Ok(())
    }
}

/// The JSON of a complete line that agrees with its checksum.
fn checked(line: &[u8]) -> Option<&[u8]> {
    let (sum, json) = line.strip_suffix(b"\n")?.split_at_checked(9)?;
    let written = std::str::from_utf8(sum.strip_suffix(b" ")?).ok()?;
    (u32::from_str_radix(written, 16).ok()? == CRC.checksum(json)).then_some(json)
}

fn line_of(line: &Line) -> Result<String> {
    let json = serde_json::to_string(line)?;
    Ok(format!("{:08x} {json}\n", CRC.checksum(json.as_bytes())))
}

/// Items with their outcomes.
pub type Outcomes = BTreeMap<String, Value>;

/// Joins items; the same item twice is accepted with the same outcome only.
///
/// # Errors
///
/// An item has two outcomes.
pub fn join(items: impl IntoIterator<Item = (String, Value)>) -> Result<Outcomes> {
    let mut joined = Outcomes::new();
    let mut contradictions = Vec::new();
    for (item, outcome) in items {
        if joined.get(&item).is_some_and(|known| *known != outcome) {
            contradictions.push(item);
        } else {
            joined.insert(item, outcome);
        }
    }
    if !contradictions.is_empty() {
        contradictions.sort();
        contradictions.dedup();
        bail!("two different outcomes of: {}", contradictions.join(", "));
    }
    Ok(joined)
}

/// A result file that a process appends to.
#[derive(Debug)]
pub struct ResultFile {
    path: PathBuf,
    file: Mutex<File>,
}

impl ResultFile {
    /// Opens or creates the file of a run, with the outcomes that it has already.
    ///
    /// # Errors
    ///
    /// Another process has the file open, it belongs to another run, or it is damaged.
    pub fn open(path: &Path, run: &Run) -> Result<(Self, Outcomes)> {
        let name = path.display().to_string();
        let mut options = OpenOptions::new();
        let mut file = options.read(true).write(true).create(true).truncate(false).open(path).context(name.clone())?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                bail!("another process writes to {name}; write {{shard}} in the name where several run")
            }
            Err(TryLockError::Error(error)) => return Err(error).context(name),
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).context(name.clone())?;
        let contents = Contents::parse(&bytes, &name)?;
        for other in &contents.runs {
            let differences = run.differences(other);
            if !differences.is_empty() {
                bail!("{name} belongs to another run: {}; name another file", differences.join(", "));
            }
        }
        file.set_len(contents.complete as u64).context(name.clone())?;
        file.seek(SeekFrom::End(0))?;
        let results = Self { path: path.to_owned(), file: Mutex::new(file) };
        if contents.runs.is_empty() {
            if !contents.items.is_empty() {
                bail!("{name} does not say which run its items belong to; name another file");
            }
            results.write(&Line::Run { run: run.clone() })?;
        }
        Ok((results, join(contents.items).context(name)?))
    }

    /// Appends the outcome of an item.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn append(&self, item: &str, outcome: &Value) -> Result<()> {
        self.write(&Line::Item { item: item.to_owned(), outcome: outcome.clone() })
    }

    fn write(&self, line: &Line) -> Result<()> {
        let text = line_of(line)?;
        let mut file = self.file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        file.write_all(text.as_bytes()).with_context(|| format!("{} cannot be written", self.path.display()))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn run(seeds: u64) -> Run {
        Run::new("test", json!({ "seeds": seeds, "arm": "planar" })).unwrap()
    }

    /// A file with three items in a folder that is removed with the first value.
    fn three() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.results");
        let (file, known) = ResultFile::open(&path, &run(3)).unwrap();
        assert!(known.is_empty());
        for k in 0..3 {
            file.append(&format!("seed {k}"), &json!({ "error": 0.1 * f64::from(k) })).unwrap();
        }
        (folder, path)
    }

    #[test]
    fn outcomes_are_read_back_exactly() {
        let (_folder, path) = three();
        let (_, known) = ResultFile::open(&path, &run(3)).unwrap();
        assert_eq!(known.len(), 3);
        assert_eq!(known["seed 2"], json!({ "error": 0.1 * 2.0 }));
    }

    #[test]
    fn a_last_line_that_was_cut_short_is_dropped_wherever_it_was_cut() {
        let (_folder, path) = three();
        let complete = std::fs::read(&path).unwrap();
        let last = complete[..complete.len() - 1].iter().rposition(|byte| *byte == b'\n').unwrap() + 1;
        for cut in last..complete.len() {
            std::fs::write(&path, &complete[..cut]).unwrap();
            let (file, known) = ResultFile::open(&path, &run(3)).unwrap();
            assert_eq!(known.len(), 2, "cut at {cut}");
            file.append("seed 2", &json!({ "error": 0.2 })).unwrap();
            drop(file);
            assert_eq!(std::fs::read(&path).unwrap(), complete, "cut at {cut}");
        }
    }

    #[test]
    fn a_first_line_that_was_cut_short_is_written_again() {
        let (_folder, path) = three();
        let complete = std::fs::read(&path).unwrap();
        for cut in 0..complete.iter().position(|byte| *byte == b'\n').unwrap() {
            std::fs::write(&path, &complete[..cut]).unwrap();
            let (_, known) = ResultFile::open(&path, &run(3)).unwrap();
            assert!(known.is_empty());
            assert!(std::fs::read_to_string(&path).unwrap().contains("\"run\""), "cut at {cut}");
        }
    }

    #[test]
    fn a_damaged_line_is_refused_with_its_number() {
        let (_folder, path) = three();
        let complete = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, complete.replacen("seed 0", "seed 9", 1)).unwrap();
        let error = ResultFile::open(&path, &run(3)).unwrap_err().to_string();
        assert!(error.contains("a.results:2:"), "{error}");
    }

    #[test]
    fn a_file_of_another_run_is_refused_with_what_differs() {
        let (_folder, path) = three();
        let error = ResultFile::open(&path, &run(4)).unwrap_err().to_string();
        assert!(error.contains("option seeds is 4 here and 3 there") && !error.contains("arm"), "{error}");
        let mut other = run(3);
        (other.command, other.program) = ("blind".into(), "00000000".into());
        let error = ResultFile::open(&path, &other).unwrap_err().to_string();
        assert!(error.contains("command is \"blind\" here and \"test\" there"), "{error}");
        assert!(error.contains("checksum of the program"), "{error}");
    }

    #[test]
    fn two_processes_cannot_write_to_one_file() {
        let (_folder, path) = three();
        let _open = ResultFile::open(&path, &run(3)).unwrap();
        let error = ResultFile::open(&path, &run(3)).unwrap_err().to_string();
        assert!(error.contains("another process"), "{error}");
    }

    #[test]
    fn an_item_with_two_outcomes_is_named() {
        let twice = |second: i32| join([("seed 1".to_owned(), json!(1)), ("seed 1".to_owned(), json!(second))]);
        assert_eq!(twice(1).unwrap().len(), 1);
        assert!(twice(2).unwrap_err().to_string().ends_with("of: seed 1"));
    }
}
