//! The host's end of the wire: connect, ask, command, upload.
//!
//! Requests are numbered, answered once and sent again at growing intervals until an answer comes; the board runs what
//! changes something exactly once. So a host may be killed and started again at any moment, and a cable pulled.
//! Programs that come while a port is open are guests of the one that has it: [`sharing`].
//!
//! ```no_run
//! use darm_device::client::Client;
//! let mut client = Client::connect(darm_device::link::open("/dev/ttyACM0")?)?;
//! let rows = client.status()?.rows;
//! println!("{} with {rows} rows", client.identity().device);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod board_reports;
mod error;
mod exchange;
#[cfg(test)]
mod fake;
mod line;
mod question;
mod reader;
mod retry_timer;
pub mod sharing;
pub mod stop;
mod upload;

use std::sync::{Arc, MutexGuard};
use std::time::{Duration, Instant};

use darm_arm::image::UploadImage;
use darm_core::nearest::{Coordinates, Found};
use darm_core::se::Pose;
use darm_core::sequencer::{Command, Event};
use darm_core::units::Micros;
use darm_core::wire::PROTOCOL;
use darm_core::wire::bootstrap::{self, CrashRecord, Identity, RebootTarget, Stopped, Version};
use darm_core::wire::message::{Calibration, Doing, Hello, OutputState, Refusal, Reply, Status};

use crate::clock::{BoardClock, RoundTrip, host_now_s};
use crate::link::{Link, LinkError};
pub use error::{AnswerError, ClientError, TransportError};
pub use exchange::Counts;
use exchange::{Arrival, Exchange, Exchanged, Known};
use line::Line;
use question::Question;
use sharing::Rights;
use stop::{Confirmation, StopHandle};
pub use upload::Progress;

/// The time in a reply that no board has made: the process that has the port refuses a guest's request. A board starts before it answers.
const NO_TIME: Micros = Micros(0);

/// For this time a client that goes waits for a guest's exchange, to close the port.
const CLOSE: Duration = Duration::from_millis(500);

/// A connection to one board.
pub struct Client {
    line: Arc<Line>,
    port: String,
    /// The connection that this client has opened: on one that a guest has opened since, as after a stop, it changes nothing.
    connection: Known,
    clock: BoardClock,
    /// Board time of the last answer of the protocol.
    answered_at: Micros,
    identity: Identity,
    version: Version,
    hello: Option<Hello>,
}

/// Something that happened on the board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedEvent {
    /// Its number since the board's start.
    pub number: u32,
    /// When, on the board's clock.
    pub at: Micros,
    /// What.
    pub event: Event,
}

impl Client {
    /// Connects to whatever board is at the port, however it was left. Another host's connection ends.
    ///
    /// A board of another protocol version can be identified, stopped and rebooted; everything else it refuses.
    ///
    /// # Errors
    ///
    /// [`ClientError::Transport`]: the port fails, or no answer comes. [`ClientError::Frame`]: what comes is not a
    /// valid answer. [`ClientError::Refused`]: the board refuses the connection.
    pub fn connect(link: Box<dyn Link>) -> Result<Self, ClientError> {
        Self::connect_as(link, rand::random())
    }

    /// Connects with a given number of the connection, so that a run can be repeated.
    ///
    /// # Errors
    ///
    /// As [`connect`](Self::connect).
    pub fn connect_as(link: Box<dyn Link>, connection: u32) -> Result<Self, ClientError> {
        let port = link.name().to_owned();
        let mut exchange = Exchange::new(link, connection);
        let identity = identify(&mut exchange)?;
        let version = version(&mut exchange)?;
        let line = Arc::new(Line::new(exchange));
        let (clock, answered_at) = (BoardClock::default(), Micros(0));
        let connection = line.take().known();
        let mut client = Self { line, port, connection, clock, answered_at, identity, version, hello: None };
        if version.protocol == PROTOCOL {
            client.say_hello()?;
        }
        Ok(client)
    }

    /// Opens the connection again: after another host has used the board, or the board was restarted.
    ///
    /// # Errors
    ///
    /// As [`connect`](Self::connect).
    pub fn say_hello(&mut self) -> Result<Hello, ClientError> {
        self.hello_by(Exchange::open_connection)
    }

    /// The same without ending the connection of guests where one of them has opened it, after a stop.
    ///
    /// # Errors
    ///
    /// As [`connect`](Self::connect).
    pub fn join(&mut self) -> Result<Hello, ClientError> {
        self.hello_by(Exchange::join_connection)
    }

