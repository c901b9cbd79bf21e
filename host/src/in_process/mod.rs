//! A board in this process: the firmware's library with a plant, in virtual time.
//!
//! Nothing runs by itself: time passes while somebody waits on the board's [`Link`] or calls [`InProcess::pass`], one
//! millisecond a step. A run is repeated exactly by repeating its calls. What the chip's own layer does, shifting lines
//! out and moving bytes by interrupts, is left out; that is seen with the image in the emulator.

mod board;
mod flash;

use std::collections::VecDeque;
use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Sender};
use std::task::{Context, Waker};
use std::thread;
use std::time::Duration;

use darm_core::wire::bootstrap::Into as RebootInto;
use darm_firmware::control::TICK;

use crate::link::{Link, LinkError};
use crate::plant::camera::{Camera, Film};
use crate::plant::{Broken, Plant, PlantState};
use board::Wires;
pub use flash::MemoryFlash;

/// What the board's thread is asked to do.
type Order = Box<dyn FnOnce(&mut Bench) + Send>;

/// A board with its plant. Clones are the same board; it ends with the last of them.
///
/// The firmware's futures cannot change threads, so the board has one of its own, which only acts while somebody waits
/// for it.
#[derive(Clone)]
pub struct InProcess {
    orders: Sender<Order>,
    /// Steps since the beginning.
    steps: Arc<AtomicU64>,
}

struct Bench {
    firmware: Pin<Box<dyn Future<Output = RebootInto>>>,
    wires: Arc<Wires>,
    flash: MemoryFlash,
    plant: Plant,
    camera: Camera,
    /// Bytes from the host that the board has not fetched.
    to_board: VecDeque<u8>,
    to_host: VecDeque<u8>,
    steps: Arc<AtomicU64>,
}

impl InProcess {
    /// Starts a board with this flash and this plant.
    pub fn boot(plant: Plant, flash: MemoryFlash) -> std::io::Result<Self> {
        let (orders, todo) = mpsc::channel::<Order>();
        let steps = Arc::new(AtomicU64::new(0));
        let counted = steps.clone();
        thread::Builder::new().name("board".into()).spawn(move || {
            let mut bench = Bench::new(plant, flash, counted);
            todo.iter().for_each(|order| order(&mut bench));
        })?;
        Ok(Self { orders, steps })
    }

    /// A plug of the board's console.
    pub fn link(&self) -> Box<dyn Link> {
        Box::new(Plug(self.clone()))
    }

    /// Lets time pass.
    pub fn pass(&self, span_s: f64) {
        self.with((), move |bench| {
            let end_s = bench.now_s() + span_s;
            while bench.now_s() < end_s {
                bench.step();
            }
        });
    }

    /// Time since the beginning; a power cut does not set it back.
    pub fn now_s(&self) -> f64 {
        seconds(&self.steps)
    }

    /// Where the plant is now; `None` if the board's thread has ended by a panic.
    pub fn state(&self) -> Option<PlantState> {
        self.with(None, |bench| Some(bench.plant.state()))
    }

    /// Breaks or repairs something, from now on.
    pub fn set_broken(&self, broken: Broken) {
        self.with((), move |bench| {
            let now_s = bench.now_s();
            bench.plant.set_broken(now_s, broken);
        });
    }

    /// What the camera takes.
    pub fn film(&self) -> Film {
        self.with(Film::default(), |bench| bench.camera.film())
    }

    /// Cuts the power and gives it back: RAM is lost, flash and plant stay.
    pub fn power_cycle(&self) {
        self.with((), Bench::start);
    }

    /// Has the board's thread do something and waits for it; `ended` if the thread has ended by a panic.
    fn with<T: Send + 'static>(&self, ended: T, act: impl FnOnce(&mut Bench) -> T + Send + 'static) -> T {
        let (answer, answered) = mpsc::channel();
        let order = move |bench: &mut Bench| {
            // The asker waits below.
            let _ = answer.send(act(bench));
        };
        if self.orders.send(Box::new(order)).is_err() {
            return ended;
        }
        answered.recv().unwrap_or(ended)
    }
}

/// So many pieces of work a board does in a tick: it searches for a word in pieces of a quarter of a millisecond.
const PIECES: usize = 4;

impl Bench {
    fn new(plant: Plant, flash: MemoryFlash, steps: Arc<AtomicU64>) -> Self {
        let wires = Arc::new(Wires::default());
        Self {
            firmware: Box::pin(board::run(wires.clone(), flash.clone())),
            wires,
            flash,
            plant,
            camera: Camera::default(),
            to_board: VecDeque::new(),
            to_host: VecDeque::new(),
            steps,
        }
    }

    fn now_s(&self) -> f64 {
        seconds(&self.steps)
    }

    /// Starts the firmware anew on the same flash.
    fn start(&mut self) {
        self.wires = Arc::new(Wires::default());
        self.firmware = Box::pin(board::run(self.wires.clone(), self.flash.clone()));
        self.to_board.clear();
        self.to_host.clear();
    }

    /// One tick of the board and of everything around it.
    fn step(&mut self) {
        self.steps.fetch_add(1, Ordering::Relaxed);
        self.wires.clock.pass(TICK);
        let sent = self.to_board.make_contiguous();
        let taken = self.wires.console_in.push_slice(sent);
        self.to_board.drain(..taken);
        let mut poll = || self.firmware.as_mut().poll(&mut Context::from_waker(Waker::noop()));
        let ended = (0..PIECES).any(|_| poll().is_ready());
        self.move_plant();
        let wires = &self.wires;
        self.to_host.extend(std::iter::from_fn(|| wires.console_out.pop()));
        if ended {
            // Of the chip's loader there is none here: the firmware starts either way.
            self.start();
        }
    }

    /// Waits for bytes to the host, at most `timeout_s`.
    fn receive(&mut self, room: usize, timeout_s: f64) -> Vec<u8> {
        let end_s = self.now_s() + timeout_s;
        while self.to_host.is_empty() && self.now_s() < end_s {
            self.step();
        }
        let count = room.min(self.to_host.len());
        self.to_host.drain(..count).collect()
    }

    fn move_plant(&mut self) {
        let (now_s, wires) = (self.now_s(), &self.wires);
        self.plant.set_lines(now_s, wires.lines.load(Ordering::Relaxed));
        wires.switches.store(self.plant.switches(), Ordering::Relaxed);
        let asked: Vec<u8> = std::iter::from_fn(|| wires.bus_out.pop()).collect();
        if !asked.is_empty() {
            wires.bus_in.push_slice(&self.plant.servo_bytes(now_s, &asked));
        }
        self.camera.look(now_s, &self.plant);
    }
}

fn seconds(steps: &AtomicU64) -> f64 {
    1e-6 * (steps.load(Ordering::Relaxed) * TICK.0) as f64
}

/// The host's end of the console.
struct Plug(InProcess);

impl Link for Plug {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        let bytes = bytes.to_vec();
        let sent = self.0.with(false, move |bench| {
            bench.to_board.extend(bytes);
            true
        });
        if sent { Ok(()) } else { Err(LinkError::Closed { port: self.name().to_owned() }) }
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        let room = buffer.len();
        let received = self.0.with(None, move |bench| Some(bench.receive(room, timeout.as_secs_f64())));
        let bytes = received.ok_or_else(|| LinkError::Closed { port: self.name().to_owned() })?;
        buffer[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }

    fn now_s(&self) -> f64 {
        self.0.now_s()
    }

    fn name(&self) -> &str {
        "in-process"
    }
}

#[cfg(test)]
mod tests;
