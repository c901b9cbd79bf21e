//! The plant at the emulator's pins, in real time: one thread follows edges and sets switches, one answers as the servos.

use std::io::{ErrorKind, Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use darm_core::output::{MAX_LINES, Wiring};

use crate::plant::camera::{Camera, Film};
use crate::plant::chain::Chain;
use crate::plant::{Broken, Plant, PlantState};
use crate::qemu::qtest::{Edge, Qtest, QtestError};
use crate::qemu::{Qemu, board};
use darm_device::clock::host_now_s;

/// After a reset the emulated machine has forgotten the levels of its inputs, and says nothing of it: they are set again so
/// often.
const REFRESH: Duration = Duration::from_millis(20);
/// How often a thread looks whether it is to end.
const LOOK: Duration = Duration::from_millis(20);

/// A plant that follows an emulated board. It lets go when dropped.
pub struct Follower {
    plant: Arc<Mutex<Plant>>,
    film: Film,
    end: Arc<AtomicBool>,
    button: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

/// Why the plant cannot follow the board.
#[derive(Debug, thiserror::Error)]
pub enum FollowError {
    /// The test socket failed.
    #[error(transparent)]
    Pins(#[from] QtestError),
    /// The servo bus could not be opened, or a thread could not start.
    #[error("the emulator's servo bus: {0}")]
    Bus(#[from] std::io::Error),
    /// A limit switch is wired to an input that the board does not have.
    #[error("the board has switch inputs 0 to {}, not {input}", board::SWITCHES.len() - 1)]
    Input {
        /// The input in the wiring.
        input: u8,
    },
}

impl Follower {
    /// Connects a plant to a machine that does not run yet, so that it sees every edge from the first.
    ///
    /// # Errors
    ///
    /// [`FollowError::Input`]: a limit switch is wired to an input that the board does not have. [`FollowError::Pins`],
    /// [`FollowError::Bus`]: the emulator does not answer at its test socket or servo bus, or a thread cannot start.
    pub fn start(qemu: &Qemu, wiring: &Wiring, plant: Plant) -> Result<Self, FollowError> {
        let inputs = wiring.actuators.iter().filter_map(|actuator| actuator.switch).map(|switch| switch.input);
        if let Some(input) = inputs.filter(|&input| usize::from(input) >= board::SWITCHES.len()).max() {
            return Err(FollowError::Input { input });
        }
        let (mut qtest, edges) = Qtest::connect(&qemu.pins_socket())?;
        let levels = board::intercept_chain(&mut qtest)?;
        let camera = Camera::default();
        let film = camera.film();
        let bus = qemu.connect_servo_bus()?;
        bus.set_read_timeout(Some(LOOK))?;
        let shared = Arc::new(Mutex::new(plant));
        let end = Arc::new(AtomicBool::new(false));
        let button = Arc::new(AtomicBool::new(false));
        let chain = Chain::new(board::CHAIN, MAX_LINES / 8, levels);
        let (shown, pressed, refreshed) = (0, false, Instant::now());
        let (plant, end_of_pins, button_of_pins) = (shared.clone(), end.clone(), button.clone());
        let mut pins =
            Pins { plant, end: end_of_pins, qtest, chain, camera, shown, refreshed, button: button_of_pins, pressed };
        pins.show_switches()?;
        let (bus_plant, bus_end) = (shared.clone(), end.clone());
        let threads = vec![
            thread::Builder::new().name("plant-pins".into()).spawn(move || pins.follow(&edges))?,
            thread::Builder::new().name("plant-bus".into()).spawn(move || answer(bus, &bus_plant, &bus_end))?,
        ];
        Ok(Self { plant: shared, film, end, button, threads })
    }

    /// Where the plant is now.
    pub fn state(&self) -> PlantState {
        let mut plant = lock(&self.plant);
        plant.advance(host_now_s());
        plant.state()
    }

    /// Levels of the board's output lines.
    pub fn lines(&self) -> u64 {
        lock(&self.plant).lines()
    }

    /// Breaks or repairs something, from now on.
    pub fn set_broken(&self, broken: Broken) {
        lock(&self.plant).set_broken(host_now_s(), broken);
    }

    /// A person holds the board's user button, or releases it. Returns before the pin has changed, by a few
    /// milliseconds.
    pub fn hold_button(&self, pressed: bool) {
        self.button.store(pressed, Ordering::Relaxed);
    }

    /// What the camera takes.
    pub fn film(&self) -> Film {
        self.film.clone()
    }

    /// Lets go of the board and returns the plant in its present state, for the next board on the same metal.
    pub fn stop(mut self) -> Plant {
        self.join();
        lock(&self.plant).clone()
    }

    fn join(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

impl Drop for Follower {
    fn drop(&mut self) {
        self.join();
    }
}

/// A panic of the other thread leaves the plant as it stood.
fn lock(plant: &Mutex<Plant>) -> MutexGuard<'_, Plant> {
    plant.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What the thread at the pins holds.
struct Pins {
    plant: Arc<Mutex<Plant>>,
    end: Arc<AtomicBool>,
    qtest: Qtest,
    chain: Chain,
    camera: Camera,
    /// Switches as the board's inputs show them.
    shown: u32,
    /// When they were all set last.
    refreshed: Instant,
    /// Whether the user button is to be pressed, and whether it is.
    button: Arc<AtomicBool>,
    pressed: bool,
}

impl Pins {
    /// Follows the edges until the emulator ends or nobody wants it any more.
    fn follow(&mut self, edges: &Receiver<Edge>) {
        while !self.end.load(Ordering::Relaxed) {
            match edges.recv_timeout(self.wait()) {
                Ok(edge) => {
                    self.take(edge);
                    edges.try_iter().for_each(|edge| self.take(edge));
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            if self.look().is_err() {
                return;
            }
        }
    }

    /// Until the plant or the camera has something to do.
    fn wait(&self) -> Duration {
        let now_s = host_now_s();
        let plant_s = lock(&self.plant).next_event_s().unwrap_or(f64::MAX);
        let wait_s = plant_s.min(self.camera.due_s()) - now_s;
        Duration::from_secs_f64(wait_s.clamp(0.0, LOOK.as_secs_f64()))
    }

    fn take(&mut self, edge: Edge) {
        if let Some(lines) = self.chain.edge(edge.pin, edge.high) {
            lock(&self.plant).set_lines(edge.at_s, lines);
        }
    }

    fn look(&mut self) -> Result<(), QtestError> {
        let now_s = host_now_s();
        {
            let mut plant = lock(&self.plant);
            plant.advance(now_s);
            self.camera.look(now_s, &plant);
        }
        self.show_switches()
    }

    /// Sets the board's inputs that have changed, and from time to time those that a reset would have changed: closed
    /// switches and the button.
    fn show_switches(&mut self) -> Result<(), QtestError> {
        let switches = lock(&self.plant).switches();
        let again = self.refreshed.elapsed() >= REFRESH;
        if again {
            self.refreshed = Instant::now();
        }
        for (input, &(bank, pin)) in board::SWITCHES.iter().enumerate() {
            let closed = switches >> input & 1 == 1;
            if closed != (self.shown >> input & 1 == 1) || closed && again {
                self.qtest.set_input(bank, pin, closed)?;
            }
        }
        self.shown = switches;
        let is_pressed = self.button.load(Ordering::Relaxed);
        if is_pressed != self.pressed || is_pressed && again {
            let (bank, pin) = board::BUTTON;
            self.qtest.set_input(bank, pin, !is_pressed)?;
            self.pressed = is_pressed;
        }
        Ok(())
    }
}

/// Answers as the servos until the emulator ends or nobody wants it any more.
fn answer(mut bus: UnixStream, plant: &Mutex<Plant>, end: &AtomicBool) {
    let mut buffer = [0; 256];
    while !end.load(Ordering::Relaxed) {
        match bus.read(&mut buffer) {
            Ok(0) => return,
            Ok(count) => {
                let answers = lock(plant).servo_bytes(host_now_s(), &buffer[..count]);
                if bus.write_all(&answers).is_err() {
                    return;
                }
            }
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(_) => return,
        }
    }
}