    /// The number of the connection that this client has opened or joined.
    pub fn connection(&self) -> u32 {
        self.connection.connection
    }

    /// Whether the connection is the one that this client has opened or joined.
    pub fn knows_connection(&self) -> bool {
        self.exchange().known().connection == self.connection.connection
    }

    fn hello_by(
        &mut self,
        say: impl FnOnce(&mut Exchange) -> Result<Exchanged, ClientError>,
    ) -> Result<Hello, ClientError> {
        let (said, connection) = {
            let mut exchange = self.exchange();
            (say(&mut exchange), exchange.known())
        };
        self.connection = connection;
        let Exchanged { arrival, sent_s, .. } = said?;
        let hello = self.read(&question::hello(0), &arrival, sent_s)?;
        self.hello = Some(hello.clone());
        Ok(hello)
    }

    /// What the board says of itself now, on the connection that is open.
    ///
    /// # Errors
    ///
    /// [`Refusal::NotConnected`]: the connection has ended, as by a stop; it is not opened again. Or as [`connect`](Self::connect).
    pub fn renew_hello(&mut self) -> Result<(), ClientError> {
        // With this challenge the board opens no connection.
        match self.ask_anyhow(&question::hello(0)) {
            Err(ClientError::Refused(Refusal::Challenge { .. })) => Err(ClientError::Refused(Refusal::NotConnected)),
            hello => {
                self.hello = Some(hello?);
                Ok(())
            }
        }
    }

    /// Closes the port, so that it can be opened again for [`Client::replug`]; until then every request fails.
    pub fn unplug(&mut self) {
        self.exchange().replace_link(Box::new(Unplugged(self.port.clone())));
    }

    /// Continues over another link to the same board: after the cable was pulled.
    ///
    /// # Errors
    ///
    /// As [`connect`](Self::connect).
    pub fn replug(&mut self, link: Box<dyn Link>) -> Result<(), ClientError> {
        link.name().clone_into(&mut self.port);
        let (identity, version) = {
            let mut exchange = self.exchange();
            exchange.replace_link(link);
            (identify(&mut exchange)?, version(&mut exchange)?)
        };
        (self.identity, self.version) = (identity, version);
        self.say_hello().map(drop)
    }

    /// Who the board is.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// What it runs.
    pub fn version(&self) -> Version {
        self.version
    }

    /// What it said when the connection was opened; nothing if it speaks another version.
    pub fn hello(&self) -> Option<&Hello> {
        self.hello.as_ref()
    }

    /// The port.
    pub fn port(&self) -> &str {
        &self.port
    }

    /// Lets programs that come later use the port as guests, with these rights, for as long as this client has it; `handle` is that
    /// of [`stop::hold`].
    pub fn share(&self, handle: &StopHandle, rights: Arc<dyn Rights>) {
        sharing::share(&self.line, handle, rights);
    }

    /// The host's time on this link.
    pub fn now_s(&self) -> f64 {
        self.exchange().link().now_s()
    }

    /// Board time against host time; every answer makes it better.
    pub fn clock(&self) -> &BoardClock {
        &self.clock
    }

    /// What has gone over the line.
    pub fn counts(&self) -> Counts {
        self.exchange().counts()
    }

    /// Hands text that comes outside frames to `on_text`.
    pub fn set_on_text(&mut self, on_text: impl FnMut(&[u8]) + Send + 'static) {
        self.exchange().set_on_text(Box::new(on_text));
    }

    /// Sends a line as a person would type it; the answer comes as text.
    ///
    /// # Errors
    ///
    /// [`ClientError::Transport`]: the port fails.
    pub fn type_line(&mut self, line: &str) -> Result<(), ClientError> {
        self.exchange().send_raw(format!("{line}\r").as_bytes())
    }

    /// The same for a line that changes something, unless `is_late`: a stop came since a person has typed it, or it waited for too
    /// long. A line belongs to no connection, so the board cannot refuse it.
    ///
    /// # Errors
    ///
    /// [`ClientError::Denied`]: it is late. [`ClientError::Transport`]: the port fails.
    pub fn type_change(&mut self, line: &str, is_late: impl Fn() -> bool) -> Result<(), ClientError> {
        self.exchange().type_change(line, is_late)
    }

