//! A second host on the same console, as behind a serial server: its client runs in a thread, and exactly one of the two
//! hosts runs at any time.
//!
//! ```text
//!  first host ── steps ──► World ── bytes, or the end of a wait ──► thread of the second host
//!                            ▲                                          │
//!                            └── Send, Look, Receive, Pass ─────────────┘
//! ```
//!
//! The world waits while the second host runs, and continues when that host waits for bytes or lets time pass. So a
//! seed decides the order of everything, although both clients are synchronous.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use darm_device::link::{Link, LinkError};

const PORT: &str = "simulation, second host";

/// A world that a second host can be part of.
pub trait Surroundings {
    /// True time, ns.
    fn now_ns(&self) -> u64;
    /// The second host sends bytes to the board.
    fn on_second_sent(&mut self, bytes: &[u8]);
}

/// What the second host wants of the world.
enum Ask<W> {
    /// Bytes for the board.
    Send(Vec<u8>),
    /// Something is to be done with the world.
    Look(Box<dyn FnOnce(&mut W) + Send>),
    /// To run again when bytes have come, or after this time.
    Receive(Duration),
    /// To run again after this time, ms.
    Pass(u64),
}

/// The second host runs now.
struct Turn {
    now_ns: u64,
    /// What has come for it; `None`: its line is closed.
    bytes: Option<Vec<u8>>,
}

/// What the second host waits for.
#[derive(Clone, Copy, PartialEq)]
enum Waiting {
    /// Bytes, or this time, ns.
    Bytes(u64),
    /// This time, ns.
    Time(u64),
    /// Nothing: it has ended.
    Never,
}

/// The world's end of the second host.
pub struct SecondHost<W> {
    turns: Option<Sender<Turn>>,
    asks: Receiver<Ask<W>>,
    thread: Option<JoinHandle<()>>,
    inbox: VecDeque<u8>,
    waiting: Waiting,
    is_closed: bool,
}

impl<W: Surroundings + 'static> SecondHost<W> {
    /// A second host that does this in a thread; it runs when the world gives it its first turn.
    pub fn start(from_ns: u64, act: impl FnOnce(&Console<W>) + Send + 'static) -> Self {
        let ((turns, its_turns), (its_asks, asks)) = (channel(), channel());
        let console = Console(Arc::new(Mutex::new(End {
            asks: its_asks,
            turns: its_turns,
            ready: VecDeque::new(),
            now_ns: 0,
            is_closed: false,
        })));
        let run = move || {
            console.wait();
            act(&console);
        };
        Self {
            turns: Some(turns),
            asks,
            thread: Some(std::thread::spawn(run)),
            inbox: VecDeque::new(),
            waiting: Waiting::Time(from_ns),
            is_closed: false,
        }
    }

    /// Bytes from the board.
    pub fn hear(&mut self, bytes: impl Iterator<Item = u8>) {
        if self.waiting != Waiting::Never {
            self.inbox.extend(bytes);
        }
    }

    /// Lets it run if what it waits for is there.
    pub fn step(&mut self, world: &mut W) {
        let now_ns = world.now_ns();
        let is_due = match self.waiting {
            Waiting::Bytes(until_ns) => !self.inbox.is_empty() || now_ns >= until_ns,
            Waiting::Time(until_ns) => now_ns >= until_ns,
            Waiting::Never => false,
        };
        if is_due {
            self.run(world);
        }
    }

    /// Closes its line, and waits until it has ended.
    pub fn close(&mut self, world: &mut W) {
        self.is_closed = true;
        while self.waiting != Waiting::Never {
            self.run(world);
        }
    }

    fn run(&mut self, world: &mut W) {
        let now_ns = world.now_ns();
        let takes = matches!(self.waiting, Waiting::Bytes(_));
        let bytes = if takes { self.inbox.drain(..).collect() } else { Vec::new() };
        let turn = Turn { now_ns, bytes: (!self.is_closed).then_some(bytes) };
        self.waiting = Waiting::Never;
        if self.turns.as_ref().is_none_or(|turns| turns.send(turn).is_err()) {
            return;
        }
        while let Ok(ask) = self.asks.recv() {
            match ask {
                Ask::Send(bytes) => world.on_second_sent(&bytes),
                Ask::Look(look) => look(world),
                Ask::Receive(timeout) => {
                    self.waiting = Waiting::Bytes(now_ns + timeout.as_nanos() as u64);
                    return;
                }
                Ask::Pass(ms) => {
                    self.waiting = Waiting::Time(now_ns + ms * 1_000_000);
                    return;
                }
            }
        }
    }
}

impl<W> Drop for SecondHost<W> {
    fn drop(&mut self) {
        // It finds its line closed and ends.
        self.turns = None;
        while self.asks.recv().is_ok() {}
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The second host's end of the world.
struct End<W> {
    asks: Sender<Ask<W>>,
    turns: Receiver<Turn>,
    /// Bytes that have come and were not read.
    ready: VecDeque<u8>,
    now_ns: u64,
    is_closed: bool,
}

impl<W> End<W> {
    fn ask(&mut self, ask: Ask<W>) {
        self.is_closed |= self.asks.send(ask).is_err();
    }

    /// Waits for its turn.
    fn wait(&mut self) {
        let turn = self.turns.recv().unwrap_or(Turn { now_ns: self.now_ns, bytes: None });
        self.now_ns = turn.now_ns;
        self.is_closed |= turn.bytes.is_none();
        self.ready.extend(turn.bytes.unwrap_or_default());
    }
}

/// The console as the second host has it.
pub struct Console<W>(Arc<Mutex<End<W>>>);

impl<W> Clone for Console<W> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<W: 'static> Console<W> {
    fn with<T>(&self, act: impl FnOnce(&mut End<W>) -> T) -> T {
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn wait(&self) {
        self.with(End::wait);
    }

    /// True when the run is over for this host.
    pub fn is_closed(&self) -> bool {
        self.with(|end| end.is_closed)
    }

    /// True time, ns.
    pub fn now_ns(&self) -> u64 {
        self.with(|end| end.now_ns)
    }

    /// Lets this time pass.
    pub fn pass(&self, ms: u64) {
        self.with(|end| {
            if !end.is_closed {
                end.ask(Ask::Pass(ms));
                end.wait();
            }
        });
    }

    /// Does something with the world; `None` when the run is over.
    pub fn look<T: Send + 'static>(&self, look: impl FnOnce(&mut W) -> T + Send + 'static) -> Option<T> {
        let (reply, result) = channel();
        self.with(|end| end.ask(Ask::Look(Box::new(move |world| drop(reply.send(look(world)))))));
        result.recv().ok()
    }

    fn closed() -> LinkError {
        LinkError::Closed { port: PORT.into() }
    }
}

impl<W: 'static> Link for Console<W> {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        self.with(|end| {
            if !end.is_closed {
                end.ask(Ask::Send(bytes.to_vec()));
            }
            if end.is_closed { Err(Self::closed()) } else { Ok(()) }
        })
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        self.with(|end| {
            if end.ready.is_empty() && !end.is_closed {
                end.ask(Ask::Receive(timeout));
                end.wait();
            }
            if end.is_closed {
                return Err(Self::closed());
            }
            let count = buffer.len().min(end.ready.len());
            buffer.iter_mut().zip(end.ready.drain(..count)).for_each(|(slot, byte)| *slot = byte);
            Ok(count)
        })
    }

    fn now_s(&self) -> f64 {
        1e-9 * self.now_ns() as f64
    }

    fn name(&self) -> &str {
        PORT
    }
}
