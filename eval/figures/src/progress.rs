//! What a person sees while a long task runs: a line for every step, a bar for what takes time.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// Says what goes on, or nothing.
#[derive(Clone, Debug)]
pub(crate) struct Progress {
    shown: bool,
    start: Instant,
}

impl Progress {
    /// Says every step on standard error.
    pub(crate) fn shown() -> Self {
        Self { shown: true, start: Instant::now() }
    }

    /// Says nothing: for runs side by side.
    pub(crate) fn silent() -> Self {
        Self { shown: false, start: Instant::now() }
    }

    /// Says a line with the time since the start.
    pub(crate) fn say(&self, line: impl AsRef<str>) {
        if self.shown {
            eprintln!("{:6.1} s  {}", self.start.elapsed().as_secs_f64(), line.as_ref());
        }
    }

    /// A bar up to `length`; hidden where nobody looks at a terminal.
    pub(crate) fn bar(&self, what: &'static str, length: u64) -> ProgressBar {
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
    pub(crate) fn elapsed_s(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}
