//! The thread between port and screen: sends lines and prints received text at any time.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use darm_device::client::sharing::LineKind;
use darm_device::client::stop::StopHandle;
use darm_device::client::{Client, ClientError, TransportError};
use darm_device::link::{Link, LinkError};

use super::board_state::{BoardState, Shared};

/// Timeout of one read from the port.
const POLL: Duration = Duration::from_millis(10);
/// Longest wait for the first line of an answer.
const ANSWER: Duration = Duration::from_millis(1500);
/// An answer has ended when nothing arrived for this long.
const QUIET: Duration = Duration::from_millis(120);

/// A line that changes something is not sent later: an arm that moves late surprises people.
const LATE: Duration = Duration::from_secs(2);

/// Interval at which the state of the board is requested.
const LOOK: Duration = Duration::from_millis(500);

/// An open port.
pub(crate) enum Port {
    /// Lines of text and nothing else.
    Text(Box<dyn Link>),
    /// With a board that answers frames: its state is requested between lines. The handle counts stops.
    Board(Box<Client>, StopHandle),
}

enum Job {
    /// Send this line.
    Line(TypedLine),
    /// Ask for the state now.
    Look(Sender<()>),
}

/// A line, and when it was typed.
struct TypedLine {
    text: String,
    at: Instant,
    /// Number of stops before it.
    stops: u64,
}

/// Where text from the board goes.
pub(crate) type Show = Box<dyn FnMut(&str) + Send>;

/// The running thread and the screen that it prints to.
pub(crate) struct Pump {
    running: Option<Running>,
    screen: Arc<Screen>,
    board: Shared,
}

struct Running {
    jobs: Sender<Job>,
    thread: JoinHandle<Result<(), LinkError>>,
    handle: Option<StopHandle>,
}

impl Running {
    fn send(&self, line: &str) -> bool {
        let stops = self.handle.as_ref().map_or(0, StopHandle::stops);
        self.jobs.send(Job::Line(TypedLine { text: line.to_owned(), at: Instant::now(), stops })).is_ok()
    }
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
    /// A pump without a port yet; it keeps `board` up to date.
    pub(crate) fn new(show: Show, board: Shared) -> Self {
        Self { running: None, screen: Arc::new(Screen { show: Mutex::new(show), shown: AtomicU64::new(0) }), board }
    }

    /// Starts on an open port.
    pub(crate) fn start(&mut self, port: Port) {
        let (jobs, to_do) = channel();
        let (screen, board) = (Arc::clone(&self.screen), self.board.clone());
        let handle = if let Port::Board(_, handle) = &port { Some(handle.clone()) } else { None };
        self.board.set(None);
        let thread = thread::spawn(move || match port {
            Port::Text(link) => run(link, &to_do, &screen),
            Port::Board(client, handle) => Conversation::new(*client, handle, screen, board).run(&to_do),
        });
        self.running = Some(Running { jobs, thread, handle });
    }

    /// Waits until the state of the board is that of now.
    pub(crate) fn look(&self) {
        let (done, seen) = channel();
        if self.running.as_ref().is_some_and(|running| running.jobs.send(Job::Look(done)).is_ok()) {
            // A board that does not answer has no state.
            let _ = seen.recv_timeout(ANSWER);
        }
    }

    /// Ends the thread and closes the port; returns the error of a port that had failed.
    pub(crate) fn stop(&mut self) -> Result<(), LinkError> {
        let Some(Running { jobs, thread, .. }) = self.running.take() else { return Ok(()) };
        drop(jobs);
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
        if !self.running.as_ref().is_some_and(|running| running.send(line)) {
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

/// Runs until the port fails or the sender of jobs is gone.
fn run(mut link: Box<dyn Link>, to_do: &Receiver<Job>, screen: &Screen) -> Result<(), LinkError> {
    let mut text = Text::default();
    let mut bytes = [0; 256];
    loop {
        match to_do.try_recv() {
            Ok(Job::Line(line)) => link.send(format!("{}\r", line.text).as_bytes())?,
            Ok(Job::Look(_)) => {}
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

/// Lines of text and questions for the state, in turn on one port.
struct Conversation {
    client: Client,
    handle: StopHandle,
    screen: Arc<Screen>,
    board: Shared,
    looked: Instant,
    phase: Option<String>,
}

impl Conversation {
    fn new(mut client: Client, handle: StopHandle, screen: Arc<Screen>, board: Shared) -> Self {
        let (mut text, shown) = (Text::default(), Arc::clone(&screen));
        client.set_on_text(move |bytes| {
            bytes.iter().filter_map(|&byte| text.push(byte)).for_each(|line| shown.show(&line));
        });
        Self { client, handle, screen, board, looked: Instant::now(), phase: None }
    }

    /// Runs until the port fails or the sender of jobs is gone.
    fn run(mut self, to_do: &Receiver<Job>) -> Result<(), LinkError> {
        loop {
            match to_do.try_recv() {
                Ok(Job::Line(line)) => self.type_line(&line)?,
                Ok(Job::Look(done)) => {
                    self.look()?;
                    // Nobody waits any more where the answer took too long.
                    let _ = done.send(());
                }
                Err(TryRecvError::Empty) if self.looked.elapsed() > LOOK => self.look()?,
                Err(TryRecvError::Empty) => {}
                Err(TryRecvError::Disconnected) => return Ok(()),
            }
            only_link(self.client.listen(POLL.as_secs_f64()))?;
        }
    }

    /// Sends a line. One that changes something may have waited for commands that use this port: not past a stop, nor for long.
    fn type_line(&mut self, line: &TypedLine) -> Result<(), LinkError> {
        let typed = match LineKind::of(&line.text) {
            Ok(LineKind::Changes) => {
                let handle = self.handle.clone();
                self.client.type_change(&line.text, || handle.stops() != line.stops || line.at.elapsed() > LATE)
            }
            Ok(LineKind::Reads | LineKind::Stops) | Err(_) => self.client.type_line(&line.text),
        };
        if let Err(ClientError::Denied(reason)) = &typed {
            self.screen.show(&format!("? {reason}"));
        }
        only_link(typed)
    }

    /// Asks for the state, and shows when the board does something else than before.
    fn look(&mut self) -> Result<(), LinkError> {
        let state = self.ask();
        self.looked = Instant::now();
        self.board.set(state.as_ref().ok().cloned());
        let phase = state.as_ref().ok().map(BoardState::phase);
        if let (Some(before), Some(now)) = (&self.phase, &phase)
            && before != now
        {
            self.screen.show(&format!("[{now}]"));
        }
        self.phase = phase.or(self.phase.take());
        only_link(state.map(drop))
    }

    fn ask(&mut self) -> Result<BoardState, ClientError> {
        let status = match self.client.status() {
            // The board was restarted, or another program has asked it.
            Err(ClientError::Refused(_)) => self.client.say_hello().and_then(|_| self.client.status())?,
            other => other?,
        };
        Ok(BoardState { status, outputs: self.client.outputs()? })
    }
}

/// The error of a port that has failed; that a board is silent or refuses a question is none.
fn only_link(result: Result<(), ClientError>) -> Result<(), LinkError> {
    match result {
        Err(ClientError::Transport(TransportError::Link(error))) => Err(error),
        Ok(()) | Err(_) => Ok(()),
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
