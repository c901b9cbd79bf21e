//! Recordings that pages start: `darm record` as a separate process, which is a guest of this server's port.
//!
//! A process loses no finished row when the server ends, and its file is that of the command. It moves the arm with the control of
//! the page that has started it, or alone once that page has gone, as a program on the board does. A name is made of letters, digits,
//! `-` and `_`, and no file is replaced: so a page can write nothing else.

use std::fs::{self, OpenOptions};
use std::io::{Read as _, Write as _};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Instant, UNIX_EPOCH};

use serde::Serialize;
use serde_json::Value;

use crate::control::GrantNumber;
use crate::refusal::{Kind, Refused};

/// Longest name.
const MAX_RECORDING_NAME: usize = 60;
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

/// What a page records.
pub(crate) struct RecordingOrder<'a> {
    /// The control of the page.
    pub(crate) grant: GrantNumber,
    /// Number of stops when the page ordered it.
    pub(crate) stops: u64,
    pub(crate) name: &'a str,
    pub(crate) table: &'a [u8],
    pub(crate) visits: &'a str,
}

/// The recordings of a server.
#[derive(Default)]
pub(crate) struct Recordings {
    setup: Option<RecordSetup>,
    state: Mutex<State>,
}

/// One recording at a time. The lock is never held while files are written or a process starts: pages wait for the state.
enum State {
    Idle {
        last: Option<RecordingView>,
    },
    /// Its files are written and its process starts.
    Starting {
        name: String,
        last: Option<RecordingView>,
    },
    Running(Running),
}

/// A recording that runs.
struct Running {
    name: String,
    process: u32,
    /// The control of the page that has started it.
    grant: GrantNumber,
    /// Number of stops when it was ordered.
    stops: u64,
    since: Instant,
}

impl Default for State {
    fn default() -> Self {
        Self::Idle { last: None }
    }
}

/// A recording that starts. Where it is dropped without a process, what it wrote is removed and another one may start.
struct Start<'a> {
    recordings: &'a Recordings,
    /// The files that were made for it: none of somebody else.
    written: Vec<PathBuf>,
}

impl Start<'_> {
    fn write(&mut self, path: &Path, bytes: &[u8]) -> std::io::Result<()> {
        let mut file = OpenOptions::new().write(true).create_new(true).open(path)?;
        // Also of a file that finds no room on the disk.
        self.written.push(path.to_owned());
        file.write_all(bytes)
    }

    fn has_process(mut self, running: Running) {
        self.written.clear();
        *self.recordings.state() = State::Running(running);
    }
}

impl Drop for Start<'_> {
    fn drop(&mut self) {
        // One that cannot be removed keeps its name from the next recording, which says so.
        self.written.iter().for_each(|path| drop(fs::remove_file(path)));
        let mut state = self.recordings.state();
        if let State::Starting { last, .. } = &mut *state {
            *state = State::Idle { last: last.take() };
        }
    }
}

impl Recordings {
    pub(crate) fn new(setup: Option<RecordSetup>) -> Self {
        Self { setup, state: Mutex::default() }
    }

    /// Whether this process records for the page with this control.
    pub(crate) fn is_for(&self, process: Option<u32>, grant: GrantNumber) -> bool {
        matches!(&*self.state(), State::Running(running) if process == Some(running.process) && grant == running.grant)
    }

    /// Whether this process records what was ordered before the last of this number of stops.
    pub(crate) fn is_outdated(&self, process: Option<u32>, stops: u64) -> bool {
        matches!(&*self.state(), State::Running(running) if process == Some(running.process) && stops != running.stops)
    }

    /// What pages show; `None` where the server has no folder for recordings.
    pub(crate) fn view(&self) -> Option<RecordingsView> {
        self.setup.as_ref()?;
        let last = match &*self.state() {
            State::Idle { last } | State::Starting { last, .. } => last.clone(),
            State::Running(running) => Some(RecordingView {
                name: running.name.clone(),
                is_running: true,
                is_complete: false,
                text: format!("recording for {:.0} s", running.since.elapsed().as_secs_f64()),
            }),
        };
        Some(RecordingsView { last })
    }

    fn setup(&self) -> Result<&RecordSetup, Refused> {
        let text = "the server has no folder for measurements; start it with --data FOLDER";
        self.setup.as_ref().ok_or_else(|| Refused::new(Kind::Invalid, text))
    }

    fn state(&self) -> MutexGuard<'_, State> {
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

    /// One of them, and its length now.
    pub(crate) fn file(&self, name: &str) -> Result<(fs::File, u64), Refused> {
        let path = self.setup()?.folder.join(name);
        // Only a name that the list has: no path leads out of the folder.
        let found = data_file(&path).filter(|file| file.name == name && file.bytes <= MAX_DATA);
        let no_file = || Refused::new(Kind::Invalid, format!("no measurement {name} in the folder of this server"));
        found.ok_or_else(no_file)?;
        let open = || fs::File::open(&path).and_then(|file| file.metadata().map(|now| (file, now.len())));
        open().map_err(|error| Refused::new(Kind::Refused, error))
    }

    /// The bytes of one of them.
    pub(crate) fn read(&self, name: &str) -> Result<Vec<u8>, Refused> {
        let (file, length) = self.file(name)?;
        let mut bytes = Vec::with_capacity(length as usize);
        file.take(length).read_to_end(&mut bytes).map_err(|error| Refused::new(Kind::Refused, error))?;
        Ok(bytes)
    }

