//! Recordings that pages start: `darm record` as a separate process, which is a guest of this server's port.
//!
//! A process loses no finished row when the server ends, and its file is that of the command. It moves the arm with the control of
//! the page that has started it, or alone once that page has gone, as a program on the board does. A name is made of letters, digits,
//! `-` and `_`, and no file is replaced: so a page can write nothing else.

use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Instant, UNIX_EPOCH};

use serde::Serialize;
use serde_json::Value;

use crate::control::GrantNumber;
use crate::refusal::{Kind, Refused};

/// Longest name.
const MAX_NAME: usize = 60;
/// Largest measurement that a page gets.
const MAX_DATA: u64 = crate::upload::MAX_FILES as u64;

/// Where recordings go, and the command that makes one.
pub struct RecordSetup {
    /// The only folder in which a page writes files.
    pub folder: PathBuf,
    /// The command that plays this table and writes this measurement; it prints JSON.
    pub command: Box<dyn Fn(&RecordFiles) -> Command + Send + Sync>,
}

/// The files of one recording.
#[derive(Clone, Debug)]
pub struct RecordFiles {
    /// The table; its visit file is next to it.
    pub table: PathBuf,
    /// The measurement.
    pub output: PathBuf,
}

/// What pages show of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordingView {
    /// Name of the measurement.
    pub name: String,
    /// Whether it runs.
    pub is_running: bool,
    /// Whether it ended with all that was wanted.
    pub is_complete: bool,
    /// What came of it, in a sentence.
    pub text: String,
}

/// The recordings of a server.
#[derive(Default)]
pub(crate) struct Recordings {
    setup: Option<RecordSetup>,
    state: Mutex<Recorded>,
}

#[derive(Default)]
struct Recorded {
    running: Option<Running>,
    last: Option<RecordingView>,
}

/// A recording that runs.
struct Running {
    name: String,
    process: u32,
    /// The control of the page that has started it.
    grant: GrantNumber,
    since: Instant,
}

impl Recordings {
    pub(crate) fn new(setup: Option<RecordSetup>) -> Self {
        Self { setup, state: Mutex::default() }
    }

    /// Whether this process records for the page with this control.
    pub(crate) fn is_for(&self, process: Option<u32>, grant: GrantNumber) -> bool {
        let state = self.state();
        state.running.as_ref().is_some_and(|running| process == Some(running.process) && grant == running.grant)
    }

    /// What pages show; `None` where the server has no folder for recordings.
    pub(crate) fn view(&self) -> Option<RecordingsView> {
        self.setup.as_ref()?;
        let state = self.state();
        let running = state.running.as_ref().map(|running| RecordingView {
            name: running.name.clone(),
            is_running: true,
            is_complete: false,
            text: format!("recording for {:.0} s", running.since.elapsed().as_secs_f64()),
        });
        Some(RecordingsView { last: running.or_else(|| state.last.clone()) })
    }

    fn setup(&self) -> Result<&RecordSetup, Refused> {
        let text = "the server has no folder for measurements; start it with --data FOLDER";
        self.setup.as_ref().ok_or_else(|| Refused::new(Kind::Invalid, text))
    }

    fn state(&self) -> MutexGuard<'_, Recorded> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The measurements of the folder, the newest first.
    pub(crate) fn list(&self) -> Result<Vec<DataFile>, Refused> {
        let Some(RecordSetup { folder, .. }) = &self.setup else { return Ok(Vec::new()) };
        let entries = fs::read_dir(folder).map_err(|error| Refused::new(Kind::Refused, error))?;
        let mut files: Vec<DataFile> = entries.filter_map(|entry| data_file(&entry.ok()?.path())).collect();
        files.sort_by_key(|file| std::cmp::Reverse(file.at_ms));
        Ok(files)
    }

    /// The bytes of one of them.
    pub(crate) fn read(&self, name: &str) -> Result<Vec<u8>, Refused> {
        let path = self.setup()?.folder.join(name);
        // Only a name that the list has: no path leads out of the folder.
        let found = data_file(&path).filter(|file| file.name == name && file.bytes <= MAX_DATA);
        let no_file = || Refused::new(Kind::Invalid, format!("no measurement {name} in the folder of this server"));
        found.ok_or_else(no_file)?;
        fs::read(&path).map_err(|error| Refused::new(Kind::Refused, error))
    }

