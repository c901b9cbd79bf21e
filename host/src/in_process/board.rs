//! The firmware's own tasks as one future, with wires instead of pins.

use std::future::{Future, poll_fn};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::task::Poll;

use darm_core::table::Table;
use darm_core::units::{DeviceId, Micros};
use darm_core::wire::bootstrap::{Identity, Into};
use darm_firmware::app::serve;
use darm_firmware::clock::Clock;
use darm_firmware::control::{Control, Shared, TICK};
use darm_firmware::dispatch::{Board, Desk};
use darm_firmware::nearest::Room;
use darm_firmware::pipe::{Pipe, PipeReader, PipeWriter};
use darm_firmware::servo::Bus;
use embassy_futures::select::{Either3, select3};

use super::flash::MemoryFlash;

/// Time that somebody else moves.
#[derive(Default)]
pub(super) struct HandClock(AtomicU64);

impl HandClock {
    /// Moves the time on.
    pub(super) fn pass(&self, span: Micros) {
        self.0.fetch_add(span.0, Ordering::Relaxed);
    }
}

impl Clock for HandClock {
    fn now(&self) -> Micros {
        Micros(self.0.load(Ordering::Relaxed))
    }

    fn wait_until(&self, at: Micros) -> impl Future<Output = ()> {
        poll_fn(move |_| if self.now() >= at { Poll::Ready(()) } else { Poll::Pending })
    }
}

/// What leads in and out of the board.
#[derive(Default)]
pub(super) struct Wires {
    pub(super) clock: HandClock,
    pub(super) console_in: Pipe<1024>,
    pub(super) console_out: Pipe<1024>,
    pub(super) bus_in: Pipe<256>,
    pub(super) bus_out: Pipe<256>,
    /// Levels of the output lines, all low while they are disabled.
    pub(super) lines: AtomicU64,
    pub(super) switches: AtomicU32,
}

/// Runs the firmware from its start until somebody asks for a restart.
pub(super) async fn run(wires: Arc<Wires>, flash: MemoryFlash) -> Into {
    let mut table = Box::<Table>::default();
    let mut room = Box::<Room>::default();
    let shared = Shared::new();
    let console = async {
        let board = "in-process".parse().unwrap_or_default();
        let identity = Identity { device: DeviceId(*b"in-process!!"), board };
        let mut desk = Desk::new(Board { identity, death: None }, &wires.clock, &shared, &mut room);
        desk.open(Some(flash), &mut table).await;
        serve(&mut desk, &mut PipeReader(&wires.console_in), &mut PipeWriter(&wires.console_out)).await
    };
    let bus =
        async { Bus::new(PipeReader(&wires.bus_in), PipeWriter(&wires.bus_out), &wires.clock).run(&shared).await };
    match select3(console, control(&wires, &shared), bus).await {
        Either3::First(into) => into,
        Either3::Second(never) | Either3::Third(never) => never,
    }
}

/// The control task: looks, decides and drives, once a millisecond.
async fn control(wires: &Wires, shared: &Shared<'_>) -> ! {
    let mut control = Control::new(wires.clock.now(), shared);
    let mut due = wires.clock.now();
    loop {
        due = due + TICK;
        wires.clock.wait_until(due).await;
        let now = wires.clock.now();
        let outputs = control.tick(now, due, wires.switches.load(Ordering::Relaxed), shared);
        let lines = if outputs.enabled { outputs.lines } else { 0 };
        wires.lines.store(lines, Ordering::Relaxed);
    }
}
