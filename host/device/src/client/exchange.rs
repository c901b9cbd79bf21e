//! One request and its answer: numbered, sent again until the answer comes.

use std::time::Duration;

use darm_core::units::Micros;
use darm_core::wire::bootstrap;
use darm_core::wire::frame::{self, FrameError, Header, MAX_FRAME};
use darm_core::wire::message::{REPLY, REQUEST, Refusal, Reply, Request};

use super::error::{AnswerError, ClientError, TransportError};
use super::question::Question;
use super::reader::{Piece, Reader};
use super::retry_timer::RetryTimer;
use crate::clock::{BoardClock, RoundTrip};
use crate::link::Link;

/// Without an answer for this time the board is not there.
pub(super) const PATIENCE_S: f64 = 8.0;
/// A command is given up sooner: an arm that moves late surprises people.
pub(super) const COMMAND_PATIENCE_S: f64 = 2.0;
/// Storing a table erases a slot and writes it.
pub(super) const STORE_PATIENCE_S: f64 = 30.0;

/// What is to be answered is sent this often before it is given up: of 30 % of frames lost on either way a command then fails once in 300.
const MIN_TRIES: f64 = 8.0;

/// What has gone over the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Frames sent, those that were sent again included.
    pub sent: u32,
    /// Frames that were sent again.
    pub again: u32,
    /// Bytes of the frames that were sent.
    pub sent_bytes: u64,
    /// Frames that arrived complete.
    pub received: u32,
    /// Frames that arrived damaged.
    pub damaged: u32,
}

/// Numbers of requests. The board refuses a request that changes something when its number is up to half the range behind
/// that of the last one that did, so those have a counter of their own: each is two ahead of the one before, however many
/// questions lie between. They are even and questions are odd: no late answer is taken for that to the other kind.
#[derive(Clone, Copy, Debug)]
struct Numbers {
    question: u16,
    change: u16,
}

impl From<u16> for Numbers {
    fn from(start: u16) -> Self {
        Self { question: start | 1, change: start & !1 }
    }
}

impl Numbers {
    fn next(&mut self, repeatable: bool) -> u16 {
        let counter = if repeatable { &mut self.question } else { &mut self.change };
        *counter = counter.wrapping_add(2);
        *counter
    }
}

/// A reply with the time at which it came.
#[derive(Clone, Debug)]
pub(super) struct Arrival {
    pub(super) number: u16,
    pub(super) payload: Vec<u8>,
    pub(super) received_s: f64,
}

/// An answer with what it took to get it.
struct Exchanged {
    arrival: Arrival,
    /// Host time of the first sending.
    sent_s: f64,
    /// How often the request was sent.
    attempts: u32,
}

/// Who hears the text that comes outside frames.
pub(super) type OnText = Box<dyn FnMut(&[u8]) + Send>;

/// The line with its numbering.
pub(super) struct Exchange {
    link: Box<dyn Link>,
    reader: Reader,
    on_text: OnText,
    connection: u32,
    numbers: Numbers,
    clock: BoardClock,
    retry_timer: RetryTimer,
    counts: Counts,
    /// Board time of the last answer of the protocol.
    answered_at: Micros,
    last_damage: Option<FrameError>,
    /// Frames that were read and not yet looked at.
    arrived: std::collections::VecDeque<(Header, Arrival)>,
}

impl Exchange {
    pub(super) fn new(link: Box<dyn Link>, connection: u32) -> Self {
        Self {
            link,
            reader: Reader::default(),
            on_text: Box::new(|_| {}),
            connection,
            // Answers to an earlier host's last requests may still be on the line.
            numbers: Numbers::from(connection as u16),
            clock: BoardClock::default(),
            retry_timer: RetryTimer::default(),
            counts: Counts::default(),
            answered_at: Micros(0),
            last_damage: None,
            arrived: std::collections::VecDeque::new(),
        }
    }

    pub(super) fn link(&self) -> &dyn Link {
        &*self.link
    }

    pub(super) fn clock(&self) -> &BoardClock {
        &self.clock
    }

    pub(super) fn counts(&self) -> Counts {
        self.counts
    }

    pub(super) fn answered_at(&self) -> Micros {
        self.answered_at
    }

