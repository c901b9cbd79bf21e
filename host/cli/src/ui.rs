//! Terminal output of a command: text for people, JSON for programs, progress on standard error.

use std::io::{IsTerminal as _, Write as _};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use crate::finite;
use crate::overwrite::Overwrite;

/// Result of a command: its fields as JSON, its text for people.
pub(crate) trait Answer: Serialize {
    /// Lines for people, with units, without a line end after the last.
    fn text(&self) -> String;
}

/// Output format that the user chose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ui {
    /// JSON on the standard output, one object a line; nothing else there.
    pub(crate) json: bool,
    /// What happens to files that exist.
    pub(crate) overwrite: Overwrite,
}

impl Ui {
    /// Prints the answer on standard output, unless a number of it is infinite or NaN. A closed pipe is no error.
    pub(crate) fn print(self, answer: &impl Answer) -> anyhow::Result<()> {
        finite::check(answer)?;
        let text = if self.json { json(answer)? } else { answer.text() };
        if !text.is_empty() {
            let mut out = std::io::stdout().lock();
            let _ = writeln!(out, "{text}").and_then(|()| out.flush());
        }
        Ok(())
    }

    /// Prints a note on standard error; nothing in JSON mode.
    pub(crate) fn note(self, text: &str) {
        if !self.json {
            eprintln!("{text}");
        }
    }

    /// A progress bar; hidden in JSON mode and where standard error is no terminal.
    pub(crate) fn progress_bar(self, doing: &str, length: u64, unit: &str) -> ProgressBar {
        let style = format!("{{msg}} [{{bar:32}}] {{pos}}/{{len}} {unit} {{elapsed_precise}}");
        self.progress(ProgressBar::new(length), &style, doing)
    }

    /// A spinner for work of unknown length.
    pub(crate) fn spinner(self, doing: &str) -> ProgressBar {
        let spinner = self.progress(ProgressBar::no_length(), "{spinner} {msg} {elapsed_precise}", doing);
        spinner.enable_steady_tick(Duration::from_millis(100));
        spinner
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

/// An answer as JSON.
///
/// # Errors
///
/// A number of it is infinite or NaN.
pub(crate) fn json(answer: &impl Serialize) -> anyhow::Result<String> {
    finite::check(answer)?;
    Ok(serde_json::to_string(answer)?)
}

/// A number with this many decimals, in scientific notation where it would round to zero; rounding noise about zero is zero.
pub(crate) fn number(value: f64, decimals: usize) -> String {
    let smallest_shown = 0.5 * 10f64.powi(-(decimals as i32));
    if value.abs() < 1e-12 {
        format!("{:.decimals$}", 0.0)
    } else if value.abs() < smallest_shown {
        format!("{value:.1e}")
    } else {
        format!("{value:.decimals$}")
    }
}

/// A number with about six digits.
pub(crate) fn six_digits(number: f64) -> String {
    let size = number.abs();
    if size != 0.0 && !(1e-3..1e7).contains(&size) {
        return format!("{number:.5e}");
    }
    let decimals = 5usize.saturating_sub(size.max(1.0).log10() as usize);
    let text = format!("{number:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Rows of cells as an aligned table; an empty cell in the first row leaves its column without a title.
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
    use super::{columns, number, six_digits};

    #[test]
    fn numbers_of_six_digits_are_short() {
        let numbers = [0.0, 1.5, -123.456789, 1e-9, 1_000_000.0].map(six_digits);
        assert_eq!(numbers, ["0", "1.5", "-123.457", "1.00000e-9", "1000000"]);
    }

    #[test]
    fn columns_are_aligned_and_small_numbers_keep_their_digits() {
        let row = |cells: [&str; 2]| cells.map(str::to_owned).to_vec();
        assert_eq!(number(-1e-17, 3), "0.000");
        assert_eq!((number(-1.2345, 3), number(4.56e-5, 3)), ("-1.234".to_owned(), "4.6e-5".to_owned()));
        assert_eq!(columns(&[row(["a", "b"]), row(["long", ""]), row(["µm", "c"])]), "a     b\nlong\nµm    c");
    }
}
