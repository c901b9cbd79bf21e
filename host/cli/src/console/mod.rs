//! The console: sends typed lines to the board, with a status line, line editing, history, completion and help.

mod board_state;
mod commands;
mod completion;
mod pump;

use std::io::{BufRead as _, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use darm_core::sequencer::Phase;
use darm_device::client::Client;
use darm_device::client::stop::{STOP_BOUND, StopHandle};
use darm_device::link::{Link, LinkError};
use rustyline::error::ReadlineError;
use rustyline::history::DefaultHistory;
use rustyline::{Config, Editor, ExternalPrinter as _};

use crate::failure::{NoAnswer, Refused, Usage};
use crate::guests::Role;
use crate::ui::Ui;
use crate::{failure, interrupt, port, state_folder};
use board_state::Shared;
use completion::{CommandHelper, LocalCommand};
use darm_arm::table_file::TableFile;
use pump::{Port, Pump, Show};

/// Longest wait for a lost port.
const REOPEN_TIMEOUT: Duration = Duration::from_secs(10);
/// First characters of the board's answer to a refused line.
const REFUSED: &str = "? ";
/// Width of the text of `help COMMAND`, with its margin as wide as a narrow terminal.
const HELP_WIDTH: usize = 76;
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
    /// Whether the state of the board is requested.
    asks: bool,
    pump: Pump,
    /// Stops the board while a command waits for an answer.
    interrupt: interrupt::InterruptHandler,
    handle: StopHandle,
    /// What the board reported last; nothing in a script.
    board: Shared,
    /// Lines that the board has refused.
    refused: Arc<AtomicUsize>,
    /// The first line that failed otherwise; it decides the exit code of a script.
    failed: Option<anyhow::Error>,
}

/// Whether to continue.
#[derive(PartialEq, Eq)]
enum Next {
    On,
    Leave,
}

