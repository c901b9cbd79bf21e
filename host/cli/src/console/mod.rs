//! The console: a person types the board's own words, with line editing, history and completion.

mod pump;
mod words;

use std::io::{BufRead as _, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use darm_device::client::Client;
use darm_device::client::stop::{Confirmation, STOP_BOUND, StopHandle};
use darm_device::link::Link;
use rustyline::error::ReadlineError;
use rustyline::history::DefaultHistory;
use rustyline::{Config, Editor, ExternalPrinter as _};

use crate::commands::table_file::TableFile;
use crate::voice::Voice;
use crate::{failure, interrupt, port, state_folder};
use pump::{Pump, Show};
use words::{Local, Words};

/// How long a lost port is waited for.
const COMES_BACK: Duration = Duration::from_secs(10);
/// How the board's answer to a line begins that it does not do.
const REFUSED: &str = "? ";
/// Lines of history that are kept.
const HISTORY: usize = 1000;

/// Runs until the user leaves or the port is lost.
pub(crate) fn run(port: &str, voice: Voice) -> anyhow::Result<()> {
    if std::io::stdin().is_terminal() && !voice.json { by_hand(port, voice) } else { by_script(port, voice) }
}

/// One console on one port.
struct Session<'a> {
    port: &'a str,
    voice: Voice,
    pump: Pump,
    /// Stops the board while a command waits for its answer.
    interrupt: interrupt::Watch,
    handle: StopHandle,
}

/// Whether to go on.
#[derive(PartialEq, Eq)]
enum Next {
    On,
    Leave,
}

fn by_hand(port: &str, voice: Voice) -> anyhow::Result<()> {
    let config = Config::builder().max_history_size(HISTORY)?.auto_add_history(true).build();
    let mut editor: Editor<Words, DefaultHistory> = Editor::with_config(config)?;
    editor.set_helper(Some(Words::default()));
    let history = history_file();
    if let Some(file) = &history {
        // There is none before the first time.
        let _ = editor.load_history(file);
    }
    let mut printer = editor.create_external_printer()?;
    // A terminal that is gone cannot be told so.
    let show: Show = Box::new(move |line| drop(printer.print(format!("{line}\n"))));
    let mut session = Session::start(port, voice, show)?;
    println!("{port}; `help` lists the board's words, `upload FILE` and `quit` are this console's");
    session.pump.ask("id");
    loop {
        match editor.readline("> ") {
            Ok(line) if session.obey(line.trim())? == Next::On => {}
            Ok(_) | Err(ReadlineError::Eof) => break,
            Err(ReadlineError::Interrupted) => println!("{}; `quit` or Ctrl-D leaves", session.stop()),
            Err(error) => return Err(error.into()),
        }
    }
    if let Some(file) = history {
        save_history(&mut editor, &file);
    }
    session.pump.stop().map_err(Into::into)
}

/// Without a terminal: one line after the other, each after the answer to the one before.
fn by_script(port: &str, voice: Voice) -> anyhow::Result<()> {
    let refused = Arc::new(AtomicUsize::new(0));
    let count = refused.clone();
    let show: Show = Box::new(move |line| {
        if line.starts_with(REFUSED) {
            count.fetch_add(1, Ordering::Relaxed);
        }
        say(line, voice);
    });
    let mut session = Session::start(port, voice, show)?;
    for line in std::io::stdin().lock().lines() {
        if session.obey(line.context("reading the standard input")?.trim())? == Next::Leave {
            break;
        }
    }
    session.pump.stop()?;
    match refused.load(Ordering::Relaxed) {
        0 => Ok(()),
        lines => Err(Refused(lines).into()),
    }
}

/// Lines of a script that the board has not done.
#[derive(Debug, thiserror::Error)]
#[error("the board refused {0} of the lines; its answers to them begin with `?`")]
struct Refused(usize);

/// A line of the board on the standard output.
fn say(line: &str, voice: Voice) {
    let said = if voice.json { serde_json::json!({ "line": line }).to_string() } else { line.to_owned() };
    // Nobody listens any more: there is nobody to tell.
    let _ = writeln!(std::io::stdout(), "{said}");
}

