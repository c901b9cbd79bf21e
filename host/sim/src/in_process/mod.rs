//! A board in this process: the firmware's library with a plant, in virtual time.
//!
//! [`Bench`] is the board without threads: somebody steps it and sees its pins. [`InProcess`] is a handle to a bench in a
//! thread, for a client that waits on a link: time passes while somebody waits on the board's [`Link`] or calls
//! [`InProcess::pass`], one millisecond a step. A run is repeated exactly by repeating its calls.
//!
//! The firmware drives the real shift driver and the real servo bus; the chain of eight 74HC595 is decoded from the edges
//! of four pins. What the chip's own layer does, moving bytes by interrupts and writing registers of the flash, is left out; that is
//! seen with the image in the emulator.

mod bench;
mod board;
mod chip;
mod flash;

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Sender};
use std::thread;
use std::time::Duration;

use crate::plant::camera::{Camera, Film};
use crate::plant::{Broken, Plant, PlantState};
pub use bench::{Bench, Physical};
pub use board::{ChainFaults, DEVICE, Pin};
pub use chip::Chip;
use darm_device::link::{Link, LinkError};
pub use flash::{FlashError, MemoryFlash, Wear};

/// A board with a plant that somebody steps, in virtual time.
pub trait Stepped {
    /// One millisecond, or what is nearest to it.
    fn step(&mut self);
    /// True time since the beginning, ns; a power cut does not set it back.
    fn now_ns(&self) -> u64;
    /// What hangs on the board.
    fn plant(&self) -> &Plant;
    /// What hangs on the board, to break or repair it.
    fn plant_mut(&mut self) -> &mut Plant;
    /// Bytes from the host.
    fn send(&mut self, bytes: &[u8]);
    /// Bytes for the host.
    fn received(&mut self) -> &mut VecDeque<u8>;
    /// A person holds the user button, or releases it.
    fn hold_button(&mut self, pressed: bool);
    /// Cuts the power and gives it back: RAM is lost, flash and plant stay.
    fn power_cycle(&mut self);
    /// Whether what runs the board has failed, so that nothing comes any more.
    fn has_failed(&self) -> bool {
        false
    }
}

/// What the board's thread is asked to do.
type Order<B> = Box<dyn FnOnce(&mut Rig<B>) + Send>;

/// A board with its plant. Clones are the same board; it ends with the last of them.
///
/// The firmware's futures cannot change threads, so the board has a separate one, which only acts while somebody waits
/// for it.
pub struct InProcess<B = Bench> {
    orders: Sender<Order<B>>,
    /// Time since the beginning, in nanoseconds.
    now_ns: Arc<AtomicU64>,
    name: &'static str,
}

/// What the board's thread owns.
struct Rig<B> {
    bench: B,
    camera: Camera,
    now_ns: Arc<AtomicU64>,
}

impl<B> Clone for InProcess<B> {
    fn clone(&self) -> Self {
        Self { orders: self.orders.clone(), now_ns: self.now_ns.clone(), name: self.name }
    }
}

impl InProcess {
    /// Starts a board with this flash and this plant.
    ///
    /// # Errors
    ///
    /// The thread of the board cannot start.
    pub fn boot(plant: Plant, flash: MemoryFlash) -> std::io::Result<Self> {
        Self::run("in-process", move || Bench::new(plant, flash))
    }
}