    /// How long the line takes to answer.
    pub(super) fn retry_timer(&mut self) -> &mut RetryTimer {
        &mut self.retry_timer
    }

    pub(super) fn set_on_text(&mut self, on_text: OnText) {
        self.on_text = on_text;
    }

    pub(super) fn replace_link(&mut self, link: Box<dyn Link>) {
        self.link = link;
        self.reader = Reader::default();
        self.arrived.clear();
    }

    /// Takes another number for the connection. 0 is the bootstrap set's.
    pub(super) fn new_connection(&mut self) {
        // A step of an odd constant never meets an earlier number of this host within 2³² connections.
        self.connection = self.connection.wrapping_add(0x9E37_79B9).max(1);
    }

    pub(super) fn send_raw(&mut self, bytes: &[u8]) -> Result<(), ClientError> {
        Ok(self.link.send(bytes)?)
    }

    pub(super) fn listen(&mut self, for_s: f64) -> Result<(), ClientError> {
        let end_s = self.link.now_s() + for_s;
        while self.link.now_s() < end_s {
            self.pump(end_s)?;
        }
        self.arrived.clear();
        Ok(())
    }

    /// Asks a question of the bootstrap set; the answer's payload.
    pub(super) fn ask_bootstrap(
        &mut self,
        name: &'static str,
        request: bootstrap::Request,
    ) -> Result<Vec<u8>, ClientError> {
        let header = Header { tag: request.tag(), link: self.connection, number: self.numbers.next(true) };
        let answered = Header { tag: request.tag() | bootstrap::ANSWER, ..header };
        let bytes = encode(header, request.payload())?;
        let arrival = self.exchange(&bytes, answered, PATIENCE_S)?.arrival;
        if arrival.payload.is_empty() {
            Err(AnswerError::Payload { request: name }.into())
        } else {
            Ok(arrival.payload)
        }
    }

    /// Asks a question of the protocol.
    pub(super) fn ask<T>(&mut self, question: &Question<'_, T>) -> Result<T, ClientError> {
        let Question { name, request, .. } = question;
        let patience_s = match request {
            Request::Command(_) => COMMAND_PATIENCE_S,
            request if request.is_repeatable() => PATIENCE_S,
            _ => STORE_PATIENCE_S,
        };
        let (header, bytes) = self.prepare(request)?;
        let answered = Header { tag: REPLY, ..header };
        let exchanged = self.exchange(&bytes, answered, patience_s);
        if exchanged.is_err() && matches!(request, Request::Command(_)) {
            self.stop_behind()?;
        }
        let Exchanged { arrival, sent_s, attempts } = exchanged?;
        match self.open(question, &arrival, sent_s) {
            Err(ClientError::Refused(Refusal::NotConnected)) if attempts > 1 && acts_once(request) => {
                Err(TransportError::OutcomeUnknown { port: self.link.name().to_owned(), request: name }.into())
            }
            end => end,
        }
    }

    /// Sends a stop behind a command that nobody has answered. A line that held both back lets them through together, and the board finds
    /// the stop first: what was reported as failed does not act later.
    fn stop_behind(&mut self) -> Result<(), ClientError> {
        let stop = bootstrap::Request::Stop;
        let header = Header { tag: stop.tag(), link: 0, number: self.numbers.next(true) };
        self.send(&encode(header, stop.payload())?, false)
    }

    /// Numbers and encodes a request.
    pub(super) fn prepare(&mut self, request: &Request<'_>) -> Result<(Header, Vec<u8>), ClientError> {
        let number = self.numbers.next(request.is_repeatable());
        let header = Header { tag: REQUEST, link: self.connection, number };
        let mut payload = [0; frame::MAX_PAYLOAD];
        let used = postcard::to_slice(request, &mut payload).map_err(|_| AnswerError::Request(FrameError::TooLong))?;
        let bytes = encode(header, used)?;
        Ok((header, bytes))
    }

    /// Reads the reply to a question that was first sent at `sent_s`.
    pub(super) fn open<T>(
        &mut self,
        question: &Question<'_, T>,
        arrival: &Arrival,
        sent_s: f64,
    ) -> Result<T, ClientError> {
        let reply: Reply =
            postcard::from_bytes(&arrival.payload).map_err(|_| AnswerError::Payload { request: question.name })?;
        self.answered_at = reply.at;
        let board_s = 1e-6 * reply.at.0 as f64;
        self.clock.observe(RoundTrip { sent_s, board_s, received_s: arrival.received_s });
        Ok(question.read(reply.result.map_err(ClientError::Refused)?)?)
    }