impl<'a> Session<'a> {
    fn start(port: &'a str, voice: Voice, show: Show) -> anyhow::Result<Self> {
        let mut pump = Pump::new(show);
        let (link, handle) = port::open(port)?;
        pump.start(link);
        let interrupt = interrupt::Watch::start(port, handle.clone())?;
        Ok(Self { port, voice, pump, interrupt, handle })
    }

    /// Starts on the port that was opened again.
    fn start_again(&mut self, (link, handle): (Box<dyn Link>, StopHandle)) {
        self.interrupt.use_handle(handle.clone());
        self.handle = handle;
        self.pump.start(link);
    }

    /// All coils off at once, past whatever the board is answering; what came of it.
    fn stop(&self) -> String {
        match self.handle.stop(STOP_BOUND) {
            Ok(Confirmation::Confirmed) => "all coils are off".to_owned(),
            Ok(Confirmation::Missing) => {
                "the stop was sent, but the board did not confirm it within 1 s; switch the arm's supply off".to_owned()
            }
            Err(error) => format!("the stop could not be sent: {error}"),
        }
    }

    fn obey(&mut self, line: &str) -> anyhow::Result<Next> {
        match words::local(line) {
            Some(Local::Quit) => return Ok(Next::Leave),
            Some(Local::UploadWhat) => self.voice.note("upload what? `upload TABLE.darm`, a file made by `darm table`"),
            Some(Local::Upload(file)) => self.upload(Path::new(file))?,
            None if line.is_empty() => {}
            None if line == "stop" => {
                let stopped = self.stop();
                if !self.pump.ask(line) {
                    self.voice.note(&stopped);
                }
            }
            None if !self.pump.ask(line) && !self.pump.is_lost() => {
                self.voice.note("no answer; is this the board's port, is the board running? `darm doctor` looks");
            }
            None => {}
        }
        if self.pump.is_lost() {
            self.reopen()?;
        }
        Ok(Next::On)
    }

    /// The port was lost, as when the cable was pulled: waits for it to come back.
    fn reopen(&mut self) -> anyhow::Result<()> {
        if let Err(error) = self.pump.stop() {
            self.voice.note(&error.to_string());
        }
        let since = Instant::now();
        loop {
            match port::open(self.port) {
                Ok(opened) => {
                    self.start_again(opened);
                    self.voice.note(&format!("{} is open again", self.port));
                    return Ok(());
                }
                Err(error) if since.elapsed() > COMES_BACK => return Err(error.into()),
                Err(_) => std::thread::sleep(COMES_BACK / 50),
            }
        }
    }

    /// Lends the port to an upload. A table that the board refuses does not end the console.
    fn upload(&mut self, file: &Path) -> anyhow::Result<()> {
        let table = match TableFile::read(file) {
            Ok(table) => table,
            Err(error) => {
                self.voice.note(&error.to_string());
                return Ok(());
            }
        };
        self.pump.stop()?;
        match self.upload_table(&table) {
            Ok(said) => self.voice.note(&said),
            Err(error) => self.voice.note(&failure::sentence(&error)),
        }
        self.start_again(port::open(self.port)?);
        Ok(())
    }

    fn upload_table(&self, file: &TableFile) -> anyhow::Result<String> {
        let (link, handle) = port::open(self.port)?;
        self.interrupt.use_handle(handle);
        let mut client = Client::connect(link)?;
        file.check_device(client.identity().device)?;
        let bar = self.voice.bar("uploading", u64::from(file.image.image().len), "bytes");
        let rows = client.upload(&file.image, &mut |progress| bar.set_position(u64::from(progress.done)))?;
        bar.finish_and_clear();
        Ok(format!("{rows} rows stored; `play` runs them"))
    }
}

/// Lines typed earlier.
fn history_file() -> Option<PathBuf> {
    state_folder::path().map(|folder| folder.join("history"))
}

/// A history that cannot be kept is not worth an error.
fn save_history(editor: &mut Editor<Words, DefaultHistory>, file: &Path) {
    if file.parent().is_some_and(|folder| std::fs::create_dir_all(folder).is_ok()) {
        let _ = editor.save_history(file);
    }
}
