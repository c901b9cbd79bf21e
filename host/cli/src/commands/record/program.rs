//! The connection to a board whose program is followed; the program continues when it breaks.

use std::time::{Duration, Instant};

use darm_core::units::Digest;
use darm_core::wire::message::Refusal;
use darm_device::client::{Client, ClientError, TimedEvent};
use darm_device::strokes::InputHistory;
use serde::Serialize;

use super::RecordError;
use crate::commands::play::ProgramMonitor;
use crate::guests::Role;
use crate::ui::Ui;
use crate::{interrupt, port};

/// Interval between two requests, and between two attempts to open a lost port.
pub(crate) const POLL: Duration = Duration::from_millis(50);

/// How long a connection is lost until the user is reminded, and how often after that.
const FIRST_REMINDER: Duration = Duration::from_secs(2);
const REMINDERS: Duration = Duration::from_secs(10);

/// A connection that was lost.
#[derive(Debug, Serialize)]
pub(crate) struct LostConnection {
    reason: String,
    /// Time until it was reopened; `None` where it never was.
    lasted_s: Option<f64>,
}

/// A connection that is reopened when it breaks.
pub(crate) struct Program {
    pub(crate) client: Client,
    pub(crate) monitor: ProgramMonitor,
    pub(crate) interrupt: interrupt::InterruptHandler,
    /// When the inputs changed; `None` where the firmware does not say.
    pub(crate) inputs: Option<InputHistory>,
    /// Start and table of the board when the connection was opened.
    board_state: Option<BoardState>,
    lost: Option<Instant>,
    /// How long the connection is to be lost until the user is reminded.
    next_reminder: Duration,
    /// Connections that were lost.
    pub(crate) lost_connections: Vec<LostConnection>,
    /// Longest wait for a lost port.
    pub(crate) reconnect_timeout: Duration,
    pub(crate) ui: Ui,
}

impl Program {
    /// Follows the board with `monitor`.
    pub(crate) fn new(
        client: Client,
        monitor: ProgramMonitor,
        interrupt: interrupt::InterruptHandler,
        reconnect_timeout: Duration,
        ui: Ui,
    ) -> Self {
        let board_state = board_state(&client);
        Self {
            client,
            monitor,
            interrupt,
            inputs: Some(InputHistory::default()),
            board_state,
            lost: None,
            next_reminder: FIRST_REMINDER,
            lost_connections: Vec::new(),
            reconnect_timeout,
            ui,
        }
    }

    /// Events since the last poll; `None` while the connection is lost.
    pub(crate) fn poll(&mut self) -> anyhow::Result<Option<Vec<TimedEvent>>> {
        if let Some(since) = self.lost {
            match self.reconnect() {
                Ok(()) => self.connected(since),
                Err(error) if since.elapsed() > self.reconnect_timeout => return Err(error),
                Err(_) => {
                    self.remind_of_port(since);
                    return Ok(None);
                }
            }
            self.check_board()?;
            self.lost = None;
        }
        match self.poll_inputs().and_then(|()| self.monitor.poll(&mut self.client)) {
            Ok(events) => Ok(Some(events)),
            Err(error) => self.handle_error(error).map(|()| None),
        }
    }

    /// Fetches the changes of the inputs since the last poll.
    fn poll_inputs(&mut self) -> anyhow::Result<()> {
        while let Some(inputs) = &mut self.inputs {
            match self.client.input_changes(inputs.next())? {
                Some(answer) if inputs.take(&answer) => {}
                Some(_) => break,
                None => self.inputs = None,
            }
        }
        Ok(())
    }

    /// Waits for a broken connection, reopens one that another program ended; any other error is returned.
    fn handle_error(&mut self, error: anyhow::Error) -> anyhow::Result<()> {
        match error.downcast_ref::<ClientError>() {
            Some(ClientError::Transport(_) | ClientError::Frame(_)) => {
                let limit_s = self.reconnect_timeout.as_secs();
                let text =
                    format!("connection lost: {error}. The board's program continues; trying the port for {limit_s} s");
                self.ui.note(&text);
                self.lost_connections.push(LostConnection { reason: error.to_string(), lasted_s: None });
                self.lost = Some(Instant::now());
                self.next_reminder = FIRST_REMINDER;
                self.client.unplug();
                Ok(())
            }
            Some(ClientError::Refused(Refusal::NotConnected)) => {
                self.client.say_hello()?;
                self.check_board()
            }
            _ => Err(error),
        }
    }

    /// After 2 s and from then on from time to time: whether the port is there, and how long it is waited for.
    fn remind_of_port(&mut self, since: Instant) {
        if since.elapsed() < self.next_reminder {
            return;
        }
        self.next_reminder += REMINDERS;
        let (port, left_s) = (self.client.port(), self.reconnect_timeout.saturating_sub(since.elapsed()).as_secs());
        let what = if port::has_vanished(port) { "vanished" } else { "does not answer" };
        self.ui.note(&format!("the port {port} {what}; waiting for it, {left_s} s left; Ctrl-C ends the recording"));
    }

    fn reconnect(&mut self) -> anyhow::Result<()> {
        let (link, handle) = port::open(self.client.port())?;
        port::share(&self.client, &handle, Role::Controls);
        self.interrupt.use_handle(handle);
        let replugged = self.client.replug(link);
        if replugged.is_err() {
            self.client.unplug();
        }
        Ok(replugged?)
    }

    fn connected(&mut self, since: Instant) {
        self.ui.note("reconnected");
        if let Some(lost) = self.lost_connections.last_mut() {
            lost.lasted_s = Some(since.elapsed().as_secs_f64());
        }
    }

    /// Rejects a board that has restarted or has another table since the program was started.
    fn check_board(&self) -> anyhow::Result<()> {
        match (board_state(&self.client), self.board_state) {
            (Some((boots, _)), Some((before, _))) if boots != before => Err(RecordError::Restarted.into()),
            (Some((_, table)), Some((_, before))) if table != before => Err(RecordError::Replaced.into()),
            _ => Ok(()),
        }
    }
}

/// How often the board has started, and the digest of its table.
type BoardState = (u32, Option<Digest>);

fn board_state(client: &Client) -> Option<BoardState> {
    client.hello().map(|hello| (hello.boots, hello.table))
}
