//! Ctrl-C and SIGTERM while the arm moves: stops the arm and reports whether the board confirmed the stop.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use anyhow::Context as _;
use darm_core::sequencer::Command;
use darm_device::client::Client;
use darm_device::client::stop::{Confirmation, STOP_BOUND, StopHandle};
use darm_device::link::LinkError;

use crate::failure::Occupied;
use crate::interrupted::Interrupted;
use crate::{failure, port};

/// Time for the command to write its data and end by itself.
const GRACE: Duration = Duration::from_millis(1500);
/// Interval at which the end of a stop is polled.
const POLL: Duration = Duration::from_millis(10);

/// Handler of interrupts.
#[derive(Clone)]
pub(crate) struct InterruptHandler(Arc<Mutex<State>>);

struct State {
    port: String,
    handle: StopHandle,
    requested: bool,
    /// How the command continues after an interrupt.
    next: &'static str,
    stopped: Option<Result<Confirmation, Arc<LinkError>>>,
}

impl InterruptHandler {
    /// Installs the handler: Ctrl-C and SIGTERM stop the board at this port.
    pub(crate) fn start(port: &str, handle: StopHandle) -> anyhow::Result<Self> {
        let state = State { port: port.to_owned(), handle, requested: false, next: "", stopped: None };
        let handler = Self(Arc::new(Mutex::new(state)));
        let interrupted = handler.clone();
        ctrlc::set_handler(move || interrupted.stop()).context("cannot wait for Ctrl-C")?;
        Ok(handler)
    }

    /// An interrupt reports how the command continues.
    pub(crate) fn report_next(&self, next: &'static str) {
        self.state().next = next;
    }

    /// The port was reopened.
    pub(crate) fn use_handle(&self, handle: StopHandle) {
        self.state().handle = handle;
    }

    /// Result of the stop, if there was an interrupt. Waits for the end of a running stop.
    pub(crate) fn interrupted(&self) -> Option<Interrupted> {
        loop {
            let state = self.state();
            if let (true, None) = (state.requested, &state.stopped) {
                drop(state);
                thread::sleep(POLL);
                continue;
            }
            return state.stopped.clone().map(|stopped| Interrupted { stopped, next: state.next });
        }
    }

    /// Whether there was an interrupt. Does not wait for its stop.
    pub(crate) fn is_requested(&self) -> bool {
        self.state().requested
    }

    /// Starts the board's program, unless there was an interrupt. An interrupt during the request sends a stop, after
    /// which the board refuses requests from before it.
    pub(crate) fn play(&self, client: &mut Client) -> anyhow::Result<()> {
        if let Some(interrupted) = self.interrupted() {
            return Err(interrupted.into());
        }
        let played = client.command(Command::Play);
        match self.interrupted() {
            Some(interrupted) => Err(interrupted.into()),
            None => played.map_err(|error| Occupied::explain(client, error)),
        }
    }

    fn stop(&self) {
        let (port, handle) = {
            let mut state = self.state();
            state.requested = true;
            (state.port.clone(), state.handle.clone())
        };
        let stopped = handle.stop(STOP_BOUND).or_else(|_| port::stop(&port));
        self.state().stopped = Some(stopped.map_err(Arc::new));
        thread::sleep(GRACE);
        if let Some(interrupted) = self.interrupted() {
            let error = interrupted.into();
            eprintln!("darm: {}", failure::sentence(&error));
            std::process::exit(failure::code(&error).into());
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
