//! One request and its answer: numbered, sent again until the answer comes.

use std::time::Duration;

use darm_core::sequencer::CommandError;
use darm_core::wire::bootstrap;
use darm_core::wire::frame::{self, FrameError, Header, MAX_FRAME};
use darm_core::wire::message::{REPLY, REQUEST, Refusal, Reply, Request};

use super::error::{AnswerError, ClientError, TransportError};
use super::question;
use super::reader::{Piece, Reader};
use super::retry_timer::RetryTimer;
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
pub(super) struct Exchanged {
    pub(super) arrival: Arrival,
    /// Host time of the first sending.
    pub(super) sent_s: f64,
    /// How often the request was sent.
    pub(super) attempts: u32,
}

/// Who hears the text that comes outside frames.
pub(super) type OnText = Box<dyn FnMut(&[u8]) + Send>;
/// The same for a guest; false when it has gone.
pub(super) type OnGuestText = Box<dyn FnMut(&[u8]) -> bool + Send>;

/// Tag of the answer to a request that a guest of the port has no right to; its payload is a sentence. No board sends it.
pub(super) const DENIED: u8 = 0xF0;

/// Counts the stops that were sent past the line.
pub(super) type CountStops = Box<dyn Fn() -> u64 + Send>;

/// How often `Hello` is said until one carries the board's last challenge: the first learns it, and other hosts that connect at the
/// same time, and stops, change it.
const HELLOS: u32 = 8;

/// What was known when `Hello` was said: nothing is changed on another connection, and by guests nothing beside another table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Known {
    pub(super) connection: u32,
    /// How many connections a stop has ended.
    stopped: u64,
    /// How often what the board has stored was changed.
    pub(super) stores: u64,
}

