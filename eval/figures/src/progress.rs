//! Progress of a long task on standard error: a line for every step, a bar or lines with the time left for many items.

use std::io::IsTerminal as _;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// Prints the steps of a task, or nothing.
#[derive(Clone, Debug)]
pub struct Progress {
    shown: bool,
    start: Instant,
}

impl Progress {
    /// Prints every step on standard error.
    pub fn shown() -> Self {
        Self { shown: true, start: Instant::now() }
    }

    /// Prints nothing: for runs in parallel.
    pub fn silent() -> Self {
        Self { shown: false, start: Instant::now() }
    }

    /// Prints a line with the time since the start.
    pub fn say(&self, line: impl AsRef<str>) {
        if self.shown {
            eprintln!("{:6.1} s  {}", self.start.elapsed().as_secs_f64(), line.as_ref());
        }
    }

    /// A bar up to `length`; hidden where standard error is not a terminal.
    pub fn bar(&self, what: &'static str, length: u64) -> ProgressBar {
        if !self.shown {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new(length).with_message(what);
        if let Ok(style) = ProgressStyle::with_template("          {msg} {wide_bar} {pos}/{len} {eta}") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
    }

    /// Time since the start, s.
    pub fn elapsed_s(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}

/// Between two lines of progress where standard error is not a terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Progress over many items, with the time left.
#[derive(Debug)]
pub struct Meter {
    label: String,
    bar: ProgressBar,
    start: Instant,
    /// When the last line was printed; `None` on a terminal, where the bar is shown.
    last_line: Option<Mutex<Instant>>,
}

impl Meter {
    /// A meter for `n` items.
    pub fn new(label: &str, n: usize) -> Self {
        let start = Instant::now();
        let is_terminal = std::io::stderr().is_terminal();
        let bar = if is_terminal { ProgressBar::new(n as u64) } else { ProgressBar::hidden() };
        bar.set_length(n as u64);
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len}, {eta} left") {
            bar.set_style(style);
        }
        bar.set_message(label.to_owned());
        Self { label: label.to_owned(), bar, start, last_line: (!is_terminal).then(|| Mutex::new(start)) }
    }

    /// One more item is done.
    pub fn step(&self) {
        self.bar.inc(1);
        let Some(Ok(mut last)) = self.last_line.as_ref().map(Mutex::lock) else { return };
        if last.elapsed() >= LINE_EVERY {
            *last = Instant::now();
            let (done, all) = (self.bar.position(), self.bar.length().unwrap_or_default());
            let left_s = left_s(self.start.elapsed(), done, all);
            eprintln!("{}: {done} of {all} items, {left_s:.0} s left", self.label);
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Time left when the items to come take as long as those before, s.
fn left_s(elapsed: Duration, done: u64, all: u64) -> f64 {
    elapsed.as_secs_f64() * all.saturating_sub(done) as f64 / done.max(1) as f64
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::left_s;

    #[test]
    fn the_time_left_is_extrapolated() {
        assert_eq!(left_s(Duration::from_secs(10), 20, 100), 40.0);
        assert_eq!(left_s(Duration::from_secs(10), 100, 100), 0.0);
    }
}
