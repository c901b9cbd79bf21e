//! The thread between the port and the screen: sends lines, prints whatever text comes, at any time.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use darm_device::link::{Link, LinkError};

/// How long one look at the port lasts.
const LOOK: Duration = Duration::from_millis(10);
/// The board starts to answer a line within this time.
const ANSWER: Duration = Duration::from_millis(1500);
/// An answer is over when nothing came for so long.
const QUIET: Duration = Duration::from_millis(120);

/// Where text from the board goes.
pub(crate) type Show = Box<dyn FnMut(&str) + Send>;

/// The thread, while it runs, and the screen that it shares.
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

    /// Ends the thread and closes the port; why the port failed, if it had.
    pub(crate) fn stop(&mut self) -> Result<(), LinkError> {
        let Some(Running { lines, thread }) = self.running.take() else { return Ok(()) };
        drop(lines);
        thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }

    /// True when the port has failed.
    pub(crate) fn is_lost(&self) -> bool {
        self.running.as_ref().is_none_or(|running| running.thread.is_finished())
    }

    /// Sends a line and waits until its answer has come to an end. False if there was no answer.
    pub(crate) fn ask(&self, line: &str) -> bool {
        let count = || self.screen.shown.load(Ordering::Acquire);
        let before = count();
        if self.running.as_ref().is_none_or(|running| running.lines.send(line.to_owned()).is_err()) {
            return false;
        }
        let asked = Instant::now();
        while count() == before && asked.elapsed() < ANSWER && !self.is_lost() {
            thread::sleep(LOOK);
        }
        let (mut seen, mut since) = (count(), Instant::now());
        while seen != before && since.elapsed() < QUIET && !self.is_lost() {
            thread::sleep(LOOK);
            if count() != seen {
                (seen, since) = (count(), Instant::now());
            }
        }
        seen != before
    }
}

/// Runs until the port fails or nobody sends lines any more.
fn run(mut link: Box<dyn Link>, to_send: &Receiver<String>, screen: &Screen) -> Result<(), LinkError> {
    let mut text = Text::default();
    let mut bytes = [0; 256];
    loop {
        match to_send.try_recv() {
            Ok(line) => link.send(format!("{line}\r").as_bytes())?,
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => return Ok(()),
        }
        let count = link.receive(&mut bytes, LOOK)?;
        for &byte in &bytes[..count] {
            if let Some(line) = text.push(byte) {
                screen.show(&line);
            }
        }
    }
}

/// Picks the lines of text out of what a port brings; frames stand between zero bytes and are left out.
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
    fn text_is_told_from_frames() {
        let mut text = Text::default();
        let lines: Vec<_> = b"one\r\n\0\nfr\n\0two\r\nthr".iter().filter_map(|&byte| text.push(byte)).collect();
        assert_eq!(lines, ["one", "two"]);
    }
}