    /// Writes table and visit file into the folder as `name`, and starts the command for the page with this control. One call at a time: the
    /// state is not locked meanwhile, as pages and stops wait for it, and a disk may be slow.
    pub(crate) fn start(
        self: &Arc<Self>,
        grant: GrantNumber,
        name: &str,
        table: &[u8],
        visits: &str,
    ) -> Result<(), Refused> {
        let RecordSetup { folder, command } = self.setup()?;
        if !is_name(name) {
            let text = format!("a name has 1 to {MAX_NAME} letters, digits, - and _");
            return Err(Refused::new(Kind::Invalid, text));
        }
        let paths = [".csv", ".visits.csv", ".darm"].map(|end| folder.join(format!("{name}{end}")));
        if let Some(taken) = paths.iter().find(|path| fs::symlink_metadata(path).is_ok()) {
            return Err(Refused::new(Kind::Refused, format!("{} exists; choose another name", taken.display())));
        }
        if let Some(running) = &self.state().running {
            return Err(Refused::new(Kind::Refused, format!("{} is being recorded; wait for it", running.name)));
        }
        let [output, visit_file, table_file] = paths;
        let not_written = |error: std::io::Error| {
            Refused::new(Kind::Refused, format!("the folder {} cannot be written: {error}", folder.display()))
        };
        write_new(&table_file, table).map_err(not_written)?;
        write_new(&visit_file, visits.as_bytes()).map_err(not_written)?;
        let mut command = command(&RecordFiles { table: table_file, output });
        // Ctrl-C in the server's terminal is for the server: the recording continues, as the program on the board does.
        let child = command.process_group(0).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let not_started = |error| Refused::new(Kind::Refused, format!("darm record does not start: {error}"));
        let child = child.map_err(not_started)?;
        let running = Running { name: format!("{name}.csv"), process: child.id(), grant, since: Instant::now() };
        *self.state() = Recorded { running: Some(running), last: None };
        let recordings = Arc::clone(self);
        thread::spawn(move || recordings.finish(child));
        Ok(())
    }

    /// Waits for the command and keeps what came of it.
    fn finish(&self, child: Child) {
        let (is_complete, text) = match child.wait_with_output() {
            Ok(output) => (output.status.success(), sentence(&String::from_utf8_lossy(&output.stdout))),
            Err(error) => (false, error.to_string()),
        };
        let mut state = self.state();
        let name = state.running.take().map_or_else(String::new, |running| running.name);
        state.last = Some(RecordingView { name, is_running: false, is_complete, text });
    }
}

/// What pages show of recordings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordingsView {
    /// The one that runs, or the last.
    pub last: Option<RecordingView>,
}

/// A measurement that the folder has.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub(crate) struct DataFile {
    name: String,
    bytes: u64,
    /// When it was written last, Unix time in ms.
    at_ms: u64,
}

/// A measurement by its name in the folder; `None` of anything else, as of a link.
fn data_file(path: &Path) -> Option<DataFile> {
    let name = path.file_name()?.to_str()?.to_owned();
    let kind = fs::symlink_metadata(path).ok()?;
    let is_measurement = name.strip_suffix(".csv").is_some_and(|stem| is_name(stem.trim_end_matches(".visits")));
    let at_ms = kind.modified().ok()?.duration_since(UNIX_EPOCH).ok()?.as_millis() as u64;
    let is_visits = name.ends_with(".visits.csv");
    (kind.is_file() && is_measurement && !is_visits).then_some(DataFile { name, bytes: kind.len(), at_ms })
}

fn is_name(name: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_');
    (1..=MAX_NAME).contains(&name.len()) && name.chars().all(is_plain)
}

fn write_new(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    OpenOptions::new().write(true).create_new(true).open(path)?.write_all(bytes)
}

/// What `darm record --json` has printed, in a sentence: the measurement, the error, or both.
fn sentence(printed: &str) -> String {
    let mut sentences = Vec::new();
    for value in serde_json::Deserializer::from_str(printed).into_iter::<Value>().map_while(Result::ok) {
        if let (Some(rows), Some(visits)) = (value["rows"].as_u64(), value["visits"].as_u64()) {
            sentences.push(format!("{rows} of {visits} visits measured"));
        }
        let findings = value["findings"].as_array().into_iter().flatten();
        sentences.extend(findings.filter_map(Value::as_str).map(str::to_owned));
        sentences.extend(value["error"]["message"].as_str().map(str::to_owned));
    }
    if sentences.is_empty() { "the recording ended without a result".to_owned() } else { sentences.join("; ") }
}

#[cfg(test)]
mod tests {
    use super::{data_file, is_name, sentence};

    #[test]
    fn a_name_leads_nowhere_else() {
        assert!(["run-1", "A_b", "0"].into_iter().all(is_name));
        let long = "a".repeat(61);
        for name in ["", ".", "..", "../a", "a/b", "a.b", "a b", "ä", "a\0", "-\n", &long] {
            assert!(!is_name(name), "{name:?}");
        }
    }

    #[test]
    fn the_folder_lists_measurements_and_neither_links_nor_other_files() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["run.csv", "run.visits.csv", "run.darm", ".hidden.csv", "a b.csv"] {
            std::fs::write(folder.path().join(name), "x").unwrap();
        }
        std::os::unix::fs::symlink("/etc/passwd", folder.path().join("link.csv")).unwrap();
        std::fs::create_dir(folder.path().join("folder.csv")).unwrap();
        let entries = std::fs::read_dir(folder.path()).unwrap();
        let names: Vec<_> = entries.filter_map(|entry| Some(data_file(&entry.unwrap().path())?.name)).collect();
        assert_eq!(names, ["run.csv"]);
    }

    #[test]
    fn what_the_command_prints_becomes_a_sentence() {
        let printed = "{\"rows\":2,\"visits\":5,\"findings\":[]}\n{\"error\":{\"exit\":7,\"message\":\"another program stopped the arm\"}}";
        assert_eq!(sentence(printed), "2 of 5 visits measured; another program stopped the arm");
        assert_eq!(sentence("panic"), "the recording ended without a result");
    }
}