impl<B: Stepped + 'static> InProcess<B> {
    /// Runs the board that `make` gives in a thread; `name` is that of its port.
    ///
    /// # Errors
    ///
    /// The system gives no thread.
    pub fn run(name: &'static str, make: impl FnOnce() -> B + Send + 'static) -> std::io::Result<Self> {
        let (orders, todo) = mpsc::channel::<Order<B>>();
        let now_ns = Arc::new(AtomicU64::new(0));
        let shown = now_ns.clone();
        thread::Builder::new().name("board".into()).spawn(move || {
            let mut rig = Rig { bench: make(), camera: Camera::default(), now_ns: shown };
            todo.iter().for_each(|order| order(&mut rig));
        })?;
        Ok(Self { orders, now_ns, name })
    }

    /// A plug of the board's console.
    pub fn link(&self) -> Box<dyn Link> {
        Box::new(Plug(self.clone()))
    }

    /// Lets time pass.
    pub fn pass(&self, span_s: f64) {
        self.with((), move |rig| {
            let end_s = rig.now_s() + span_s;
            while rig.now_s() < end_s {
                rig.step();
            }
        });
    }

    /// Time since the beginning; a power cut does not set it back.
    pub fn now_s(&self) -> f64 {
        1e-9 * self.now_ns.load(Ordering::Relaxed) as f64
    }

    /// Where the plant is now; `None` if the board's thread has ended by a panic.
    pub fn state(&self) -> Option<PlantState> {
        self.with(None, |rig| Some(rig.bench.plant().state()))
    }

    /// Breaks or repairs something, from now on.
    pub fn set_broken(&self, broken: Broken) {
        self.with((), move |rig| {
            let now_s = rig.now_s();
            rig.bench.plant_mut().set_broken(now_s, broken);
        });
    }

    /// Has something done with the board itself; `None` if the board's thread has ended by a panic.
    pub fn with_board<T: Send + 'static>(&self, act: impl FnOnce(&mut B) -> T + Send + 'static) -> Option<T> {
        self.with(None, move |rig| Some(act(&mut rig.bench)))
    }

    /// What the camera takes.
    pub fn film(&self) -> Film {
        self.with(Film::default(), |rig| rig.camera.film())
    }

    /// A person holds the board's user button, or releases it.
    pub fn hold_button(&self, pressed: bool) {
        self.with((), move |rig| rig.bench.hold_button(pressed));
    }

    /// Cuts the power and gives it back: RAM is lost, flash and plant stay.
    pub fn power_cycle(&self) {
        self.with((), |rig| rig.bench.power_cycle());
    }

    /// Has the board's thread do something and waits for it; `ended` if the thread has ended by a panic.
    fn with<T: Send + 'static>(&self, ended: T, act: impl FnOnce(&mut Rig<B>) -> T + Send + 'static) -> T {
        let (answer, answered) = mpsc::channel();
        let order = move |rig: &mut Rig<B>| {
            // The asker waits below.
            let _ = answer.send(act(rig));
        };
        if self.orders.send(Box::new(order)).is_err() {
            return ended;
        }
        answered.recv().unwrap_or(ended)
    }
}

impl<B: Stepped> Rig<B> {
    fn now_s(&self) -> f64 {
        1e-9 * self.bench.now_ns() as f64
    }

    /// One tick. Nobody looks at the pins.
    fn step(&mut self) {
        self.bench.step();
        self.camera.look(self.now_s(), self.bench.plant());
        self.now_ns.store(self.bench.now_ns(), Ordering::Relaxed);
    }

    /// Waits for bytes to the host, at most `timeout_s`.
    fn receive(&mut self, room: usize, timeout_s: f64) -> Vec<u8> {
        let end_s = self.now_s() + timeout_s;
        while self.bench.received().is_empty() && self.now_s() < end_s {
            self.step();
        }
        let received = self.bench.received();
        let count = room.min(received.len());
        received.drain(..count).collect()
    }
}

/// The host's end of the console.
struct Plug<B>(InProcess<B>);

impl<B: Stepped + 'static> Link for Plug<B> {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        let bytes = bytes.to_vec();
        let sent = self.0.with(false, move |rig| {
            rig.bench.send(&bytes);
            true
        });
        if sent { Ok(()) } else { Err(LinkError::Closed { port: self.name().to_owned() }) }
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        let room = buffer.len();
        let received = self.0.with(None, move |rig| {
            let received = rig.receive(room, timeout.as_secs_f64());
            (!received.is_empty() || !rig.bench.has_failed()).then_some(received)
        });
        let bytes = received.ok_or_else(|| LinkError::Closed { port: self.name().to_owned() })?;
        buffer[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }

    fn now_s(&self) -> f64 {
        self.0.now_s()
    }

    fn name(&self) -> &str {
        self.0.name
    }
}

#[cfg(test)]
mod stop_times;
#[cfg(test)]
mod tests;
