//! The connection to a board whose program is followed: it may break, the program runs on.

use std::time::{Duration, Instant};

use darm_core::units::Digest;
use darm_core::wire::message::Refusal;
use darm_device::client::{Client, ClientError, Happening};
use serde::Serialize;

use super::RecordError;
use crate::commands::play::Watch;
use crate::voice::Voice;
use crate::{interrupt, port};

/// Time between two questions to the board, and between two attempts to open a lost port.
pub(crate) const POLL: Duration = Duration::from_millis(50);

/// A connection that was lost.
#[derive(Debug, Serialize)]
pub(crate) struct Lost {
    reason: String,
    /// Until it was opened again; `None` where it never was.
    lasted_s: Option<f64>,
}

/// A connection that is opened again when it breaks.
pub(crate) struct Program {
    pub(crate) client: Client,
    pub(crate) watch: Watch,
    pub(crate) interrupt: interrupt::Watch,
    /// Start of the board and its table, when the connection was opened.
    held: Option<Held>,
    lost: Option<Instant>,
    /// Connections that were lost and opened again.
    pub(crate) lost_connections: Vec<Lost>,
    /// A lost port is waited for so long.
    pub(crate) patience: Duration,
    voice: Voice,
}

impl Program {
    /// Follows by `watch` what the board does.
    pub(crate) fn new(
        client: Client,
        watch: Watch,
        interrupt: interrupt::Watch,
        patience: Duration,
        voice: Voice,
    ) -> Self {
        let held = held(&client);
        Self { client, watch, interrupt, held, lost: None, lost_connections: Vec::new(), patience, voice }
    }

    /// What happened since the last look; `None` while the connection is lost.
    pub(crate) fn look(&mut self) -> anyhow::Result<Option<Vec<Happening>>> {
        if let Some(since) = self.lost {
            match self.reconnect() {
                Ok(()) => self.connected(since),
                Err(error) if since.elapsed() > self.patience => return Err(error),
                Err(_) => return Ok(None),
            }
            self.check_board()?;
            self.lost = None;
        }
        match self.watch.look(&mut self.client) {
            Ok(happenings) => Ok(Some(happenings)),
            Err(error) => self.take(error).map(|()| None),
        }
    }

    /// A broken connection is waited for; one that another program has ended is opened again; anything else is an error.
    fn take(&mut self, error: anyhow::Error) -> anyhow::Result<()> {
        match error.downcast_ref::<ClientError>() {
            Some(ClientError::Transport(_) | ClientError::Frame(_)) => {
                self.voice.note(&format!("{error}; the program runs on, waiting for the port"));
                self.lost_connections.push(Lost { reason: error.to_string(), lasted_s: None });
                self.lost = Some(Instant::now());
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

    fn reconnect(&mut self) -> anyhow::Result<()> {
        let (link, handle) = port::open(self.client.port())?;
        self.interrupt.use_handle(handle);
        let replugged = self.client.replug(link);
        if replugged.is_err() {
            self.client.unplug();
        }
        Ok(replugged?)
    }

    fn connected(&mut self, since: Instant) {
        self.voice.note("connected again");
        if let Some(lost) = self.lost_connections.last_mut() {
            lost.lasted_s = Some(since.elapsed().as_secs_f64());
        }
    }

    /// Refuses a board that has restarted or got another table since the program was started.
    fn check_board(&self) -> anyhow::Result<()> {
        match (held(&self.client), self.held) {
            (Some((boots, _)), Some((before, _))) if boots != before => Err(RecordError::Restarted.into()),
            (Some((_, table)), Some((_, before))) if table != before => Err(RecordError::Replaced.into()),
            _ => Ok(()),
        }
    }
}

/// How often the board has started, and the digest of its table.
type Held = (u32, Option<Digest>);

fn held(client: &Client) -> Option<Held> {
    client.hello().map(|hello| (hello.boots, hello.table))
}
