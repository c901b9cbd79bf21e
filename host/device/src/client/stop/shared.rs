//! A port that one thread reads and writes as usual, while any other may send the stop past it.

use std::collections::VecDeque;
use std::io;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, TryLockError, Weak};
use std::time::{Duration, Instant};

use darm_core::wire::bootstrap::{ANSWER, Request, Stopped};
use darm_core::wire::frame::Header;

use super::socket::Serving;
use super::{Confirmation, REPEAT, socket, stop_at, stop_frame};
use crate::client::reader::{Piece, Reader};
use crate::clock::host_now_s;
use crate::link::{Link, LinkError, Urgent};

/// How long a thread that waits for the confirmation keeps the port from the one that reads it.
const SLICE: Duration = Duration::from_millis(10);
/// Confirmations that are remembered.
const REMEMBERED: usize = 16;

/// Makes a port that can be stopped past its user: through the handle, and by other processes through a Unix socket at
/// `socket`, where one is given and can be made.
pub fn hold(link: Box<dyn Link>, socket: Option<&Path>) -> (Box<dyn Link>, StopHandle) {
    let name = link.name().to_owned();
    let shared = Arc::new(Shared {
        urgent: Urgent::of(&*link),
        line: Mutex::new(Line { link, inbox: VecDeque::new() }),
        heard: Mutex::default(),
        confirmed: Condvar::new(),
        stops: AtomicU64::new(0),
        guests: Mutex::default(),
    });
    let handle = StopHandle { port: name.clone(), way: Way::Port(Arc::downgrade(&shared)) };
    let serving = socket.and_then(|socket| socket::serve(socket, handle.clone()));
    (Box::new(SharedPort { shared, name, _serving: serving }), handle)
}

/// Serves a program that has attached, with its name, and returns at once.
pub(in crate::client) type WelcomeGuest = Arc<dyn Fn(UnixStream, String) -> io::Result<()> + Send + Sync>;

/// The port as its user sees it.
struct SharedPort {
    shared: Arc<Shared>,
    name: String,
    /// Ends with the port.
    _serving: Option<Serving>,
}

struct Shared {
    line: Mutex<Line>,
    urgent: Option<Urgent>,
    heard: Mutex<Heard>,
    confirmed: Condvar,
    /// Number of stops so far.
    stops: AtomicU64,
    /// What serves programs that attach, once the client shares the port.
    guests: Mutex<Option<WelcomeGuest>>,
}

struct Line {
    link: Box<dyn Link>,
    /// Bytes that another thread has read and the user has not.
    inbox: VecDeque<u8>,
}

/// Looks for confirmations of stops in what the board says.
#[derive(Default)]
struct Heard {
    reader: Reader,
    /// The stops that were confirmed last: their numbers, and what was said.
    confirmed: VecDeque<(u16, Stopped)>,
}

impl Heard {
    fn take(&mut self, bytes: &[u8]) {
        for piece in self.reader.read(host_now_s(), bytes) {
            if let Piece::Frame(Header { tag, link: 0, number }, payload) = piece
                && tag == Request::Stop.tag() | ANSWER
                && let Some(stopped) = Stopped::decode(&payload)
            {
                self.confirmed.push_back((number, stopped));
                let old = self.confirmed.len().saturating_sub(REMEMBERED);
                self.confirmed.drain(..old);
            }
        }
    }
}

impl Shared {
    /// Reads into `buffer` and looks for confirmations.
    fn receive(&self, line: &mut Line, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        let count = line.link.receive(buffer, timeout)?;
        if count > 0 {
            lock(&self.heard).take(&buffer[..count]);
            self.confirmed.notify_all();
        }
        Ok(count)
    }

    fn send_urgently(&self, bytes: &[u8], until: Instant) -> Result<(), LinkError> {
        match &self.urgent {
            Some(urgent) => urgent.send(bytes, until),
            None => lock(&self.line).link.send(bytes),
        }
    }

    /// Waits until one of these stops is confirmed, reading the port where nobody else does.
    fn confirmed(&self, numbers: &[u16], until: Instant) -> Option<Stopped> {
        loop {
            let heard = lock(&self.heard);
            if let Some((_, stopped)) = heard.confirmed.iter().find(|(number, _)| numbers.contains(number)) {
                return Some(*stopped);
            }
            if Instant::now() >= until {
                return None;
            }
            drop(heard);
            match self.line.try_lock() {
                Ok(mut line) => self.read_ahead(&mut line),
                Err(TryLockError::Poisoned(line)) => self.read_ahead(&mut line.into_inner()),
                Err(TryLockError::WouldBlock) => {
                    let woken = self.confirmed.wait_timeout(lock(&self.heard), SLICE);
                    drop(woken.unwrap_or_else(PoisonError::into_inner));
                }
            }
        }
    }

