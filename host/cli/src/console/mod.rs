//! The console: sends typed lines to the board, with line editing, history and completion.

mod completion;
mod pump;

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

use crate::ui::Ui;
use crate::{failure, interrupt, port, state_folder};
use completion::{CommandHelper, LocalCommand};
use darm_arm::table_file::TableFile;
use pump::{Pump, Show};

/// Longest wait for a lost port.
const REOPEN_TIMEOUT: Duration = Duration::from_secs(10);
/// First characters of the board's answer to a refused line.
const REFUSED: &str = "? ";
/// Number of lines of history.
const HISTORY: usize = 1000;

/// Runs until the user leaves or the port is lost.
pub(crate) fn run(port: &str, ui: Ui) -> anyhow::Result<()> {
    if std::io::stdin().is_terminal() && !ui.json { interactive(port, ui) } else { scripted(port, ui) }
}

/// One console on one port.
struct Session<'a> {
    port: &'a str,
    ui: Ui,
    pump: Pump,
    /// Stops the board while a command waits for an answer.
    interrupt: interrupt::InterruptHandler,
    handle: StopHandle,
}

/// Whether to continue.
#[derive(PartialEq, Eq)]
enum Next {
    On,
    Leave,
}

fn interactive(port: &str, ui: Ui) -> anyhow::Result<()> {
    let config = Config::builder().max_history_size(HISTORY)?.auto_add_history(true).build();
    let mut editor: Editor<CommandHelper, DefaultHistory> = Editor::with_config(config)?;
    editor.set_helper(Some(CommandHelper::default()));
    let history = history_file();
    if let Some(file) = &history {
        // The file does not exist before the first use.
        let _ = editor.load_history(file);
    }
    let mut printer = editor.create_external_printer()?;
    // A closed terminal is no error.
    let show: Show = Box::new(move |line| drop(printer.print(format!("{line}\n"))));
    let mut session = Session::start(port, ui, show)?;
    println!("{port}; `help` lists the commands of the board; this console adds `upload FILE` and `quit`");
    session.pump.ask("id");
    loop {
        match editor.readline("> ") {
            Ok(line) if session.execute_line(line.trim())? == Next::On => {}
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

/// Without a terminal: sends each line after the answer to the previous one.
fn scripted(port: &str, ui: Ui) -> anyhow::Result<()> {
    let refused = Arc::new(AtomicUsize::new(0));
    let count = refused.clone();
    let show: Show = Box::new(move |line| {
        if line.starts_with(REFUSED) {
            count.fetch_add(1, Ordering::Relaxed);
        }
        print_line(line, ui);
    });
    let mut session = Session::start(port, ui, show)?;
    for line in std::io::stdin().lock().lines() {
        if session.execute_line(line.context("reading the standard input")?.trim())? == Next::Leave {
            break;
        }
    }
    session.pump.stop()?;
    match refused.load(Ordering::Relaxed) {
        0 => Ok(()),
        lines => Err(Refused(lines).into()),
    }
}

/// Number of lines that the board refused.
#[derive(Debug, thiserror::Error)]
#[error("the board refused {0} of the lines; see the answers that begin with `?`")]
struct Refused(usize);

/// Prints a line of the board on standard output.
fn print_line(line: &str, ui: Ui) {
    let text = if ui.json { serde_json::json!({ "line": line }).to_string() } else { line.to_owned() };
    // A closed pipe is no error.
    let _ = writeln!(std::io::stdout(), "{text}");
}

impl<'a> Session<'a> {
    fn start(port: &'a str, ui: Ui, show: Show) -> anyhow::Result<Self> {
        let mut pump = Pump::new(show);
        let (link, handle) = port::open_free(port)?;
        pump.start(link);
        let interrupt = interrupt::InterruptHandler::start(port, handle.clone())?;
        Ok(Self { port, ui, pump, interrupt, handle })
    }

    /// Starts on the port that was opened again.
    fn start_again(&mut self, (link, handle): (Box<dyn Link>, StopHandle)) {
        self.interrupt.use_handle(handle.clone());
        self.handle = handle;
        self.pump.start(link);
    }

    /// Switches all coils off at once, even during an answer of the board; returns the result.
    fn stop(&self) -> String {
        match self.handle.stop(STOP_BOUND) {
            Ok(Confirmation::Confirmed) => "all coils are off".to_owned(),
            Ok(Confirmation::Missing) => {
                "the stop was sent, but the board did not confirm it within 1 s; switch off the arm's supply".to_owned()
            }
            Err(error) => format!("the stop could not be sent: {error}"),
        }
    }

    fn execute_line(&mut self, line: &str) -> anyhow::Result<Next> {
        match completion::local(line) {
            Some(LocalCommand::Quit) => return Ok(Next::Leave),
            Some(LocalCommand::UploadWithoutFile) => {
                self.ui.note("upload needs a file: `upload TABLE.darm`, made by `darm table`")
            }
            Some(LocalCommand::Upload(file)) => self.upload(Path::new(file))?,
            None if line.is_empty() => {}
            None if line == "stop" => {
                let stopped = self.stop();
                if !self.pump.ask(line) {
                    self.ui.note(&stopped);
                }
            }
            None if !self.pump.ask(line) && !self.pump.is_lost() => {
                self.ui.note("no answer; check that this is the port of a running board: `darm doctor`");
            }
            None => {}
        }
        if self.pump.is_lost() {
            self.reopen()?;
        }
        Ok(Next::On)
    }

    /// The port was lost, for example because the cable was unplugged: waits until it can be opened again.
    fn reopen(&mut self) -> anyhow::Result<()> {
        if let Err(error) = self.pump.stop() {
            self.ui.note(&error.to_string());
        }
        let since = Instant::now();
        loop {
            match port::open(self.port) {
                Ok(opened) => {
                    self.start_again(opened);
                    self.ui.note(&format!("{} is open again", self.port));
                    return Ok(());
                }
                Err(error) if since.elapsed() > REOPEN_TIMEOUT => return Err(error.into()),
                Err(_) => std::thread::sleep(REOPEN_TIMEOUT / 50),
            }
        }
    }

    /// Uploads a table over this port. A table that the board refuses does not end the console.
    fn upload(&mut self, file: &Path) -> anyhow::Result<()> {
        let table = match TableFile::read(file) {
            Ok(table) => table,
            Err(error) => {
                self.ui.note(&error.to_string());
                return Ok(());
            }
        };
        self.pump.stop()?;
        match self.upload_table(&table) {
            Ok(text) => self.ui.note(&text),
            Err(error) => self.ui.note(&failure::sentence(&error)),
        }
        self.start_again(port::open(self.port)?);
        Ok(())
    }

    fn upload_table(&self, file: &TableFile) -> anyhow::Result<String> {
        let (link, handle) = port::open(self.port)?;
        self.interrupt.use_handle(handle);
        let mut client = Client::connect(link)?;
        file.check_device(client.identity().device)?;
        let bar = self.ui.progress_bar("uploading", u64::from(file.image.image().len), "bytes");
        let rows = client.upload(&file.image, &mut |progress| bar.set_position(u64::from(progress.done)))?;
        bar.finish_and_clear();
        Ok(format!("{rows} rows stored; run them with `play`"))
    }
}

/// File of the history.
fn history_file() -> Option<PathBuf> {
    state_folder::path().map(|folder| folder.join("history"))
}

/// A history that cannot be saved is no error.
fn save_history(editor: &mut Editor<CommandHelper, DefaultHistory>, file: &Path) {
    if file.parent().is_some_and(|folder| std::fs::create_dir_all(folder).is_ok()) {
        let _ = editor.save_history(file);
    }
}
