//! A board in this process: the firmware's library with a plant, in virtual time.
//!
//! [`Bench`] is the board without threads: somebody steps it and sees its pins. [`InProcess`] is a handle to a bench in a
//! thread, for a client that waits on a link: time passes while somebody waits on the board's [`Link`] or calls
//! [`InProcess::pass`], one millisecond a step. A run is repeated exactly by repeating its calls.
//!
//! The firmware drives the real shift driver and the real servo bus; the chain of eight 74HC595 is decoded from the edges
//! of four pins. What the chip's own layer does, moving bytes by interrupts and writing flash, is left out; that is seen
//! with the image in the emulator.

mod bench;
mod board;
mod flash;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Sender};
use std::thread;
use std::time::Duration;

use crate::link::{Link, LinkError};
use crate::plant::camera::{Camera, Film};
use crate::plant::{Broken, Plant, PlantState};
pub use bench::{Bench, Physical};
pub use board::{DEVICE, Pin};
pub use flash::{FlashError, MemoryFlash};

/// What the board's thread is asked to do.
type Order = Box<dyn FnOnce(&mut Rig) + Send>;

/// A board with its plant. Clones are the same board; it ends with the last of them.
///
/// The firmware's futures cannot change threads, so the board has a separate one, which only acts while somebody waits
/// for it.
#[derive(Clone)]
pub struct InProcess {
    orders: Sender<Order>,
    /// Time since the beginning, in nanoseconds.
    now_ns: Arc<AtomicU64>,
}

/// What the board's thread owns.
struct Rig {
    bench: Bench,
    camera: Camera,
    now_ns: Arc<AtomicU64>,
}

impl InProcess {
    /// Starts a board with this flash and this plant.
    ///
    /// # Errors
    ///
    /// The thread of the board cannot start.
    pub fn boot(plant: Plant, flash: MemoryFlash) -> std::io::Result<Self> {
        let (orders, todo) = mpsc::channel::<Order>();
        let now_ns = Arc::new(AtomicU64::new(0));
        let shown = now_ns.clone();
        thread::Builder::new().name("board".into()).spawn(move || {
            let mut rig = Rig { bench: Bench::new(plant, flash), camera: Camera::default(), now_ns: shown };
            todo.iter().for_each(|order| order(&mut rig));
        })?;
        Ok(Self { orders, now_ns })
    }

    /// A plug of the board's console.
    pub fn link(&self) -> Box<dyn Link> {
        Box::new(Plug(self.clone()))
    }

    /// Lets time pass.
    pub fn pass(&self, span_s: f64) {
        self.with((), move |rig| {
            let end_s = rig.bench.now_s() + span_s;
            while rig.bench.now_s() < end_s {
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
            let now_s = rig.bench.now_s();
            rig.bench.plant_mut().set_broken(now_s, broken);
        });
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
        self.with((), |rig| {
            rig.bench.power_off();
            rig.bench.power_on(0);
        });
    }

    /// Has the board's thread do something and waits for it; `ended` if the thread has ended by a panic.
    fn with<T: Send + 'static>(&self, ended: T, act: impl FnOnce(&mut Rig) -> T + Send + 'static) -> T {
        let (answer, answered) = mpsc::channel();
        let order = move |rig: &mut Rig| {
            // The asker waits below.
            let _ = answer.send(act(rig));
        };
        if self.orders.send(Box::new(order)).is_err() {
            return ended;
        }
        answered.recv().unwrap_or(ended)
    }
}

impl Rig {
    /// One tick. Nobody looks at the pins.
    fn step(&mut self) {
        self.bench.step();
        drop(self.bench.take_happened());
        self.camera.look(self.bench.now_s(), self.bench.plant());
        self.now_ns.store(self.bench.now_ns(), Ordering::Relaxed);
    }

    /// Waits for bytes to the host, at most `timeout_s`.
    fn receive(&mut self, room: usize, timeout_s: f64) -> Vec<u8> {
        let end_s = self.bench.now_s() + timeout_s;
        while self.bench.received().is_empty() && self.bench.now_s() < end_s {
            self.step();
        }
        let received = self.bench.received();
        let count = room.min(received.len());
        received.drain(..count).collect()
    }
}

/// The host's end of the console.
struct Plug(InProcess);

impl Link for Plug {
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
        let received = self.0.with(None, move |rig| Some(rig.receive(room, timeout.as_secs_f64())));
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
