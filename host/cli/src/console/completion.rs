//! The words of the console: completion, hints, and the ones that the console itself understands.

use rustyline::completion::{Completer, FilenameCompleter, Pair};
use rustyline::error::ReadlineError;
use rustyline::highlight::Highlighter;
use rustyline::hint::Hinter;
use rustyline::validate::Validator;
use rustyline::{Context, Helper};

/// What the board understands: the word and what follows it.
pub(crate) const BOARD: &[(&str, &str)] = &[
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

/// What the console itself understands.
pub(crate) const LOCAL: &[(&str, &str)] = &[("quit", ""), ("upload", "TABLE.darm")];

/// A line that the console does itself.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Local<'a> {
    /// Leave.
    Quit,
    /// Bring this table to the board.
    Upload(&'a str),
    /// `upload` without a file.
    UploadWhat,
}

/// The line as the console understands it; `None` when it is for the board.
pub(crate) fn local(line: &str) -> Option<Local<'_>> {
    let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
    match (word, rest.trim()) {
        ("quit" | "exit", "") => Some(Local::Quit),
        ("upload", "") => Some(Local::UploadWhat),
        ("upload", file) => Some(Local::Upload(file)),
        _ => None,
    }
}

/// Completes and hints while a line is edited.
#[derive(Default)]
pub(crate) struct Words {
    files: FilenameCompleter,
}

fn all() -> impl Iterator<Item = &'static (&'static str, &'static str)> {
    BOARD.iter().chain(LOCAL)
}

impl Completer for Words {
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

impl Hinter for Words {
    type Hint = String;

    /// What is still to be typed, once the word is whole.
    fn hint(&self, line: &str, at: usize, _: &Context<'_>) -> Option<String> {
        let word = line.strip_suffix(' ').unwrap_or(line);
        let (_, arguments) = all().find(|(known, arguments)| *known == word && !arguments.is_empty())?;
        let gap = if line.ends_with(' ') { "" } else { " " };
        (at == line.len()).then(|| format!("{gap}{arguments}"))
    }
}

impl Highlighter for Words {
    fn highlight_hint<'h>(&self, hint: &'h str) -> std::borrow::Cow<'h, str> {
        format!("\x1b[2m{hint}\x1b[0m").into()
    }
}
impl Validator for Words {}
impl Helper for Words {}

#[cfg(test)]
mod tests {
    use rustyline::Context;
    use rustyline::completion::Completer as _;
    use rustyline::hint::Hinter as _;
    use rustyline::history::DefaultHistory;

    use super::{Local, Words, local};

    fn completions(line: &str) -> Vec<String> {
        let history = DefaultHistory::new();
        let (_, pairs) = Words::default().complete(line, line.len(), &Context::new(&history)).unwrap();
        pairs.into_iter().map(|pair| pair.replacement).collect()
    }

    #[test]
    fn words_are_completed_ready_for_their_arguments() {
        assert_eq!(completions("st"), ["status", "stop"]);
        assert_eq!(completions("co"), ["coil "]);
        assert_eq!(completions("dance"), [""; 0]);
    }

    #[test]
    fn a_hint_tells_what_follows() {
        let history = DefaultHistory::new();
        let hint = |line: &str| Words::default().hint(line, line.len(), &Context::new(&history));
        assert_eq!(hint("coil").as_deref(), Some(" N on MS"));
        assert_eq!(hint("servo ").as_deref(), Some("N DEG"));
        assert_eq!(hint("status"), None);
    }

    #[test]
    fn only_its_own_words_stay_in_the_console() {
        assert_eq!(local("quit"), Some(Local::Quit));
        assert_eq!(local("upload a b.darm"), Some(Local::Upload("a b.darm")));
        assert_eq!(local("upload"), Some(Local::UploadWhat));
        assert_eq!(local("status"), None);
    }
}
