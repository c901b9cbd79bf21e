//! Questions to the person at the terminal: asked on standard error, answered on standard input.

use std::io::{BufRead as _, IsTerminal as _, Write as _};

/// Asks; the answer in lower case, `None` at the end of the input.
pub(crate) fn ask(question: &str) -> Option<String> {
    eprint!("{question} > ");
    let _ = std::io::stderr().flush();
    let mut line = String::new();
    let count = std::io::stdin().lock().read_line(&mut line).unwrap_or(0);
    (count > 0).then(|| line.trim().to_lowercase())
}

/// Whether a person can see a question and answer it.
pub(crate) fn is_possible() -> bool {
    std::io::stdin().is_terminal() && std::io::stderr().is_terminal()
}
