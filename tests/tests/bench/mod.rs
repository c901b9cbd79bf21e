//! An emulated board with a plant at its pins, as the tests need it.

mod tables;

use std::fs::File;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use darm_core::output::Wiring;
use darm_core::sequencer::Event;
use darm_core::units::Word;
use darm_device::client::{Client, TimedEvent};
use darm_device::clock::HostTime;
use darm_device::link::{Link, LinkError};
use darm_sim::follow::Follower;
use darm_sim::in_process::MemoryFlash;
use darm_sim::plant::Plant;
use darm_sim::plant::camera::Film;
use darm_sim::qemu::{self, Console, Machine, Qemu};

use crate::emulator::{self, Ready};
pub(crate) use tables::{profile, servo_angle_rad, stepped, table, table_with, wiring};

/// Longest wait for anything: a loaded machine is slow, not wrong.
const LIMIT: Duration = Duration::from_secs(60);
/// A motion takes 50 ms of plant and the delays of the emulator.
pub(crate) const SETTLE_S: f64 = 0.1;

/// A running board.
pub(crate) struct Bench {
    pub(crate) qemu: Qemu,
    pub(crate) follower: Follower,
    pub(crate) wiring: Wiring,
    machine: Machine,
    _folder: tempfile::TempDir,
    _lock: File,
}

impl Bench {
    /// Boots a board without a table, with twelve valves, and one servo if wanted. `None`, said loudly, where it cannot run.
    pub(crate) fn start(console: Console, servo: bool) -> Option<Self> {
        let Ready { elf, lock } = emulator::ready()?;
        let folder = tempfile::tempdir().unwrap();
        let machine = Machine::new(elf, folder.path().to_owned(), console);
        let wiring = wiring(servo);
        let flash = MemoryFlash::with_profile(&profile(&wiring).image());
        std::fs::write(folder.path().join(qemu::FLASH_FILE), flash.bytes()).unwrap();
        let (qemu, follower) = boot(&machine, &wiring, Plant::new(&wiring, &[]));
        Some(Self { qemu, follower, wiring, machine, _folder: folder, _lock: lock })
    }

    /// Kills the emulator and starts another one on the same flash.
    pub(crate) fn power_cycle(&mut self) {
        let (qemu, follower) = {
            let mut fresh = Plant::new(&self.wiring, &[]);
            fresh.advance(darm_device::clock::host_now_s());
            self.qemu.cut_power();
            boot(&self.machine, &self.wiring, fresh)
        };
        (self.qemu, self.follower) = (qemu, follower);
    }

    /// Opens the board's port.
    pub(crate) fn link(&self) -> Box<dyn Link> {
        darm_device::link::open(self.qemu.console_port()).unwrap()
    }

    /// Connects as a host does.
    pub(crate) fn connect(&self) -> Client {
        Client::connect(self.link()).unwrap()
    }

    /// What the camera takes.
    pub(crate) fn film(&self) -> Film {
        self.follower.film()
    }
}

fn boot(machine: &Machine, wiring: &Wiring, plant: Plant) -> (Qemu, Follower) {
    let mut qemu = Qemu::start(machine).unwrap();
    let follower = Follower::start(&qemu, wiring, plant).unwrap();
    qemu.resume().unwrap();
    (qemu, follower)
}

/// Waits for something to become true.
#[track_caller]
pub(crate) fn wait(what: &str, mut is_so: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < LIMIT, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// All events since the board's start until one of a kind has come.
#[track_caller]
pub(crate) fn events_until(client: &mut Client, is_last: impl Fn(Event) -> bool) -> Vec<TimedEvent> {
    let mut happened: Vec<TimedEvent> = Vec::new();
    wait("the last event", || {
        let from = happened.last().map_or(0, |last| last.number + 1);
        happened.extend(client.events(from).unwrap());
        happened.iter().any(|timed| is_last(timed.event))
    });
    happened
}

/// The words of the rows that went out.
pub(crate) fn row_words(happened: &[TimedEvent]) -> Vec<Word> {
    happened.iter().filter_map(|h| if let Event::Row { word, .. } = h.event { Some(word) } else { None }).collect()
}

/// A row that went out, and the word before it.
#[derive(Clone, Copy)]
pub(crate) struct RowTime {
    pub(crate) at: HostTime,
    pub(crate) word: Word,
    pub(crate) previous: Word,
}

/// Start and end of every row but the last, in host time.
pub(crate) fn rows_in_host_time(client: &Client, happened: &[TimedEvent]) -> Vec<(RowTime, RowTime)> {
    let mut previous = Word::zeros(12).unwrap();
    let mut rows = Vec::new();
    for timed in happened {
        if let Event::Row { word, .. } = timed.event {
            let at = client.clock().host_time(1e-6 * timed.at.0 as f64).unwrap();
            rows.push(RowTime { at, word, previous });
            previous = word;
        }
    }
    rows.windows(2).map(|pair| (pair[0], pair[1])).collect()
}

/// Types a line and listens until the answer holds a text.
pub(crate) fn type_and_hear(client: &mut Client, line: &str, wanted: &str) -> String {
    let heard = Arc::new(Mutex::new(Vec::new()));
    let ear = heard.clone();
    client.set_on_text(move |text| ear.lock().unwrap().extend_from_slice(text));
    client.type_line(line).unwrap();
    let text = || String::from_utf8_lossy(&heard.lock().unwrap()).into_owned();
    wait(wanted, || {
        client.listen(0.05).unwrap();
        text().contains(wanted)
    });
    text()
}

/// A link whose cable is pulled after so many bytes from the host.
struct Cut {
    inner: Box<dyn Link>,
    left: usize,
}

impl Link for Cut {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        match self.left.checked_sub(bytes.len()) {
            Some(left) => {
                self.left = left;
                self.inner.send(bytes)
            }
            None => {
                self.inner.send(&bytes[..self.left])?;
                self.left = 0;
                Err(LinkError::Closed { port: self.name().to_owned() })
            }
        }
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        self.inner.receive(buffer, timeout)
    }

    fn now_s(&self) -> f64 {
        self.inner.now_s()
    }

    fn name(&self) -> &str {
        self.inner.name()
    }
}

/// Pulls a link's cable after so many bytes from the host.
pub(crate) fn cut_after(inner: Box<dyn Link>, bytes: usize) -> Box<dyn Link> {
    Box::new(Cut { inner, left: bytes })
}
