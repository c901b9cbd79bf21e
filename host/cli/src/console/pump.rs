//! The thread between port and screen: sends lines and prints received text at any time.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use darm_device::link::{Link, LinkError};

/// Timeout of one read from the port.
const POLL: Duration = Duration::from_millis(10);
/// Longest wait for the first line of an answer.
const ANSWER: Duration = Duration::from_millis(1500);
/// An answer has ended when nothing arrived for this long.
const QUIET: Duration = Duration::from_millis(120);

/// Where text from the board goes.
pub(crate) type Show = Box<dyn FnMut(&str) + Send>;

/// The running thread and the screen that it prints to.
pub(crate) struct Pump {
    running: Option<Running>,
    screen: Arc<Screen>,
}

struct Running {
    lines: Sender<String>,
    thread: JoinHandle<Result<(), LinkError>>,
}

struct Screen {
    show: Mutex<Show>,
    /// Lines shown so far.
    shown: AtomicU64,
}

impl Screen {
    fn show(&self, line: &str) {
        (self.show.lock().unwrap_or_else(PoisonError::into_inner))(line);
        self.shown.fetch_add(1, Ordering::AcqRel);
    }
}

impl Pump {
    /// A pump without a port yet.
    pub(crate) fn new(show: Show) -> Self {
        Self { running: None, screen: Arc::new(Screen { show: Mutex::new(show), shown: AtomicU64::new(0) }) }
    }

    /// Starts on an open port.
    pub(crate) fn start(&mut self, link: Box<dyn Link>) {
        let (lines, to_send) = channel();
        let screen = Arc::clone(&self.screen);
        let thread = thread::spawn(move || run(link, &to_send, &screen));
        self.running = Some(Running { lines, thread });
    }

    /// Ends the thread and closes the port; returns the error of a port that had failed.
    pub(crate) fn stop(&mut self) -> Result<(), LinkError> {
        let Some(Running { lines, thread }) = self.running.take() else { return Ok(()) };
        drop(lines);
        thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }

    /// True when the port has failed.
    pub(crate) fn is_lost(&self) -> bool {
        self.running.as_ref().is_none_or(|running| running.thread.is_finished())
    }

    /// Sends a line and waits for the end of its answer. False if there was no answer.
    pub(crate) fn ask(&self, line: &str) -> bool {
        let count = || self.screen.shown.load(Ordering::Acquire);
        let before = count();
        if self.running.as_ref().is_none_or(|running| running.lines.send(line.to_owned()).is_err()) {
            return false;
        }
        let asked = Instant::now();
        while count() == before && asked.elapsed() < ANSWER && !self.is_lost() {
            thread::sleep(POLL);
        }
        let (mut seen, mut since) = (count(), Instant::now());
        while seen != before && since.elapsed() < QUIET && !self.is_lost() {
            thread::sleep(POLL);
            if count() != seen {
                (seen, since) = (count(), Instant::now());
            }
        }
        seen != before
    }
}

/// Runs until the port fails or the sender of lines is gone.
fn run(mut link: Box<dyn Link>, to_send: &Receiver<String>, screen: &Screen) -> Result<(), LinkError> {
    let mut text = Text::default();
    let mut bytes = [0; 256];
    loop {
        match to_send.try_recv() {
            Ok(line) => link.send(format!("{line}\r").as_bytes())?,
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => return Ok(()),
        }
        let count = link.receive(&mut bytes, POLL)?;
        for &byte in &bytes[..count] {
            if let Some(line) = text.push(byte) {
                screen.show(&line);
            }
        }
    }
}

/// Extracts lines of text from received bytes; frames, which are enclosed in zero bytes, are skipped.
#[derive(Default)]
struct Text {
    line: String,
    in_frame: bool,
}

impl Text {
    fn push(&mut self, byte: u8) -> Option<String> {
        match byte {
            0 => {
                self.in_frame = !self.in_frame;
                None
            }
            _ if self.in_frame => None,
            b'\n' => Some(std::mem::take(&mut self.line)),
            b'\t' | b' '..=b'~' => {
                self.line.push(byte.into());
                None
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Text;

    #[test]
    fn text_is_separated_from_frames() {
        let mut text = Text::default();
        let lines: Vec<_> = b"one\r\n\0\nfr\n\0two\r\nthr".iter().filter_map(|&byte| text.push(byte)).collect();
        assert_eq!(lines, ["one", "two"]);
    }
}
