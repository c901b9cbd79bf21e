//! Completion and hints of the console, and the commands that the console itself runs.

use rustyline::completion::{Completer, FilenameCompleter, Pair};
use rustyline::error::ReadlineError;
use rustyline::highlight::Highlighter;
use rustyline::hint::Hinter;
use rustyline::validate::Validator;
use rustyline::{Context, Helper};

/// Commands of the board with their arguments.
pub(crate) const BOARD_COMMANDS: &[(&str, &str)] = &[
    ("clear", ""),
    ("coil", "N on MS"),
    ("fault", ""),
    ("help", ""),
    ("id", ""),
    ("limits", ""),
    ("log", ""),
    ("play", ""),
    ("reboot", ""),
    ("servo", "N DEG"),
    ("status", ""),
    ("stop", ""),
    ("table", ""),
    ("word", "DIGITS"),
];

/// Commands of the console itself.
pub(crate) const LOCAL_COMMANDS: &[(&str, &str)] = &[("quit", ""), ("upload", "TABLE.darm")];

/// A line that the console runs itself.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum LocalCommand<'a> {
    /// End the console.
    Quit,
    /// Upload this table.
    Upload(&'a str),
    /// `upload` without a file.
    UploadWithoutFile,
}

/// Parses a command of the console; `None` for a line for the board.
pub(crate) fn local(line: &str) -> Option<LocalCommand<'_>> {
    let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
    match (word, rest.trim()) {
        ("quit" | "exit", "") => Some(LocalCommand::Quit),
        ("upload", "") => Some(LocalCommand::UploadWithoutFile),
        ("upload", file) => Some(LocalCommand::Upload(file)),
        _ => None,
    }
}

/// Completes and hints while a line is edited.
#[derive(Default)]
pub(crate) struct CommandHelper {
    files: FilenameCompleter,
}

fn all() -> impl Iterator<Item = &'static (&'static str, &'static str)> {
    BOARD_COMMANDS.iter().chain(LOCAL_COMMANDS)
}

impl Completer for CommandHelper {
    type Candidate = Pair;

    fn complete(&self, line: &str, at: usize, context: &Context<'_>) -> Result<(usize, Vec<Pair>), ReadlineError> {
        let typed = line.get(..at).unwrap_or_default();
        if typed.starts_with("upload ") {
            return self.files.complete(line, at, context);
        }
        let fitting = all().filter(|(word, _)| word.starts_with(typed));
        let pair = |&(word, arguments): &(&str, &str)| Pair {
            display: word.to_owned(),
            replacement: if arguments.is_empty() { word.to_owned() } else { format!("{word} ") },
        };
        Ok((0, fitting.map(pair).collect()))
    }
}

impl Hinter for CommandHelper {
    type Hint = String;

    /// The arguments that follow a complete command.
    fn hint(&self, line: &str, at: usize, _: &Context<'_>) -> Option<String> {
        let word = line.strip_suffix(' ').unwrap_or(line);
        let (_, arguments) = all().find(|(known, arguments)| *known == word && !arguments.is_empty())?;
        let gap = if line.ends_with(' ') { "" } else { " " };
        (at == line.len()).then(|| format!("{gap}{arguments}"))
    }
}

impl Highlighter for CommandHelper {
    fn highlight_hint<'h>(&self, hint: &'h str) -> std::borrow::Cow<'h, str> {
        format!("\x1b[2m{hint}\x1b[0m").into()
    }
}
impl Validator for CommandHelper {}
impl Helper for CommandHelper {}

#[cfg(test)]
mod tests {
    use rustyline::Context;
    use rustyline::completion::Completer as _;
    use rustyline::hint::Hinter as _;
    use rustyline::history::DefaultHistory;

    use super::{CommandHelper, LocalCommand, local};

    fn completions(line: &str) -> Vec<String> {
        let history = DefaultHistory::new();
        let (_, pairs) = CommandHelper::default().complete(line, line.len(), &Context::new(&history)).unwrap();
        pairs.into_iter().map(|pair| pair.replacement).collect()
    }

    #[test]
    fn commands_are_completed_ready_for_their_arguments() {
        assert_eq!(completions("st"), ["status", "stop"]);
        assert_eq!(completions("co"), ["coil "]);
        assert_eq!(completions("dance"), [""; 0]);
    }

    #[test]
    fn a_hint_shows_the_arguments() {
        let history = DefaultHistory::new();
        let hint = |line: &str| CommandHelper::default().hint(line, line.len(), &Context::new(&history));
        assert_eq!(hint("coil").as_deref(), Some(" N on MS"));
        assert_eq!(hint("servo ").as_deref(), Some("N DEG"));
        assert_eq!(hint("status"), None);
    }

    #[test]
    fn the_console_runs_only_its_own_commands() {
        assert_eq!(local("quit"), Some(LocalCommand::Quit));
        assert_eq!(local("upload a b.darm"), Some(LocalCommand::Upload("a b.darm")));
        assert_eq!(local("upload"), Some(LocalCommand::UploadWithoutFile));
        assert_eq!(local("status"), None);
    }
}
