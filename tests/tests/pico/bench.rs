//! A running board that has its profile.

use std::path::PathBuf;

use darm_arm::board_profile::BoardProfile;
use darm_core::output::Wiring;
use darm_core::sequencer::Event;
use darm_core::units::Word;
use darm_device::client::{Client, TimedEvent};
use darm_sim::in_process::InProcess;
use darm_sim::pico::{self, PicoBench};
use darm_sim::plant::Plant;

use crate::missing::{missing, target};
use crate::tables::{profile, wiring};

/// Longest wait for anything, in the board's time.
const LIMIT_S: f64 = 60.0;

/// A running board that has its profile.
pub(crate) struct Bench {
    pub(crate) board: InProcess<PicoBench>,
    pub(crate) wiring: Wiring,
    pub(crate) folder: tempfile::TempDir,
}

fn image() -> Option<PathBuf> {
    if let Err(error) = pico::find() {
        return missing(&error.to_string());
    }
    let elf = target().join("thumbv6m-none-eabi/firmware/pico");
    if elf.exists() { Some(elf) } else { missing(&pico::PicoError::NoImage(elf).to_string()) }
}

impl Bench {
    pub(crate) fn start(servo: bool) -> Option<Self> {
        Self::wired(wiring(servo))
    }

    pub(crate) fn wired(wiring: Wiring) -> Option<Self> {
        let profile = profile(&wiring);
        Self::with_profile(wiring, &profile)
    }

    pub(crate) fn with_profile(wiring: Wiring, profile: &BoardProfile) -> Option<Self> {
        let elf = image()?;
        let folder = tempfile::tempdir().unwrap();
        let board = pico::boot(&elf, folder.path(), Plant::new(&wiring, &[])).unwrap();
        pico::write_profile(&board, &profile.image()).unwrap();
        Some(Self { board, wiring, folder })
    }

    pub(crate) fn connect(&self) -> Client {
        Client::connect(self.board.link()).unwrap()
    }

    /// Lets time pass until something is so.
    #[track_caller]
    pub(crate) fn wait(&self, what: &str, mut is_so: impl FnMut() -> bool) {
        let end_s = self.board.now_s() + LIMIT_S;
        while !is_so() {
            assert!(self.board.now_s() < end_s, "waited in vain for {what}");
            self.board.pass(0.002);
        }
    }

    pub(crate) fn reached(&self) -> Word {
        self.board.state().unwrap().reached
    }

    pub(crate) fn lines(&self) -> u64 {
        self.with(|bench| darm_sim::in_process::Stepped::plant(bench).lines())
    }

    pub(crate) fn with<T: Send + 'static>(&self, act: impl FnOnce(&mut PicoBench) -> T + Send + 'static) -> T {
        self.board.with_board(act).expect("the board's thread runs")
    }

    /// All events since the board's start until one of a kind has come.
    #[track_caller]
    pub(crate) fn events_until(&self, client: &mut Client, is_last: impl Fn(Event) -> bool) -> Vec<TimedEvent> {
        let mut happened: Vec<TimedEvent> = Vec::new();
        self.wait("the last event", || {
            let from = happened.last().map_or(0, |last| last.number + 1);
            happened.extend(client.events(from).unwrap());
            happened.iter().any(|timed| is_last(timed.event))
        });
        happened
    }
}