    fn read_ahead(&self, line: &mut Line) {
        let mut bytes = [0; 256];
        match self.receive(line, &mut bytes, SLICE) {
            Ok(count) => line.inbox.extend(&bytes[..count]),
            // The user of the port will meet the same error.
            Err(_) => std::thread::sleep(SLICE),
        }
    }
}

/// Also where a thread has panicked with it.
pub(in crate::client) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Link for SharedPort {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        lock(&self.shared.line).link.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        let mut line = lock(&self.shared.line);
        if line.inbox.is_empty() {
            return self.shared.receive(&mut line, buffer, timeout);
        }
        let count = buffer.len().min(line.inbox.len());
        buffer.iter_mut().zip(line.inbox.drain(..count)).for_each(|(to, from)| *to = from);
        Ok(count)
    }

    fn now_s(&self) -> f64 {
        lock(&self.shared.line).link.now_s()
    }

    fn name(&self) -> &str {
        &self.name
    }
}

/// Stops the board at a port that this process holds or is a guest of, from any thread. The handle does not keep the port open.
#[derive(Clone)]
pub struct StopHandle {
    port: String,
    way: Way,
}

/// How the board is reached.
#[derive(Clone)]
enum Way {
    /// The port is of this process.
    Port(Weak<Shared>),
    /// It is of the process that serves at this socket.
    Holder(PathBuf),
}

impl StopHandle {
    /// The handle of a guest, for a port whose holder serves at `socket`.
    pub(in crate::client) fn of_guest(port: &str, socket: &Path) -> Self {
        Self { port: port.to_owned(), way: Way::Holder(socket.to_owned()) }
    }

    /// Sends the stop at once, again until it is confirmed, and gives up after `within`.
    ///
    /// # Errors
    ///
    /// The port is closed, or did not take a single frame.
    pub fn stop(&self, within: Duration) -> Result<Confirmation, LinkError> {
        match &self.way {
            Way::Port(shared) => {
                let shared = shared.upgrade().ok_or_else(|| LinkError::Closed { port: self.port.clone() })?;
                shared.stop(Instant::now() + within)
            }
            Way::Holder(socket) => stop_at(&self.port, Some(socket.clone())),
        }
    }

    /// Number of stops that this process has sent through the port so far, also for others.
    pub fn stops(&self) -> u64 {
        self.shared().map_or(0, |shared| shared.stops.load(Ordering::SeqCst))
    }

    /// Hands programs that attach to the socket of the port to this function from now on. A guest of another process has none.
    pub(in crate::client) fn welcome_guests(&self, welcome: WelcomeGuest) {
        if let Some(shared) = self.shared() {
            *lock(&shared.guests) = Some(welcome);
        }
    }

    /// What serves programs that attach.
    pub(super) fn guests(&self) -> Option<WelcomeGuest> {
        lock(&self.shared()?.guests).clone()
    }

    fn shared(&self) -> Option<Arc<Shared>> {
        match &self.way {
            Way::Port(shared) => shared.upgrade(),
            Way::Holder(_) => None,
        }
    }
}

impl Shared {
    /// See [`StopHandle::stop`].
    fn stop(&self, until: Instant) -> Result<Confirmation, LinkError> {
        self.stops.fetch_add(1, Ordering::SeqCst);
        // Answers to an earlier program's stops may still be on the line; those that were heard before are none to this one.
        let mut number: u16 = rand::random();
        let mut sent = Vec::new();
        loop {
            lock(&self.heard).confirmed.retain(|(earlier, _)| *earlier != number);
            match self.send_urgently(&stop_frame(number), until) {
                Ok(()) => sent.push(number),
                Err(error) if sent.is_empty() => return Err(error),
                Err(_) => {}
            }
            if let Some(stopped) = self.confirmed(&sent, until.min(Instant::now() + REPEAT)) {
                return Ok(Confirmation::of(stopped));
            }
            if Instant::now() >= until {
                return Ok(Confirmation::Missing);
            }
            number = number.wrapping_add(1);
        }
    }
}