fn interactive(port: &str, ui: Ui) -> anyhow::Result<()> {
    let board = Shared::default();
    let config = Config::builder().max_history_size(HISTORY)?.auto_add_history(true).build();
    let mut editor: Editor<CommandHelper, DefaultHistory> = Editor::with_config(config)?;
    editor.set_helper(Some(CommandHelper::new(board.clone())));
    let history = history_file();
    if let Some(file) = &history {
        // The file does not exist before the first use.
        let _ = editor.load_history(file);
    }
    let mut printer = editor.create_external_printer()?;
    // A closed terminal is no error.
    let show: Show = Box::new(move |line| drop(printer.print(format!("{line}\n"))));
    let mut session = Session::start(port, ui, show, Some(board.clone()))?;
    println!("{port}; `help` lists the commands, `help COMMAND` explains one, Tab completes, `quit` leaves");
    session.pump.ask("id");
    loop {
        session.pump.look();
        match editor.readline(&board.prompt()) {
            Ok(lines) if session.execute(&lines)? == Next::On => {}
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

/// Without a terminal: sends each line after the answer to the previous one. The first line that fails otherwise than by a
/// refusal decides the exit code, else refusals do; the lines behind it are sent all the same.
fn scripted(port: &str, ui: Ui) -> anyhow::Result<()> {
    let mut session = Session::start(port, ui, Box::new(move |line| print_line(line, ui)), None)?;
    for line in std::io::stdin().lock().lines() {
        if session.execute_line(line.context("reading the standard input")?.trim())? == Next::Leave {
            break;
        }
    }
    session.pump.stop()?;
    match (session.failed, session.refused.load(Ordering::Relaxed)) {
        (Some(error), _) => Err(error),
        (None, 0) => Ok(()),
        (None, lines) => Err(Refused(lines).into()),
    }
}

/// Prints a line of the board on standard output.
fn print_line(line: &str, ui: Ui) {
    let text = if ui.json { serde_json::json!({ "line": line }).to_string() } else { line.to_owned() };
    // A closed pipe is no error.
    let _ = writeln!(std::io::stdout(), "{text}");
}

impl<'a> Session<'a> {
    /// Opens the port; with `board` the state of the board is requested too.
    fn start(port: &'a str, ui: Ui, mut show: Show, board: Option<Shared>) -> anyhow::Result<Self> {
        let refused = Arc::new(AtomicUsize::new(0));
        let count = refused.clone();
        let counted: Show = Box::new(move |line| {
            if line.starts_with(REFUSED) {
                count.fetch_add(1, Ordering::Relaxed);
            }
            show(line);
        });
        let asks = board.is_some();
        let board = board.unwrap_or_default();
        let mut pump = Pump::new(counted, board.clone());
        let (link, handle) = port::open_free(port)?;
        let (open, handle) = if asks { with_board(port, link, handle)? } else { (Port::Text(link), handle) };
        pump.start(open);
        let interrupt = interrupt::InterruptHandler::start(port, handle.clone())?;
        Ok(Self { port, ui, asks, pump, interrupt, handle, board, refused, failed: None })
    }

    /// Starts on the port that was opened again.
    fn start_again(&mut self, (link, handle): (Box<dyn Link>, StopHandle)) -> anyhow::Result<()> {
        let (open, handle) = if self.asks { with_board(self.port, link, handle)? } else { (Port::Text(link), handle) };
        self.interrupt.use_handle(handle.clone());
        self.handle = handle;
        self.pump.start(open);
        Ok(())
    }

    /// Switches all coils off at once, even during an answer of the board; returns the result.
    fn stop(&self) -> String {
        match self.handle.stop(STOP_BOUND) {
            Ok(confirmation) => confirmation.text().to_owned(),
            Err(error) => format!("the stop could not be sent: {error}"),
        }
    }

    /// Executes lines in turn: a paste has several.
    fn execute(&mut self, lines: &str) -> anyhow::Result<Next> {
        for line in lines.split('\n') {
            if self.execute_line(line.trim())? == Next::Leave {
                return Ok(Next::Leave);
            }
        }
        Ok(Next::On)
    }

    fn execute_line(&mut self, line: &str) -> anyhow::Result<Next> {
        match completion::local(line) {
            Some(LocalCommand::Quit) => return Ok(Next::Leave),
            Some(LocalCommand::UploadWithoutFile) => {
                self.fail(Usage("upload needs a file: `upload TABLE.darm`, made by `darm table`".to_owned()).into());
            }
            Some(LocalCommand::Upload(file)) => self.upload(Path::new(file))?,
            Some(LocalCommand::Help(command)) => self.help(command),
            None if line.is_empty() => {}
            None if line == "stop" => {
                let stopped = self.stop();
                if !self.pump.ask(line) {
                    self.ui.note(&stopped);
                }
            }
            None => self.ask(line),
        }
        if self.pump.is_lost() {
            self.reopen()?;
        }
        Ok(Next::On)
    }

    /// Sends a line to the board; where it is refused, says what is allowed.
    fn ask(&mut self, line: &str) {
        let before = self.refused.load(Ordering::Relaxed);
        if !self.pump.ask(line) && !self.pump.is_lost() {
            return self.fail(NoAnswer.into());
        }
        if line == "help" {
            for (command, summary) in commands::local() {
                let usage = format!("{} {}", command.name, command.arguments);
                print_line(&format!("{usage:<16} {summary} (this console)"), self.ui);
            }
        }
        if self.asks && self.refused.load(Ordering::Relaxed) > before {
            self.pump.look();
            self.explain(line);
        }
    }

    /// What is allowed in place of a line that was refused.
    fn explain(&self, line: &str) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let board = self.board.get();
        if let Some(allowed) = board.as_ref().and_then(|board| board.allowed(&words)) {
            self.ui.note(&format!("  {allowed}"));
        }
        if let Some(Phase::Safe(fault)) = board.map(|board| board.status.phase) {
            self.ui.note(&format!("  the fault: {fault}; remove its cause, then `clear`"));
        }
        let command = words.first().copied().unwrap_or_default();
        if let (None, Some(meant)) = (commands::find(command), commands::similar(command)) {
            self.ui.note(&format!("  did you mean `{}`?", meant.name));
        }
    }

    /// Explains a command, with the values that are allowed now.
    fn help(&mut self, command: &str) {
        let Some(found) = commands::find(command) else {
            let meant = commands::similar(command).map_or(String::new(), |it| format!("; did you mean `{}`?", it.name));
            return self.fail(Usage(format!("no command {command}; `help` lists them{meant}")).into());
        };
        let usage = format!("{} {}", found.name, found.arguments);
        print_line(usage.trim_end(), self.ui);
        let allowed = self.board.get().and_then(|board| board.allowed(&[found.name]));
        let now = allowed.map(|allowed| format!("Now: {allowed}."));
        for paragraph in [found.help].into_iter().chain(now.as_deref()) {
            wrapped(paragraph, HELP_WIDTH).iter().for_each(|line| print_line(&format!("  {line}"), self.ui));
        }
    }

    /// A line that failed does not end the console.
    fn fail(&mut self, error: anyhow::Error) {
        self.ui.note(&failure::sentence(&error));
        self.failed.get_or_insert(error);
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
                    self.start_again(opened)?;
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
                self.fail(error.into());
                return Ok(());
            }
        };
        self.pump.stop()?;
        match self.upload_table(&table) {
            Ok(text) => self.ui.note(&text),
            Err(error) => self.fail(error),
        }
        self.start_again(port::open(self.port)?)
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

/// A text in lines of at most `width` characters, where its words are not longer.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Connects to the board at an open port. One that does not answer frames, such as a board whose firmware crashed again and
/// again, is typed to all the same.
fn with_board(port: &str, link: Box<dyn Link>, handle: StopHandle) -> Result<(Port, StopHandle), LinkError> {
    match Client::connect(link) {
        Ok(client) if client.hello().is_some() => {
            port::share(&client, &handle, Role::Controls);
            Ok((Port::Board(Box::new(client), handle.clone()), handle))
        }
        Ok(_) | Err(_) => port::open(port).map(|(link, handle)| (Port::Text(link), handle)),
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
