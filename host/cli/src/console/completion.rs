//! Completion, hints and the status line of the console, and the lines that the console itself runs.

use std::borrow::Cow;

use rustyline::completion::{Completer, FilenameCompleter, Pair};
use rustyline::error::ReadlineError;
use rustyline::highlight::Highlighter;
use rustyline::hint::Hinter;
use rustyline::validate::Validator;
use rustyline::{Context, Helper};

use super::board_state::Shared;
use super::commands::{COMMANDS, find};

/// A line that the console runs itself.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum LocalCommand<'a> {
    /// End the console.
    Quit,
    /// Upload this table.
    Upload(&'a str),
    /// `upload` without a file.
    UploadWithoutFile,
    /// Explain this command.
    Help(&'a str),
}

/// Parses a command of the console; `None` for a line for the board.
pub(crate) fn local(line: &str) -> Option<LocalCommand<'_>> {
    let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
    match (word, rest.trim()) {
        ("quit" | "exit", "") => Some(LocalCommand::Quit),
        ("upload", "") => Some(LocalCommand::UploadWithoutFile),
        ("upload", file) => Some(LocalCommand::Upload(file)),
        ("help", command) if !command.is_empty() => Some(LocalCommand::Help(command)),
        _ => None,
    }
}

/// Completes and hints while a line is edited.
#[derive(Default)]
pub(crate) struct CommandHelper {
    files: FilenameCompleter,
    board: Shared,
}

impl CommandHelper {
    /// Completes with the values of this board.
    pub(crate) fn new(board: Shared) -> Self {
        Self { files: FilenameCompleter::default(), board }
    }

    /// What may follow these words of a line.
    fn candidates(&self, words: &[&str]) -> Vec<String> {
        match words {
            [] | ["help"] => COMMANDS.iter().map(|command| command.name.to_owned()).collect(),
            ["reboot"] => vec!["loader".to_owned()],
            _ => self.board.get().map_or_else(Vec::new, |board| board.values(words)),
        }
    }
}

/// A candidate, with a space behind it where more words follow.
fn pair(words: &[&str], value: String) -> Pair {
    let has_more = match words {
        [] => find(&value).is_some_and(|command| !command.arguments.is_empty() && command.name != "reboot"),
        ["coil"] | ["servo"] => true,
        ["coil", _] => value == "on",
        _ => false,
    };
    let replacement = if has_more { format!("{value} ") } else { value.clone() };
    Pair { display: value, replacement }
}

impl Completer for CommandHelper {
    type Candidate = Pair;

    fn complete(&self, line: &str, at: usize, context: &Context<'_>) -> Result<(usize, Vec<Pair>), ReadlineError> {
        let typed = line.get(..at).unwrap_or_default();
        if typed.starts_with("upload ") {
            let (start, files) = self.files.complete(line, at, context)?;
            let is_table = |file: &Pair| file.replacement.ends_with(".darm") || file.replacement.ends_with('/');
            return Ok((start, files.into_iter().filter(is_table).collect()));
        }
        let start = typed.rfind(' ').map_or(0, |space| space + 1);
        let (before, begun) = typed.split_at(start);
        let words: Vec<&str> = before.split_whitespace().collect();
        let fitting = self.candidates(&words).into_iter().filter(|value| value.starts_with(begun));
        Ok((start, fitting.map(|value| pair(&words, value)).collect()))
    }
}

impl Hinter for CommandHelper {
    type Hint = String;

    /// The arguments that follow a complete command.
    fn hint(&self, line: &str, at: usize, _: &Context<'_>) -> Option<String> {
        let word = line.strip_suffix(' ').unwrap_or(line);
        let command = find(word).filter(|command| !command.arguments.is_empty())?;
        let gap = if line.ends_with(' ') { "" } else { " " };
        (at == line.len()).then(|| format!("{gap}{}", command.arguments))
    }
}

