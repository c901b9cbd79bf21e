//! How a command speaks: text for people, JSON for programs, progress on the terminal.

use std::io::{IsTerminal as _, Write as _};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

/// What a command has to say: its fields for programs, its text for people.
pub(crate) trait Answer: Serialize {
    /// Lines for people, with units, without a line end after the last.
    fn text(&self) -> String;
}

/// The way to speak that the user chose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Voice {
    /// JSON on the standard output, one object a line; nothing else there.
    pub(crate) json: bool,
}

impl Voice {
    /// Says the answer on the standard output. A reader that has gone away is no error.
    pub(crate) fn tell(self, answer: &impl Answer) -> anyhow::Result<()> {
        let said = if self.json { serde_json::to_string(answer)? } else { answer.text() };
        if !said.is_empty() {
            let mut out = std::io::stdout().lock();
            let _ = writeln!(out, "{said}").and_then(|()| out.flush());
        }
        Ok(())
    }

    /// Says by the way what happens, on the standard error, to people only.
    pub(crate) fn note(self, text: &str) {
        if !self.json {
            eprintln!("{text}");
        }
    }

    /// A bar that fills, hidden where nobody sees it.
    pub(crate) fn bar(self, doing: &str, length: u64, unit: &str) -> ProgressBar {
        let style = format!("{{msg}} [{{bar:32}}] {{pos}}/{{len}} {unit} {{elapsed_precise}}");
        self.progress(ProgressBar::new(length), &style, doing)
    }

    /// A wheel that turns while something of unknown length lasts.
    pub(crate) fn wheel(self, doing: &str) -> ProgressBar {
        let wheel = self.progress(ProgressBar::no_length(), "{spinner} {msg} {elapsed_precise}", doing);
        wheel.enable_steady_tick(Duration::from_millis(100));
        wheel
    }

    fn progress(self, bar: ProgressBar, style: &str, doing: &str) -> ProgressBar {
        if self.json || !std::io::stderr().is_terminal() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        if let Ok(style) = ProgressStyle::with_template(style) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.with_message(doing.to_owned())
    }
}