    /// Listens for this time, for text and for nothing else.
    ///
    /// # Errors
    ///
    /// [`ClientError::Transport`]: the port fails.
    pub fn listen(&mut self, for_s: f64) -> Result<(), ClientError> {
        self.exchange().listen(for_s)
    }

    /// All coils off at once, in any version of the protocol; what the board confirms. The board takes no command from any
    /// connection that was opened before a stop: [`Client::say_hello`] opens a new one. This is the only stop that a host
    /// sends; that of [`Client::command`] is the same event on the board.
    ///
    /// # Errors
    ///
    /// The port fails, no answer comes, or what comes is not a valid answer.
    pub fn stop(&mut self) -> Result<Confirmation, ClientError> {
        let payload = self.exchange().ask_bootstrap("stop", bootstrap::Request::Stop)?;
        Stopped::decode(&payload).map(Confirmation::of).ok_or(AnswerError::Payload { request: "stop" }.into())
    }

    /// The same, for who asks for nothing more than that the coils are off.
    ///
    /// # Errors
    ///
    /// As [`stop`](Self::stop).
    pub fn stop_at_once(&mut self) -> Result<(), ClientError> {
        self.stop().map(drop)
    }

    /// How the firmware died last, if it did.
    ///
    /// # Errors
    ///
    /// The port fails, no answer comes, or what comes is not a valid answer.
    pub fn last_crash(&mut self) -> Result<Option<CrashRecord>, ClientError> {
        let payload = self.exchange().ask_bootstrap("read fault", bootstrap::Request::ReadFault)?;
        CrashRecord::decode(&payload).ok_or(AnswerError::Payload { request: "read fault" }.into())
    }

    /// Starts the board again; the connection ends.
    ///
    /// # Errors
    ///
    /// The port fails, no answer comes, or what comes is not a valid answer. [`ClientError::NoReboot`]: the board refuses.
    pub fn reboot(&mut self, into: RebootTarget) -> Result<(), ClientError> {
        let answer = self.exchange().ask_bootstrap("reboot", bootstrap::Request::Reboot(into))?;
        match answer.first() {
            Some(0) => Ok(()),
            Some(1) => Err(ClientError::NoReboot(into)),
            Some(_) | None => Err(AnswerError::Payload { request: "reboot" }.into()),
        }
    }

    /// What the board does now.
    ///
    /// # Errors
    ///
    /// [`ClientError::Transport`]: the port fails, or no answer comes. [`ClientError::Frame`]: what comes is not a
    /// valid answer. [`ClientError::Refused`]: the board is of another protocol version, or its connection has ended.
    pub fn status(&mut self) -> Result<Status, ClientError> {
        self.ask(&question::status())
    }