impl Highlighter for CommandHelper {
    /// The state of now in place of that from before the line was begun; not in prompts of the editor itself, as that of a search.
    /// The editor counts on the place where the prompt ends: a line before it stays a line.
    fn highlight_prompt<'b, 's: 'b, 'p: 'b>(&'s self, prompt: &'p str, is_own: bool) -> Cow<'b, str> {
        let now = self.board.prompt();
        if is_own && now.lines().count() == prompt.lines().count() { now.into() } else { prompt.into() }
    }

    fn highlight_hint<'h>(&self, hint: &'h str) -> Cow<'h, str> {
        format!("\x1b[2m{hint}\x1b[0m").into()
    }
}
impl Validator for CommandHelper {}
impl Helper for CommandHelper {}

#[cfg(test)]
mod tests {
    use darm_core::sequencer::Phase;
    use darm_core::units::Micros;
    use rustyline::Context;
    use rustyline::completion::Completer as _;
    use rustyline::highlight::Highlighter as _;
    use rustyline::hint::Hinter as _;
    use rustyline::history::DefaultHistory;

    use super::super::board_state::{Shared, tests::idle};
    use super::{CommandHelper, LocalCommand, local};

    fn completions(line: &str) -> Vec<String> {
        let history = DefaultHistory::new();
        let board = Shared::default();
        board.set(Some(idle()));
        let (_, pairs) = CommandHelper::new(board).complete(line, line.len(), &Context::new(&history)).unwrap();
        pairs.into_iter().map(|pair| pair.replacement).collect()
    }

    #[test]
    fn commands_are_completed_ready_for_their_arguments() {
        assert_eq!(completions("st"), ["status", "stop"]);
        assert_eq!(completions("co"), ["coil "]);
        assert_eq!(completions("re"), ["reboot"]);
        assert_eq!(completions("dance"), [""; 0]);
    }

    #[test]
    fn values_are_completed_word_by_word() {
        assert_eq!(completions("coil "), ["0 ", "1 ", "4 "]);
        assert_eq!(completions("coil 1 o"), ["off", "on "]);
        assert_eq!(completions("coil 1 on "), ["120"]);
        assert_eq!(completions("word 1"), ["1111"]);
        assert_eq!(completions("help st"), ["status", "stop"]);
        assert_eq!(completions("status "), [""; 0]);
    }

    #[test]
    fn a_hint_shows_the_arguments() {
        let history = DefaultHistory::new();
        let hint = |line: &str| CommandHelper::default().hint(line, line.len(), &Context::new(&history));
        assert_eq!(hint("coil").as_deref(), Some(" N on MS | N off"));
        assert_eq!(hint("servo ").as_deref(), Some("N DEG"));
        assert_eq!(hint("status"), None);
    }

    #[test]
    fn the_prompt_shows_the_state_of_now() {
        let board = Shared::default();
        board.set(Some(idle()));
        let helper = CommandHelper::new(board.clone());
        let at_first = board.prompt();
        let mut playing = idle();
        playing.status.phase = Phase::Playing { started: Micros(0), next: 0 };
        board.set(Some(playing));
        assert_eq!(helper.highlight_prompt(&at_first, true), "[playing 3 rows]\n> ");
        assert_eq!(helper.highlight_prompt("(reverse-i-search)`p':\n", false), "(reverse-i-search)`p':\n");
        board.set(None);
        assert_eq!(helper.highlight_prompt(&at_first, true), at_first);
    }

    #[test]
    fn the_console_runs_only_its_own_commands() {
        assert_eq!(local("quit"), Some(LocalCommand::Quit));
        assert_eq!(local("upload a b.darm"), Some(LocalCommand::Upload("a b.darm")));
        assert_eq!(local("upload"), Some(LocalCommand::UploadWithoutFile));
        assert_eq!(local("help coil"), Some(LocalCommand::Help("coil")));
        assert_eq!(local("help"), None);
        assert_eq!(local("status"), None);
    }
}