/// The line with its numbering.
pub(super) struct Exchange {
    link: Box<dyn Link>,
    reader: Reader,
    on_text: OnText,
    on_guest_text: Vec<OnGuestText>,
    connection: u32,
    /// How often what the board has stored was changed.
    stores: u64,
    count_stops: CountStops,
    /// Their number when the connection was opened: after another one the board takes no command from it. `None` where the board has
    /// said so itself, as after a stop that did not come from here.
    stops_at_hello: Option<u64>,
    /// How many connections a stop has ended.
    stopped: u64,
    numbers: Numbers,
    retry_timer: RetryTimer,
    counts: Counts,
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
            on_guest_text: Vec::new(),
            connection,
            stores: 0,
            count_stops: Box::new(|| 0),
            stops_at_hello: Some(0),
            stopped: 0,
            // Answers to an earlier host's last requests may still be on the line.
            numbers: Numbers::from(connection as u16),
            retry_timer: RetryTimer::default(),
            counts: Counts::default(),
            last_damage: None,
            arrived: std::collections::VecDeque::new(),
        }
    }

    pub(super) fn link(&self) -> &dyn Link {
        &*self.link
    }

    pub(super) fn counts(&self) -> Counts {
        self.counts
    }

    /// What whoever says `Hello` now knows.
    pub(super) fn known(&self) -> Known {
        Known { connection: self.connection, stopped: self.stopped, stores: self.stores }
    }

    /// Whether whoever has said `Hello` then may change something now.
    ///
    /// # Errors
    ///
    /// What the board would refuse: a stop came since, or another connection was opened.
    pub(super) fn check_known(&self, known: Known) -> Result<(), Refusal> {
        if self.is_stopped() || known.stopped != self.stopped {
            Err(Refusal::Command(CommandError::Stopped))
        } else if known.connection != self.connection {
            Err(Refusal::NotConnected)
        } else {
            Ok(())
        }
    }

    /// How long the line takes to answer.
    pub(super) fn retry_timer(&mut self) -> &mut RetryTimer {
        &mut self.retry_timer
    }

    pub(super) fn set_on_text(&mut self, on_text: OnText) {
        self.on_text = on_text;
    }

    pub(super) fn add_guest(&mut self, on_text: OnGuestText) {
        self.on_guest_text.push(on_text);
    }

    pub(super) fn replace_link(&mut self, link: Box<dyn Link>) {
        self.link = link;
        self.reader = Reader::default();
        self.arrived.clear();
    }

    /// Stops are counted by this from now on; it has counted none before the connection was opened.
    pub(super) fn count_stops_by(&mut self, count_stops: CountStops) {
        (self.count_stops, self.stops_at_hello) = (count_stops, Some(0));
    }

    /// Whether a stop has come since the connection was opened, as far as is known.
    pub(super) fn is_stopped(&self) -> bool {
        self.stops_at_hello != Some((self.count_stops)())
    }

    /// The board's reply to `Hello` on the connection that is open; where a stop has ended it, or the board has, on another one.
    pub(super) fn join_connection(&mut self) -> Result<Exchanged, ClientError> {
        if self.is_stopped() {
            return self.open_connection();
        }
        // With this challenge the board opens no connection.
        let exchanged = self.ask(&question::hello(0).request)?;
        match refusal(&exchanged.arrival) {
            Some(Refusal::Challenge { .. }) => self.open_connection(),
            Some(_) | None => Ok(exchanged),
        }
    }

    /// Opens another connection; the board's reply to `Hello`.
    pub(super) fn open_connection(&mut self) -> Result<Exchanged, ClientError> {
        // A step of an odd constant never meets an earlier number of this host within 2³² connections. 0 is the bootstrap set's.
        self.connection = self.connection.wrapping_add(0x9E37_79B9).max(1);
        self.stopped += u64::from(self.is_stopped());
        self.stops_at_hello = Some((self.count_stops)());
        let (mut challenge, mut tries) = (0, 0);
        loop {
            tries += 1;
            let exchanged = self.ask(&question::hello(challenge).request)?;
            match refusal(&exchanged.arrival) {
                Some(Refusal::Challenge { challenge: last }) if tries < HELLOS => challenge = last,
                Some(_) | None => return Ok(exchanged),
            }
        }
    }

    /// Types a line that changes something, unless it is late. A stop between the look and the bytes is sent again behind them.
    pub(super) fn type_change(&mut self, line: &str, is_late: impl Fn() -> bool) -> Result<(), ClientError> {
        if is_late() {
            return Err(overtaken());
        }
        self.send_raw(format!("{line}\r").as_bytes())?;
        if is_late() { self.stop_behind() } else { Ok(()) }
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

    /// Sends a request of the protocol until its reply comes.
    pub(super) fn ask(&mut self, request: &Request<'_>) -> Result<Exchanged, ClientError> {
        let patience_s = match request {
            Request::Command(_) => COMMAND_PATIENCE_S,
            request if request.is_repeatable() => PATIENCE_S,
            _ => STORE_PATIENCE_S,
        };
        // Whatever the answer: what was stored before is not certain any more.
        self.stores += u64::from(matches!(request, Request::Commit(_) | Request::Calibrate(_)));
        let (header, bytes) = self.prepare(request)?;
        let answered = Header { tag: REPLY, ..header };
        let exchanged = self.exchange(&bytes, answered, patience_s);
        // Where it was denied nothing was sent to the board, and somebody else moves the arm.
        let may_act = !matches!(exchanged, Ok(_) | Err(ClientError::Denied(_)));
        if may_act && matches!(request, Request::Command(_)) {
            self.stop_behind()?;
        }
        if let Ok(Exchanged { arrival, .. }) = &exchanged
            && refusal(arrival) == Some(Refusal::Command(CommandError::Stopped))
        {
            self.stops_at_hello = None;
        }
        exchanged
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

    /// Sends a complete frame.
    pub(super) fn send(&mut self, frame: &[u8], again: bool) -> Result<(), ClientError> {
        self.counts.sent += 1;
        self.counts.again += u32::from(again);
        self.counts.sent_bytes += frame.len() as u64;
        self.send_raw(frame)
    }

    /// The next reply of this connection, until host time `end_s`.
    pub(super) fn next_reply(&mut self, end_s: f64) -> Result<Option<Arrival>, ClientError> {
        let (connection, tags) = (self.connection, [REPLY, DENIED]);
        let arrived = self.next_arrival(end_s, |header| tags.contains(&header.tag) && header.link == connection)?;
        match arrived {
            Some((Header { tag: DENIED, .. }, arrival)) => Err(denial(&arrival)),
            arrived => Ok(arrived.map(|(_, arrival)| arrival)),
        }
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
            let denied = Header { tag: DENIED, ..answered };
            if let Some((header, arrival)) = self.next_arrival(end_s, |header| [answered, denied].contains(header))? {
                if header == denied {
                    return Err(denial(&arrival));
                }
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

    fn next_arrival(
        &mut self,
        end_s: f64,
        wanted: impl Fn(&Header) -> bool,
    ) -> Result<Option<(Header, Arrival)>, ClientError> {
        loop {
            while let Some((header, arrival)) = self.arrived.pop_front() {
                if wanted(&header) {
                    return Ok(Some((header, arrival)));
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
                Piece::Text(text) => {
                    (self.on_text)(&text);
                    self.on_guest_text.retain_mut(|hears| hears(&text));
                }
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

/// What was to be done is not wanted any more, or nobody expects it.
pub(super) fn overtaken() -> ClientError {
    ClientError::Denied("a stop came meanwhile, or it waited too long".to_owned())
}

fn denial(arrival: &Arrival) -> ClientError {
    ClientError::Denied(String::from_utf8_lossy(&arrival.payload).into_owned())
}

/// What the board refuses in a reply.
pub(super) fn refusal(arrival: &Arrival) -> Option<Refusal> {
    postcard::from_bytes::<Reply>(&arrival.payload).ok()?.result.err()
}

/// A frame.
pub(super) fn encode(header: Header, payload: &[u8]) -> Result<Vec<u8>, ClientError> {
    let mut bytes = [0; MAX_FRAME];
    let len = frame::encode(header, payload, &mut bytes).map_err(AnswerError::Request)?;
    Ok(bytes[..len].to_vec())
}