    /// Up to eight things that happened, from a number on; the first number is larger where older ones are lost.
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status).
    pub fn events(&mut self, from: u32) -> Result<Vec<TimedEvent>, ClientError> {
        let events = self.ask(&question::events(from))?;
        let numbered = (events.first..).zip(events.list);
        Ok(numbered.map(|(number, (at, event))| TimedEvent { number, at, event }).collect())
    }

    /// Asks a few times for the status, so that the board's time is known as well as the line allows.
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status).
    pub fn set_clock(&mut self, round_trips: u32) -> Result<&BoardClock, ClientError> {
        for _ in 0..round_trips {
            self.status()?;
        }
        Ok(self.clock())
    }

    /// Does something on the board.
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status); [`ClientError::Refused`] also where the sequencer refuses the command.
    pub fn command(&mut self, command: Command) -> Result<(), ClientError> {
        self.ask(&question::command(command))
    }

    /// Stores the servos' zero offsets on the board.
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status); [`ClientError::Refused`] also where a program runs or the flash cannot be written.
    pub fn calibrate(&mut self, calibration: Calibration) -> Result<(), ClientError> {
        self.ask(&question::calibrate(calibration))
    }

    /// The stored zero offsets of the servos.
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status).
    pub fn calibration(&mut self) -> Result<Option<Calibration>, ClientError> {
        self.ask(&question::calibration())
    }

    /// How long each output of the board's profile has been on, and how long it may be.
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status).
    pub fn outputs(&mut self) -> Result<Vec<OutputState>, ClientError> {
        let (mut outputs, mut from) = (Vec::new(), 0);
        loop {
            let more = self.ask(&question::outputs(from))?;
            let Some(last) = more.last() else { return Ok(outputs) };
            from = last.output.saturating_add(1);
            outputs.extend(more);
        }
    }

    /// A word that brings the tool near a pose in the base, sought by the board among the frames in its table.
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status); [`ClientError::Refused`] also where the target is not a pose or the
    /// board has no frames to seek among.
    pub fn nearest(&mut self, target: &Pose<f64>) -> Result<Found<f32>, ClientError> {
        self.ask(&question::nearest(Coordinates::of(target)))
    }

    /// Brings a table to the board completely or not at all, and returns the number of its rows. An upload that broke
    /// off, even in another run of the host, continues where the board says.
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status); [`ClientError::Refused`] also where the board refuses the image, with its reason.
    pub fn upload(&mut self, image: &UploadImage, progress: &mut dyn FnMut(Progress)) -> Result<u16, ClientError> {
        self.check_version()?;
        upload::upload(self, image, progress)
    }

    fn ask<T>(&mut self, question: &Question<'_, T>) -> Result<T, ClientError> {
        self.check_version()?;
        self.ask_anyhow(question)
    }

    /// The same of a board of any version.
    fn ask_anyhow<T>(&mut self, question: &Question<'_, T>) -> Result<T, ClientError> {
        let exchanged = {
            let mut exchange = self.exchange();
            if question.request.doing() != Doing::Reads {
                exchange.check_known(self.connection).map_err(ClientError::Refused)?;
            }
            exchange.ask(&question.request)
        };
        let Exchanged { arrival, sent_s, attempts } = exchanged?;
        match self.read(question, &arrival, sent_s) {
            Err(ClientError::Refused(Refusal::NotConnected))
                if attempts > 1 && question.request.doing() == Doing::Acts =>
            {
                Err(TransportError::OutcomeUnknown { port: self.port.clone(), request: question.name }.into())
            }
            end => end,
        }
    }

    /// Reads the reply to a question that was first sent at `sent_s`.
    fn read<T>(&mut self, question: &Question<'_, T>, arrival: &Arrival, sent_s: f64) -> Result<T, ClientError> {
        let reply: Reply =
            postcard::from_bytes(&arrival.payload).map_err(|_| AnswerError::Payload { request: question.name })?;
        if reply.at != NO_TIME {
            self.answered_at = reply.at;
            let board_s = 1e-6 * reply.at.0 as f64;
            self.clock.observe(RoundTrip { sent_s, board_s, received_s: arrival.received_s });
        }
        Ok(question.read(reply.result.map_err(ClientError::Refused)?)?)
    }

    /// The line, when it is this client's turn.
    fn exchange(&self) -> MutexGuard<'_, Exchange> {
        self.line.take()
    }

    fn check_version(&self) -> Result<(), ClientError> {
        match self.version.protocol {
            PROTOCOL => Ok(()),
            board => Err(ClientError::Refused(Refusal::Protocol { board })),
        }
    }
}

impl Drop for Client {
    /// Closes the port, though a session of a guest may have the line for a moment longer: whoever opens it next serves its socket.
    fn drop(&mut self) {
        if let Some(mut exchange) = self.line.take_before(Instant::now() + CLOSE) {
            exchange.replace_link(Box::new(Unplugged(self.port.clone())));
        }
    }
}

/// No port.
struct Unplugged(String);

impl Link for Unplugged {
    fn send(&mut self, _: &[u8]) -> Result<(), LinkError> {
        Err(LinkError::Closed { port: self.0.clone() })
    }

    fn receive(&mut self, _: &mut [u8], _: Duration) -> Result<usize, LinkError> {
        Err(LinkError::Closed { port: self.0.clone() })
    }

    fn now_s(&self) -> f64 {
        host_now_s()
    }

    fn name(&self) -> &str {
        &self.0
    }
}

fn identify(exchange: &mut Exchange) -> Result<Identity, ClientError> {
    let payload = exchange.ask_bootstrap("identify", bootstrap::Request::Identify)?;
    Identity::decode(&payload).ok_or(AnswerError::Payload { request: "identify" }.into())
}

fn version(exchange: &mut Exchange) -> Result<Version, ClientError> {
    let payload = exchange.ask_bootstrap("version", bootstrap::Request::Version)?;
    Version::decode(&payload).ok_or(AnswerError::Payload { request: "version" }.into())
}

#[cfg(test)]
mod tests;