    /// Writes table and visit file into the folder, and starts the command if the order is valid when all is ready.
    pub(crate) fn start(
        self: &Arc<Self>,
        order: &RecordingOrder<'_>,
        check: impl Fn() -> Result<(), Refused>,
    ) -> Result<(), Refused> {
        let &RecordingOrder { grant, stops, name, table, visits } = order;
        let RecordSetup { folder, command } = self.setup()?;
        if !is_name(name) {
            let text = format!("a name has 1 to {MAX_RECORDING_NAME} letters, digits, - and _");
            return Err(Refused::new(Kind::Invalid, text));
        }
        let paths = [".csv", ".visits.csv", ".darm"].map(|end| folder.join(format!("{name}{end}")));
        if let Some(taken) = paths.iter().find(|path| fs::symlink_metadata(path).is_ok()) {
            return Err(Refused::new(Kind::Refused, format!("{} exists; choose another name", taken.display())));
        }
        let [output, visit_file, table_file] = paths;
        let mut start = self.begin(format!("{name}.csv"))?;
        let not_written = |error: std::io::Error| {
            Refused::new(Kind::Refused, format!("the folder {} cannot be written: {error}", folder.display()))
        };
        start.write(&table_file, table).map_err(not_written)?;
        start.write(&visit_file, visits.as_bytes()).map_err(not_written)?;
        let not_started = |error| Refused::new(Kind::Refused, format!("darm record does not start: {error}"));
        // Before the process: one that nobody waits for would never end for pages.
        let (child, started) = channel::<Child>();
        let recordings = Arc::clone(self);
        let wait = move || started.recv().map_or((), |child| recordings.finish(child));
        thread::Builder::new().name("recording".into()).spawn(wait).map_err(not_started)?;
        let mut command = command(&RecordFiles { table: table_file, output });
        // Ctrl-C in the server's terminal is for the server: the recording continues, as the program on the board does.
        command.process_group(0).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
        check()?;
        let process = command.spawn().map_err(not_started)?;
        let since = Instant::now();
        start.has_process(Running { name: format!("{name}.csv"), process: process.id(), grant, stops, since });
        // The thread waits for it.
        let _ = child.send(process);
        Ok(())
    }

    /// The only recording that starts or runs is the one of this name from now on.
    fn begin(&self, name: String) -> Result<Start<'_>, Refused> {
        let mut state = self.state();
        match &mut *state {
            State::Idle { last } => {
                *state = State::Starting { name, last: last.take() };
                Ok(Start { recordings: self, written: Vec::new() })
            }
            State::Starting { name, .. } | State::Running(Running { name, .. }) => {
                Err(Refused::new(Kind::Refused, format!("{name} is being recorded; wait for it")))
            }
        }
    }

    /// Waits for the command and keeps what came of it.
    fn finish(&self, child: Child) {
        let (is_complete, text) = match child.wait_with_output() {
            Ok(output) => (output.status.success(), sentence(&String::from_utf8_lossy(&output.stdout))),
            Err(error) => (false, error.to_string()),
        };
        let mut state = self.state();
        if let State::Running(Running { name, .. }) = &mut *state {
            let name = std::mem::take(name);
            *state = State::Idle { last: Some(RecordingView { name, is_running: false, is_complete, text }) };
        }
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
    (1..=MAX_RECORDING_NAME).contains(&name.len()) && name.chars().all(is_plain)
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
    use std::path::Path;
    use std::process::Command;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::time::Duration;

    use super::{RecordSetup, RecordingOrder, Recordings, data_file, is_name, sentence};
    use crate::control::GrantNumber;

    /// Recordings whose command is this one.
    fn recordings(folder: &Path, command: impl Fn() -> Command + Send + Sync + 'static) -> Arc<Recordings> {
        let setup = RecordSetup { folder: folder.to_owned(), command: Box::new(move |_| command()) };
        Arc::new(Recordings::new(Some(setup)))
    }

    fn order(name: &str) -> RecordingOrder<'_> {
        RecordingOrder { grant: GrantNumber(1), stops: 0, name, table: b"table", visits: "visits" }
    }

    fn files(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_recording_that_does_not_start_leaves_no_file_and_its_name_is_free() {
        let folder = tempfile::tempdir().unwrap();
        let is_there = Arc::new(AtomicBool::new(false));
        let there = Arc::clone(&is_there);
        let name = move || if there.load(Ordering::Relaxed) { "true" } else { "/no/such/command" };
        let recordings = recordings(folder.path(), move || Command::new(name()));
        let start = || recordings.start(&order("run-1"), || Ok(()));
        assert!(start().unwrap_err().text.contains("does not start"));
        assert_eq!(files(folder.path()), [""; 0]);
        is_there.store(true, Ordering::Relaxed);
        start().unwrap();
        while recordings.view().unwrap().last.is_none_or(|last| last.is_running) {
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(start().unwrap_err().text.contains("exists"));
    }

    /// Two at once have no other lock than that of the state.
    #[test]
    fn a_recording_does_not_start_while_another_one_does() {
        let folder = tempfile::tempdir().unwrap();
        let slow = || {
            std::thread::sleep(Duration::from_millis(200));
            let mut command = Command::new("sleep");
            command.arg("1");
            command
        };
        let recordings = recordings(folder.path(), slow);
        let all: Vec<_> = (0..4)
            .map(|k| {
                let recordings = Arc::clone(&recordings);
                std::thread::spawn(move || recordings.start(&order(&format!("run-{k}")), || Ok(())))
            })
            .collect();
        let outcomes: Vec<_> = all.into_iter().map(|start| start.join().unwrap()).collect();
        assert_eq!(outcomes.iter().filter(|outcome| outcome.is_ok()).count(), 1, "{outcomes:?}");
        let refused = outcomes.iter().filter_map(|outcome| outcome.as_ref().err());
        assert!(refused.into_iter().all(|refused| refused.text.contains("is being recorded")), "{outcomes:?}");
        assert_eq!(files(folder.path()).len(), 2);
    }

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
