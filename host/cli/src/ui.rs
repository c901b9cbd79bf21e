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

/// A number with so many decimals, in figures of its own where these would hide it; rounding about zero is zero.
pub(crate) fn number(value: f64, decimals: usize) -> String {
    let least = 0.5 * 10f64.powi(-(decimals as i32));
    if value.abs() < 1e-12 {
        format!("{:.decimals$}", 0.0)
    } else if value.abs() < least {
        format!("{value:.1e}")
    } else {
        format!("{value:.decimals$}")
    }
}

/// Rows of cells in columns as wide as their widest cell; empty cells of the first row leave their column without a head.
pub(crate) fn columns(rows: &[Vec<String>]) -> String {
    let count = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max();
    let widths: Vec<usize> = (0..count).map(|column| width(column).unwrap_or(0)).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::{columns, number};

    #[test]
    fn columns_are_as_wide_as_their_widest_cell_and_numbers_show_what_they_are() {
        let row = |cells: [&str; 2]| cells.map(str::to_owned).to_vec();
        assert_eq!(number(-1e-17, 3), "0.000");
        assert_eq!((number(-1.2345, 3), number(4.56e-5, 3)), ("-1.234".to_owned(), "4.6e-5".to_owned()));
        assert_eq!(columns(&[row(["a", "b"]), row(["long", ""]), row(["µm", "c"])]), "a     b\nlong\nµm    c");
    }
}