    /// Sends a complete frame.
    pub(super) fn send(&mut self, frame: &[u8], again: bool) -> Result<(), ClientError> {
        self.counts.sent += 1;
        self.counts.again += u32::from(again);
        self.counts.sent_bytes += frame.len() as u64;
        self.send_raw(frame)
    }

    /// The next reply of this connection, until host time `end_s`.
    pub(super) fn next_reply(&mut self, end_s: f64) -> Result<Option<Arrival>, ClientError> {
        let connection = self.connection;
        self.next_arrival(end_s, |header| header.tag == REPLY && header.link == connection)
    }

    /// Why no answer came.
    pub(super) fn silence(&self, attempts: u32, waited_s: f64, damaged_before: u32) -> ClientError {
        let port = self.link.name().to_owned();
        match self.last_damage {
            Some(last) if self.counts.damaged > damaged_before => {
                AnswerError::Damaged { port, count: self.counts.damaged - damaged_before, last }.into()
            }
            _ => TransportError::Silent { port, attempts, waited_s }.into(),
        }
    }

    /// Sends a frame until its answer comes.
    fn exchange(&mut self, bytes: &[u8], answered: Header, patience_s: f64) -> Result<Exchanged, ClientError> {
        let sent_s = self.link.now_s();
        let damaged_before = self.counts.damaged;
        let mut attempts = 0;
        loop {
            self.send(bytes, attempts > 0)?;
            attempts += 1;
            let end_s = self.link.now_s() + self.retry_timer.wait_s().min(patience_s / MIN_TRIES);
            if let Some(arrival) = self.next_arrival(end_s, |header| *header == answered)? {
                // Which of several requests an answer belongs to cannot be decided (RFC 6298, section 3).
                if attempts == 1 {
                    self.retry_timer.on_answer(arrival.received_s - sent_s);
                }
                return Ok(Exchanged { arrival, sent_s, attempts });
            }
            self.retry_timer.on_silence();
            let waited_s = self.link.now_s() - sent_s;
            if waited_s > patience_s {
                return Err(self.silence(attempts, waited_s, damaged_before));
            }
        }
    }

    fn next_arrival(&mut self, end_s: f64, wanted: impl Fn(&Header) -> bool) -> Result<Option<Arrival>, ClientError> {
        loop {
            while let Some((header, arrival)) = self.arrived.pop_front() {
                if wanted(&header) {
                    return Ok(Some(arrival));
                }
            }
            if self.link.now_s() >= end_s {
                return Ok(None);
            }
            self.pump(end_s)?;
        }
    }

    /// Reads what the link has, waiting until `end_s` at most.
    fn pump(&mut self, end_s: f64) -> Result<(), ClientError> {
        let mut buffer = [0; 1024];
        // Less than a clock tick would never pass in virtual time.
        let wait_s = (end_s - self.link.now_s()).max(1e-5);
        let count = self.link.receive(&mut buffer, Duration::from_secs_f64(wait_s))?;
        let received_s = self.link.now_s();
        for piece in self.reader.read(received_s, &buffer[..count]) {
            match piece {
                Piece::Text(text) => (self.on_text)(&text),
                Piece::Damaged(error) => {
                    self.counts.damaged += 1;
                    self.last_damage = Some(error);
                }
                Piece::Frame(header, payload) => {
                    self.counts.received += 1;
                    let arrival = Arrival { number: header.number, payload, received_s };
                    self.arrived.push_back((header, arrival));
                }
            }
        }
        Ok(())
    }
}

/// Whether a request must not be repeated on a new connection. An upload is: a repeated `Commit` changes nothing.
fn acts_once(request: &Request<'_>) -> bool {
    !request.is_repeatable() && !matches!(request, Request::Commit(_))
}

fn encode(header: Header, payload: &[u8]) -> Result<Vec<u8>, ClientError> {
    let mut bytes = [0; MAX_FRAME];
    let len = frame::encode(header, payload, &mut bytes).map_err(AnswerError::Request)?;
    Ok(bytes[..len].to_vec())
}
